"""`layoutexplore evaluate segmentation`: rooms of grid maps."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from layoutexplore.cli.evaluate.options import JsonFile, PlanFolders, end_study, holding, write_numbers
from layoutexplore.files import check_places

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from layoutexplore.evaluation.cross_validation import CrossValidationConfig
    from layoutexplore.evaluation.segmentation import MapScore
    from layoutexplore.maps.painted_rooms import Case

Methods = Annotated[
    list[str] | None, typer.Option("--method", "-m", help="Method; repeat for several side by side.")
]
Resolution = Annotated[float, typer.Option(min=0.001, help="Metres a pixel.")]
CaseResolution = Annotated[
    float, typer.Option(min=0.001, help="Metres a pixel where no index.csv (file, m_per_px) beside says it.")
]
Weights = Annotated[
    list[str] | None,
    typer.Option("--weight", help="FOLDER=NUMBER: weight in training of a folder's maps, else 1; repeat."),
]
Jobs = Annotated[
    int, typer.Option(min=1, help="Processes, one where classifiers are trained; compare times with 1 only.")
]


Protocol = Annotated[
    str, typer.Option(help="rose2, or bormann: segments and rooms up to 100 pixels are dropped.")
]
MergingFolds = Annotated[
    int, typer.Option(min=0, help="Cross-validate the default method over so many folds of buildings.")
]
Seeds = Annotated[int, typer.Option(min=1, help="Train the folds' classifiers so often, with other seeds.")]
BuildingsFile = Annotated[
    Path | None, typer.Option(help="CSV of map,building (map as NAME or FOLDER/NAME), for the folds.")
]
LeaveOut = Annotated[
    Literal["source"] | None,
    typer.Option(help="Score each source with a classifier trained without its maps and buildings."),
]
Sources = Annotated[
    list[str] | None,
    typer.Option("--source", help="FOLDER=SOURCE: where a folder's maps come from, else its name; repeat."),
]
SIMULATED = 450
"""Simulated maps to train on unless told otherwise."""

Simulated = Annotated[
    int,
    typer.Option(
        min=0, help="Simulated maps to train on besides, to which come a third as many polygonal buildings."
    ),
]

ReportFolder = Annotated[
    Path | None,
    typer.Option(
        help="Folder for report.html, results.csv and a picture per map; the same command goes on in it."
    ),
]


def segmentation(
    folders: Annotated[list[Path], typer.Argument(help="Folders with NAME.png and NAME_gt.png.")],
    method: Methods = None,
    protocol: Protocol = "rose2",
    folds: MergingFolds = 0,
    leave_out: LeaveOut = None,
    source: Sources = None,
    seeds: Seeds = 1,
    buildings: BuildingsFile = None,
    simulated: Simulated = SIMULATED,
    plans: PlanFolders = None,
    weight: Weights = None,
    resolution: CaseResolution = 0.05,
    json_file: JsonFile = None,
    out: ReportFolder = None,
    jobs: Jobs = 1,
) -> None:
    """Room segmentation: precision, recall, IoU, one-to-one and coverages, per map and over all.

    With --leave-out source, each source of maps is scored with a classifier trained without it: the figure to
    expect of maps from elsewhere, and the one by which models are chosen.
    """
    from layoutexplore.errors import require
    from layoutexplore.evaluation.cross_validation import CrossValidationConfig
    from layoutexplore.evaluation.segmentation import evaluate_cases, usable_cases
    from layoutexplore.maps.library import find_plans
    from layoutexplore.maps.painted_rooms import find_cases

    _check_known(protocol, methods := list(dict.fromkeys(method or ["default"])))
    cases = find_cases(folders, read_buildings(buildings) if buildings else None)
    training = {"--seeds": seeds > 1, "--plans": bool(plans), "--weight": bool(weight)}
    training |= {"--simulated": simulated != SIMULATED, "--source": bool(source)}
    _check_held_out(folds, leave_out, methods, training)
    check_places(out, json_file)
    if out is not None:
        require("jinja2", "bench")
    _say_scales(cases)
    cases, failed = usable_cases(cases, resolution)
    with holding(out):
        if folds or leave_out:
            _say_guesses(cases)
            config = CrossValidationConfig(
                folds=folds,
                protocol=protocol,
                resolution=resolution,
                simulated=simulated,
                plans=tuple(find_plans(plans or ())),
                seeds=seeds,
                weights=weights_of(weight, cases),
                sources=_sources(source, cases),
            )
            results = _scores_held_out(cases, config, out, by_source=leave_out is not None)
        else:
            results = evaluate_cases(
                cases, methods, protocol=protocol, resolution=resolution, jobs=jobs, store=_store(out)
            )
        collected = _collect(results, failed)
        _print_all([row for _, row, _ in collected], by_source=leave_out is not None)
        held_out = "each source left out" if leave_out else f"{folds} folds of buildings" if folds else ""
        said = {"protocol": protocol, "resolution": resolution, "held_out": held_out, "failed": failed}
        _write_results(collected, json_file, out, said)
    end_study(failed)


def _check_known(protocol: str, methods: Iterable[str]) -> None:
    """Raise a `ConfigError` where there is no such protocol or layout method."""
    from layoutexplore.errors import ConfigError, shortened
    from layoutexplore.layout.pipeline import layout_method
    from layoutexplore.metrics.segmentation import PROTOCOLS

    if protocol not in PROTOCOLS:
        raise ConfigError(f"unknown protocol {shortened(protocol)}: known are {', '.join(PROTOCOLS)}")
    for name in methods:
        layout_method(name)


def _collect(
    results: Iterable[tuple[Case, MapScore, NDArray[np.int32]]], failed: list[str]
) -> list[tuple[Case, MapScore, NDArray[np.int32]]]:
    """All results, each printed as it comes; where a worker dies, those before, and `failed` tells of it."""
    from layoutexplore.errors import WorkerError

    collected = []
    try:
        for result in results:
            collected.append(result)
            typer.echo(_line(result[1]))
    except WorkerError as error:
        if not collected:
            raise
        failed.append(f"what comes after {collected[-1][0].name}: {error}")
    return collected


def _scores_held_out(
    cases: Sequence[Case], config: CrossValidationConfig, out: Path | None, *, by_source: bool
) -> Iterator[tuple[Case, MapScore, NDArray[np.int32]]]:
    """Each map with its score by a classifier that has seen no map of its fold, or of its source."""
    from layoutexplore.cli.progress import progress_lines
    from layoutexplore.evaluation.cross_validation import cross_validate_merging, leave_sources_out

    validate = leave_sources_out if by_source else cross_validate_merging
    return validate(cases, config, progress_lines(), store=_store(out))


def _store(out: Path | None) -> Path | None:
    """Where scores are kept as they come."""
    return out and out / "scores"


def _say_scales(cases: Sequence[Case]) -> None:
    scales = [case.resolution for case in cases if case.resolution]
    if scales:
        span = " to ".join(f"{value:g}" for value in dict.fromkeys((min(scales), max(scales))))
        typer.echo(
            f"note: {len(scales)} of {len(cases)} maps at the scale of their index.csv, {span} m a pixel"
        )


def _say_guesses(cases: Sequence[Case]) -> None:
    """Which maps are held out with their whole folder, as nobody tells their building."""
    names = [f"{case.folder}/{case.name}" for case in cases if case.is_guess]
    if names:
        shown = ", ".join(names[:8]) + (", ..." if len(names) > 8 else "")
        typer.echo(
            f"note: the building of {len(names)} maps is a guess, their folder: {shown} (--buildings FILE)"
        )


def _check_held_out(
    folds: int, leave_out: str | None, methods: Sequence[str], training: dict[str, bool]
) -> None:
    """Refuse other methods where the method is trained, and options of the training elsewhere."""
    from layoutexplore.errors import ConfigError

    if folds and leave_out:
        raise ConfigError("--folds and --leave-out are two ways to hold maps out: choose one")
    if (folds or leave_out) and methods != ["default"]:
        option = "--leave-out" if leave_out else "--folds"
        raise ConfigError(f"{option} cross-validates the default method, the only one that is trained")
    for option, given in training.items():
        if given and not (folds or leave_out):
            raise ConfigError(f"{option} is about training: it needs --folds or --leave-out")
    if training["--source"] and not leave_out:
        raise ConfigError("--source says what --leave-out source leaves out: it needs that option")


def _write_results(
    results: Sequence[tuple[Case, MapScore, NDArray[np.int32]]],
    json_file: Path | None,
    out: Path | None,
    said: dict[str, Any],
) -> None:
    """Write every number, what is said of them all, and the report where they are wanted."""
    from layoutexplore.evaluation.segmentation import score_groups, seed_spread, summarise_segmentation

    rows = [row for _, row, _ in results]
    numbers = {
        **said,
        "folds": len({row.fold for row in rows if row.fold >= 0}),
        "maps": [asdict(r) for r in rows],
        "summary": summarise_segmentation(rows),
        "seeds": seed_spread(rows),
    }
    if any(row.source for row in rows):
        numbers |= {by: score_groups(rows, by) for by in ("source", "building")}
    write_numbers(json_file, numbers)
    if out is not None:
        from layoutexplore.processes import command_line
        from layoutexplore.report.studies.segmentation import write_segmentation_report

        title = ", ".join(filter(None, ("Room segmentation", said["held_out"])))
        shown = {key: value for key, value in said.items() if key != "held_out"}
        written = write_segmentation_report(out, results, title=title, command=command_line(), **shown)
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


def _print_all(rows: Sequence[MapScore], *, by_source: bool) -> None:
    """The tables after the maps: each set, and where sources were left out each building and source."""
    from layoutexplore.evaluation.segmentation import score_groups, seed_spread, summarise_segmentation

    _print_summary(summarise_segmentation(rows))
    if by_source:
        _print_groups("building", score_groups(rows, "building"))
        _print_groups("source left out", score_groups(rows, "source"))
    if len({row.seed for row in rows}) > 1:
        _print_spread(seed_spread(rows))


def _print_groups(heading: str, lines: Sequence[dict[str, Any]]) -> None:
    from layoutexplore.cli.progress import print_table
    from layoutexplore.metrics.segmentation import HEADINGS, MEASURES

    rows = []
    for line in lines:
        name = f"{line['folder']}: {line['building']}" if "building" in line else line["source"]
        values = [f"{100 * line[m]:.1f}" for m in MEASURES]
        rows.append([name, str(line["maps"]), str(line["buildings"]), *values])
    print_table([heading, "maps", "buildings", *HEADINGS.values()], rows)


def _print_summary(lines: Sequence[dict[str, Any]]) -> None:
    from layoutexplore.cli.progress import print_table
    from layoutexplore.metrics.segmentation import HEADINGS, MEASURES

    columns = "set", "method", "maps", "buildings", *HEADINGS.values(), "1-1, 95 %", "segments/rooms", "ms"
    rows = []
    for line in lines:
        values = [f"{100 * line[m]:.1f}±{100 * line[m + '_std']:.1f}" for m in MEASURES]
        interval = f"{100 * line['low']:.1f}-{100 * line['high']:.1f}" if line["buildings"] > 1 else "-"
        counts = f"{line['segments']:.1f}/{line['rooms']:.1f}"
        texts = [
            line["folder"],
            line["method"],
            str(line["maps"]),
            str(line["buildings"]),
            *values,
            interval,
            counts,
            f"{line['ms']:.0f}±{line['ms_std']:.0f}",
        ]
        rows.append(texts)
    print_table(columns, rows, keys=2)


def _print_spread(lines: Sequence[dict[str, Any]]) -> None:
    from layoutexplore.metrics.segmentation import HEADINGS

    for line in lines:
        values = ", ".join(f"{name} {100 * line[m]:.1f}" for m, name in HEADINGS.items())
        typer.echo(f"{line['folder']}, standard deviation of the mean over {line['seeds']} seeds: {values}")


def read_buildings(path: Path) -> dict[str, str]:
    """The building of each map, from a CSV with the columns map and building."""
    from layoutexplore.errors import ConfigError
    from layoutexplore.files import read_csv

    header, *lines = read_csv(path, error=ConfigError, what="table of buildings") or [[]]
    if not {"map", "building"} <= {*header} or any(len(line) != len(header) for line in lines):
        raise ConfigError(f"{path}: a CSV with the columns map and building is needed")
    of_map, building = header.index("map"), header.index("building")
    return {line[of_map]: line[building] for line in lines}


def _sources(given: Sequence[str] | None, cases: Sequence[Case]) -> dict[str, str]:
    from layoutexplore.errors import ConfigError

    sources = {}
    for text in given or ():
        folder, equals, source = text.partition("=")
        if not (folder and equals and source):
            raise ConfigError(f"--source {text}: FOLDER=SOURCE is needed, such as bormann_furnished=survey")
        sources[_folder(folder, f"--source {text}", cases)] = source
    return sources


def _folder(name: str, where: str, cases: Sequence[Case]) -> str:
    """The name of a folder that is given by it or by its path, if maps of it are given."""
    from layoutexplore.errors import ConfigError

    folders = {case.folder: case.image.parent.resolve() for case in cases}
    if name in folders:
        return name
    if by_path := [known for known, path in folders.items() if path == Path(name).resolve()]:
        return by_path[0]
    alike = sorted(known for known, path in folders.items() if path.name == name)
    if alike:
        raise ConfigError(f"{where}: {len(alike)} folders are called {name}: say which, {' or '.join(alike)}")
    raise ConfigError(f"{where}: no folder of that name is given; there are {', '.join(sorted(folders))}")


def weights_of(given: Sequence[str] | None, cases: Sequence[Case]) -> dict[str, float]:
    """The weight of each folder of `FOLDER=NUMBER`."""
    from layoutexplore.errors import ConfigError

    weights = {}
    for text in given or ():
        folder, _, number = text.rpartition("=")
        try:
            weight = float(number)
        except ValueError:
            raise ConfigError(f"--weight {text}: FOLDER=NUMBER is needed, such as cluttered=4") from None
        name = _folder(folder, f"--weight {text}", cases)
        if name in weights:
            raise ConfigError(f"--weight {text}: {name} has a weight already")
        weights[name] = weight
        if not 0 < weight < float("inf"):
            raise ConfigError(f"--weight {text}: a weight must be above 0")
    return weights
