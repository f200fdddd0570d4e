"""`layoutexplore evaluate`: the layout methods against ground truth."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from layoutexplore.cli.closed_doors import HELP as CLOSED_DOORS_HELP
from layoutexplore.cli.closed_doors import closed_doors
from layoutexplore.cli.clutter import HELP as CLUTTER_HELP
from layoutexplore.cli.clutter import clutter
from layoutexplore.cli.in_the_loop import HELP as IN_THE_LOOP_HELP
from layoutexplore.cli.in_the_loop import in_the_loop
from layoutexplore.cli.partial_rooms import HELP as PARTIAL_ROOMS_HELP
from layoutexplore.cli.partial_rooms import partial_rooms
from layoutexplore.cli.train_predictor import HELP as TRAIN_PREDICTOR_HELP
from layoutexplore.cli.train_predictor import train_predictor
from layoutexplore.files import check_places, write_json

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from layoutexplore.evaluation.segmentation import MapScore
    from layoutexplore.maps.painted_rooms import Case

group = typer.Typer(
    name="evaluate", help="Score the layout methods against ground truth.", no_args_is_help=True
)

Methods = Annotated[
    list[str] | None, typer.Option("--method", "-m", help="Method; repeat for several side by side.")
]
Resolution = Annotated[float, typer.Option(min=0.001, help="Metres a pixel.")]
JsonFile = Annotated[Path | None, typer.Option("--json", help="Write every number into this file.")]
Weights = Annotated[
    list[str] | None,
    typer.Option("--weight", help="FOLDER=NUMBER: weight in training of a folder's maps, else 1; repeat."),
]
Jobs = Annotated[int, typer.Option(min=1, help="Processes; compare times with 1 only.")]


Protocol = Annotated[
    str, typer.Option(help="rose2, or bormann: segments and rooms up to 100 pixels are dropped.")
]
MergingFolds = Annotated[
    int, typer.Option(min=0, help="Cross-validate the default method over so many folds of buildings.")
]
Seeds = Annotated[int, typer.Option(min=1, help="Train the folds' judges so often, with other seeds.")]
BuildingsFile = Annotated[
    Path | None, typer.Option(help="CSV of map,building (map as NAME or FOLDER/NAME), for the folds.")
]
Simulated = Annotated[int, typer.Option(min=0, help="Simulated maps each fold is trained on besides.")]
PlanFolders = Annotated[
    list[str] | None, typer.Option(help="Folder of floor plans to simulate from, besides generated ones.")
]


def register(app: typer.Typer) -> None:
    """Add `evaluate` to the command line."""
    app.add_typer(group)


EXAMPLE = (
    "Example: layoutexplore evaluate partial-rooms office-01 school-01 -p layout -p hull --snapshots kept/"
)
group.command("partial-rooms", help=PARTIAL_ROOMS_HELP, epilog=EXAMPLE)(partial_rooms)
EXAMPLE = (
    "Example: layoutexplore evaluate train-predictor schools/ office:0-99 --folds 4 --store kept/ "
    "--out models/"
)
group.command("train-predictor", help=TRAIN_PREDICTOR_HELP, epilog=EXAMPLE)(train_predictor)
EXAMPLE = (
    "Example: layoutexplore evaluate in-the-loop test -p reconstruct:rose2 -p layout -p oracle "
    "--out in-the-loop"
)
group.command("in-the-loop", help=IN_THE_LOOP_HELP, epilog=EXAMPLE)(in_the_loop)
EXAMPLE = "Example: layoutexplore evaluate closed-doors maps/ --out predicted"
group.command("closed-doors", help=CLOSED_DOORS_HELP, epilog=EXAMPLE)(closed_doors)


@group.command(
    "segmentation",
    epilog="Example: layoutexplore evaluate segmentation maps/ -m default -m rose2 --out report",
)
def segmentation(
    folders: Annotated[list[Path], typer.Argument(help="Folders with NAME.png and NAME_gt.png.")],
    method: Methods = None,
    protocol: Protocol = "rose2",
    folds: MergingFolds = 0,
    seeds: Seeds = 1,
    buildings: BuildingsFile = None,
    simulated: Simulated = 150,
    plans: PlanFolders = None,
    weight: Weights = None,
    resolution: Resolution = 0.05,
    json_file: JsonFile = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for report.html, results.csv and a picture per map.")
    ] = None,
    jobs: Jobs = 1,
) -> None:
    """Room segmentation: precision, recall, IoU, one-to-one and coverages, per map and over all."""
    from layoutexplore.cli.progress import progress_lines
    from layoutexplore.errors import ConfigError, require
    from layoutexplore.evaluation.cross_validation import CrossValidationConfig, cross_validate_merging
    from layoutexplore.evaluation.segmentation import evaluate_cases, seed_spread, summarise_segmentation
    from layoutexplore.layout.pipeline import layout_method
    from layoutexplore.maps.painted_rooms import find_cases
    from layoutexplore.metrics.segmentation import PROTOCOLS

    if protocol not in PROTOCOLS:
        raise ConfigError(f"unknown protocol {protocol!r}: known are {', '.join(PROTOCOLS)}")
    methods = list(dict.fromkeys(method or ["default"]))
    for name in methods:
        layout_method(name)
    cases = find_cases(folders, _read_buildings(buildings) if buildings else None)
    _check_folds(folds, methods, {"--seeds": seeds > 1, "--plans": bool(plans), "--weight": bool(weight)})
    check_places(out, json_file)
    if out is not None:
        require("jinja2", "bench")
    if folds:
        config = CrossValidationConfig(
            folds=folds,
            protocol=protocol,
            resolution=resolution,
            simulated=simulated,
            plans=tuple(_plans(plans)),
            seeds=seeds,
            weights=_weights(weight, cases),
        )
        results = cross_validate_merging(cases, config, progress=progress_lines())
    else:
        results = evaluate_cases(cases, methods, protocol=protocol, resolution=resolution, jobs=jobs)
    collected = []
    for case, row, labels in results:
        collected.append((case, row, labels))
        typer.echo(_line(row))
    rows = [row for _, row, _ in collected]
    _print_summary(summarise_segmentation(rows))
    if seeds > 1:
        _print_spread(seed_spread(rows))
    _write_results(collected, json_file, out, protocol=protocol, resolution=resolution, folds=folds)


def _check_folds(folds: int, methods: Sequence[str], training: dict[str, bool]) -> None:
    """Refuse other methods with folds, and options of the training, given or not, without."""
    from layoutexplore.errors import ConfigError

    if folds and methods != ["default"]:
        raise ConfigError("--folds cross-validates the default method, the only one that is trained")
    for option, given in training.items():
        if given and not folds:
            raise ConfigError(f"{option} is about training: it needs --folds")


def _write_results(
    results: Sequence[tuple[Case, MapScore, NDArray[np.int32]]],
    json_file: Path | None,
    out: Path | None,
    *,
    protocol: str,
    resolution: float,
    folds: int,
) -> None:
    """Write every number and the report where they are wanted."""
    from layoutexplore.evaluation.segmentation import seed_spread, summarise_segmentation

    rows = [row for _, row, _ in results]
    if json_file is not None:
        numbers = {
            "protocol": protocol,
            "resolution": resolution,
            "folds": folds,
            "maps": [asdict(r) for r in rows],
        }
        write_json(json_file, numbers | {"summary": summarise_segmentation(rows), "seeds": seed_spread(rows)})
        typer.echo(f"written: {json_file}")
    if out is not None:
        from layoutexplore.processes import command_line
        from layoutexplore.report.segmentation import write_segmentation_report

        title = "Room segmentation" + (f", {folds} folds of buildings" if folds else "")
        written = write_segmentation_report(
            out, results, title=title, protocol=protocol, resolution=resolution, command=command_line()
        )
        for path in written:
            typer.echo(f"written: {path}")


def _line(row: MapScore) -> str:
    from layoutexplore.metrics.segmentation import MEASURES

    values = " ".join(f"{100 * getattr(row, m):5.1f}" for m in MEASURES)
    note = f"  ({row.warnings})" if row.warnings else ""
    return (
        f"{row.folder}/{row.map} {row.method}: {values}  {row.segments}/{row.rooms} rooms  {row.ms:.0f} "
        f"ms{note}"
    )


def _print_summary(lines: Sequence[dict[str, Any]]) -> None:
    from rich.console import Console
    from rich.table import Table

    from layoutexplore.metrics.segmentation import HEADINGS, MEASURES

    table = Table("set", "method", "maps", *HEADINGS.values(), "segments/rooms", "ms", box=None)
    for line in lines:
        values = [f"{100 * line[m]:.1f}±{100 * line[m + '_std']:.1f}" for m in MEASURES]
        counts = f"{line['segments']:.1f}/{line['rooms']:.1f}"
        table.add_row(
            line["folder"],
            line["method"],
            str(line["maps"]),
            *values,
            counts,
            f"{line['ms']:.0f}±{line['ms_std']:.0f}",
        )
    console = Console()
    (console if console.is_terminal else Console(width=200)).print(table)


def _print_spread(lines: Sequence[dict[str, Any]]) -> None:
    from layoutexplore.metrics.segmentation import HEADINGS

    for line in lines:
        values = ", ".join(f"{name} {100 * line[m]:.1f}" for m, name in HEADINGS.items())
        typer.echo(f"{line['folder']}, standard deviation of the mean over {line['seeds']} seeds: {values}")


def _read_buildings(path: Path) -> dict[str, str]:
    from layoutexplore.errors import ConfigError

    try:
        with path.open(newline="", encoding="utf-8") as file:
            table = csv.DictReader(file)
            columns, rows = {*(table.fieldnames or ())}, list(table)
    except (OSError, csv.Error, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot read the buildings: {error}") from error
    if not {"map", "building"} <= columns:
        raise ConfigError(f"{path}: a CSV with the columns map and building is needed")
    return {row["map"]: row["building"] for row in rows}


def _plans(folders: Sequence[str] | None) -> list[str]:
    from layoutexplore.maps import expand_plans

    return [plan for folder in folders or () for plan in expand_plans(folder)]


def _weights(given: Sequence[str] | None, cases: Sequence[Case]) -> dict[str, float]:
    from layoutexplore.errors import ConfigError

    folders, weights = {case.folder for case in cases}, {}
    for text in given or ():
        folder, _, number = text.rpartition("=")
        try:
            weights[folder] = float(number)
        except ValueError:
            raise ConfigError(f"--weight {text}: FOLDER=NUMBER is needed, such as cluttered=4") from None
        if folder not in folders:
            raise ConfigError(
                f"--weight {text}: no folder of that name is given; there are {', '.join(sorted(folders))}"
            )
        if not 0 < weights[folder] < float("inf"):
            raise ConfigError(f"--weight {text}: a weight must be above 0")
    return weights


@group.command(
    "train", epilog="Example: layoutexplore evaluate train maps/ --plans schools/ --out merging_model.json"
)
def train_merging(
    folders: Annotated[list[Path], typer.Argument(help="Folders with NAME.png and NAME_gt.png.")],
    out: Annotated[Path, typer.Option(help="File for the numbers of the judge.")],
    buildings: Annotated[
        Path | None, typer.Option(help="CSV of map,building (map as NAME or FOLDER/NAME).")
    ] = None,
    simulated: Annotated[int, typer.Option(min=0, help="Simulated maps to train on besides.")] = 150,
    plans: Annotated[
        list[str] | None, typer.Option(help="Folder of floor plans to simulate from, besides generated ones.")
    ] = None,
    weight: Weights = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the training.")] = 0,
    resolution: Resolution = 0.05,
) -> None:
    """Train the judge of the default method, which decides what pieces of a map are one room."""
    from layoutexplore.cli.progress import progress_lines
    from layoutexplore.layout.merging.merge_forest import save_forest
    from layoutexplore.maps.painted_rooms import find_cases
    from layoutexplore.training.room_merging import train_classifier

    check_places(out.parent)
    cases = find_cases(folders, _read_buildings(buildings) if buildings else None)
    weights = _weights(weight, cases)
    forest = train_classifier(
        cases,
        resolution=resolution,
        simulated=simulated,
        plans=_plans(plans),
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
    save_forest(forest, out, note=note)
    typer.echo(f"written: {out}, {len(forest.roots)} trees")


@group.command("layout", epilog="Example: layoutexplore evaluate layout schools/ -m default -m ias15")
def evaluate_layout(
    folder: Annotated[Path, typer.Argument(help="Folder with NAME.png and NAME_gt.xml.")],
    method: Methods = None,
    resolution: Resolution = 0.1,
    json_file: JsonFile = None,
) -> None:
    """Layouts of grid maps against floor plans, stretched onto the walls: A_FC and A_BC (IAS-15)."""
    import numpy as np

    from layoutexplore.errors import MapError
    from layoutexplore.evaluation.layouts import read_outlines, score_layout
    from layoutexplore.grids.ros_map import load_grid
    from layoutexplore.layout.pipeline import layout_method, reconstruct

    check_places(None, json_file)
    if not folder.is_dir():
        raise MapError(f"{folder}: no such folder")
    for name in method or ():
        layout_method(name)
    pairs = [(p, p.with_name(f"{p.stem}_gt.xml")) for p in sorted(folder.glob("*.png"))]
    pairs = [(image, truth) for image, truth in pairs if truth.is_file()]
    if not pairs:
        raise MapError(f"{folder}: no map NAME.png with its floor plan NAME_gt.xml")
    rows: list[dict[str, Any]] = []
    for name in dict.fromkeys(method or ["default"]):
        for image, truth in pairs:
            found = reconstruct(load_grid(image, resolution=resolution), name)
            row = {"map": image.stem, "method": name} | asdict(score_layout(found, read_outlines(truth)))
            rows.append(row | {"ms": 1000 * found.seconds})
            typer.echo(
                f"{image.stem} {name}: A_FC {100 * row['a_fc']:.1f} A_BC {100 * row['a_bc']:.1f} "
                f"P {100 * row['precision']:.1f} R {100 * row['recall']:.1f}  "
                f"{row['rooms']}/{row['true_rooms']} rooms"
            )
        part = [r for r in rows if r["method"] == name]
        means = []
        for key in ("a_fc", "a_bc", "precision", "recall"):
            values = [100 * r[key] for r in part]
            means.append(f"{key} {np.mean(values):.1f}±{np.std(values):.1f}")
        typer.echo(f"{name}, {len(part)} maps: {', '.join(means)}")
    if json_file is not None:
        write_json(json_file, {"resolution": resolution, "maps": rows})
        typer.echo(f"written: {json_file}")


EXAMPLE = "Example: layoutexplore evaluate clutter maps/*.png"
group.command("clutter", help=CLUTTER_HELP, epilog=EXAMPLE)(clutter)
