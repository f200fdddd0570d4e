"""`layoutexplore evaluate train`: the classifiers of the default layout method."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from layoutexplore.cli.evaluate.options import PlanFolders
from layoutexplore.cli.evaluate.segmentation import (
    SIMULATED,
    CaseResolution,
    Simulated,
    Weights,
    read_buildings,
    weights_of,
)
from layoutexplore.files import check_file, check_places

if TYPE_CHECKING:
    from layoutexplore.layout.merging.merge_tree.cut import MergingModels


def train_merging(
    folders: Annotated[list[Path], typer.Argument(help="Folders with NAME.png and NAME_gt.png.")],
    out: Annotated[Path, typer.Option(help="File for the classifier of pairs, merging_model.json.")],
    cut_out: Annotated[
        Path | None,
        typer.Option(help="File for that of merges, cut_model.json; beside the other one if not given."),
    ] = None,
    buildings: Annotated[
        Path | None, typer.Option(help="CSV of map,building (map as NAME or FOLDER/NAME).")
    ] = None,
    simulated: Simulated = SIMULATED,
    plans: PlanFolders = None,
    weight: Weights = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the training.")] = 0,
    resolution: CaseResolution = 0.05,
) -> None:
    """Train the classifiers of the default method, which decide which regions of a map are one room."""
    from layoutexplore.cli.progress import progress_lines
    from layoutexplore.layout.merging.merge_tree.cut import ASKEW_PREFIX, CUT_FOREST, RAGGED_PREFIX
    from layoutexplore.maps.library import find_plans
    from layoutexplore.maps.painted_rooms import find_cases
    from layoutexplore.training.map_noise.examples import POLYGONAL
    from layoutexplore.training.merge_trees.models import train_classifiers

    cut_out = cut_out or out.parent / CUT_FOREST.shipped.name
    check_places(out.parent, out, file="--out")
    check_places(cut_out.parent, cut_out, file="--cut-out")
    check_file(out, suffixes=(".json",))
    check_file(cut_out, suffixes=(".json",), option="--cut-out")
    cases = find_cases(folders, read_buildings(buildings) if buildings else None)
    weights = weights_of(weight, cases)
    models = train_classifiers(
        cases,
        resolution=resolution,
        simulated=simulated,
        plans=find_plans(plans or ()),
        seed=seed,
        weights=weights,
        progress=progress_lines(),
    )
    note = (
        f"log-odds that two touching pieces are one room; trained on {len(cases)} maps and {simulated} "
        "simulated ones"
    )
    note += f", seed {seed}" + "".join(
        f", weight {value:g} for {folder}" for folder, value in weights.items()
    )
    _write_models(models, out, cut_out, note)
    polygonal = f", and {simulated // POLYGONAL} of polygonal buildings"
    for prefix, others, more in (
        (ASKEW_PREFIX, models.askew, polygonal),
        (RAGGED_PREFIX, models.ragged, ", one half of the trees with the separator network"),
    ):
        if others is not None:
            pairs, cut = (path.with_name(prefix + path.name) for path in (out, cut_out))
            _write_models(others, pairs, cut, note + more)


def _write_models(models: MergingModels, out: Path, cut_out: Path, note: str) -> None:
    """Write the classifiers and say so."""
    from layoutexplore.layout.merging.merge_forest import PAIR_FOREST
    from layoutexplore.layout.merging.merge_tree.cut import CUT_FOREST

    PAIR_FOREST.save(models.pairs, out, note=note)
    typer.echo(f"written: {out}, {len(models.pairs.roots)} trees")
    if models.cut is None:
        typer.echo("no merge of the maps' regions is right, or none is wrong: no cut to learn")
        return
    note = note.replace("two touching pieces are one room", "a merge stands")
    CUT_FOREST.save(models.cut, cut_out, note=note)
    typer.echo(f"written: {cut_out}, {len(models.cut.roots)} trees")
