"""`layoutexplore evaluate train-fans`: the classifier of what beams have painted outside a building."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from layoutexplore.cli.evaluate.options import PlanFolders
from layoutexplore.files import check_file, check_places


def train_fans(
    out: Annotated[Path, typer.Option(help="File for the numbers of the classifier.")],
    simulated: Annotated[int, typer.Option(min=1, help="Simulated maps to train on.")] = 450,
    plans: PlanFolders = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the training.")] = 0,
) -> None:
    """Train what the default method tells space outside the building by, on simulated maps with noise."""
    from layoutexplore.cli.progress import progress_lines
    from layoutexplore.layout.merging.ray_fans.classifier import FAN_FOREST
    from layoutexplore.maps.library import find_plans
    from layoutexplore.training.map_noise.ray_fans import train_on_simulated_maps

    check_places(None, out, file="--out")
    check_file(out, suffixes=(".json",))
    names = find_plans(plans or ())
    forest = train_on_simulated_maps(simulated, names, seed=seed, progress=progress_lines())
    note = f"log-odds that a region lies outside; trained on {simulated} simulated maps, seed {seed}"
    FAN_FOREST.save(forest, out, note=note)
    typer.echo(f"written: {out}, {len(forest.roots)} trees")
