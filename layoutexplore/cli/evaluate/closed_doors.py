"""`layoutexplore evaluate closed-doors` and `train-closed-doors`: rooms behind closed doors."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from layoutexplore.cli.evaluate.options import JsonFile, holding, write_numbers
from layoutexplore.cli.evaluate.partial_rooms import shown
from layoutexplore.files import check_places

if TYPE_CHECKING:
    from layoutexplore.evaluation.closed_doors import PairScore
    from layoutexplore.maps.closed_door_maps import Triple
    from layoutexplore.training.closed_doors import ClosedDoorSamples, Source

COLUMNS = ("before", "free_iou", "iou", "iqm", "iqm_low", "iqm_high", "precision", "recall")

NOTE = (
    "the trees that ship were trained on eight buildings with a published answer and on floor plans; "
    "scores on these are not held out: --folds 8 --plans FOLDER"
)

Plans = Annotated[
    list[str] | None,
    typer.Option(help="With --folds: floor plans to train on besides (name, file or folder)."),
]
Cache = Annotated[
    Path | None, typer.Option(help="With --folds: keeps what is learnt from; a stopped run goes on.")
]


def closed_doors(
    folder: Annotated[
        Path, typer.Argument(help="Folder with NAME_k_doors_IN.png, NAME_k_doors_OUT.png and NAME_GT.png.")
    ],
    out: Annotated[
        Path, typer.Option(help="Folder for NAME_k_doors_pred.png and the pictures of the best and worst.")
    ] = Path("closed-doors"),
    jobs: Annotated[int, typer.Option(min=1, help="Processes; with --folds one.")] = 1,
    resolution: Annotated[float, typer.Option(help="Metres a pixel.")] = 0.05,
    folds: Annotated[
        int,
        typer.Option(
            min=0,
            help="Train anew without each of so many groups of buildings, at most one each; 0: shipped.",
        ),
    ] = 0,
    plans: Plans = None,
    cache: Cache = None,
    report: Annotated[bool, typer.Option(help="Also write report.html with a picture of every map.")] = True,
    json_file: JsonFile = None,
) -> None:
    """Rooms behind closed doors: free-space IoU, and how what was never seen is predicted.

    IoU, precision and recall on what was never seen, beside a reference.
    """
    from layoutexplore.errors import ConfigError, require
    from layoutexplore.evaluation.closed_doors import cross_validate_closed_doors, evaluate, held_out_groups
    from layoutexplore.maps.closed_door_maps import find_triples

    for option, given in (("--plans", plans), ("--cache", cache)):
        if given and not folds:
            raise ConfigError(f"{option} is about training: it needs --folds")
    if report:
        require("jinja2", "bench")
    check_places(out, json_file)
    triples = find_triples(folder)
    with holding(out):
        if folds:
            groups = held_out_groups(triples, folds)
            learnt = _learn_from(folder, plans or (), cache)
            results = cross_validate_closed_doors(triples, groups, learnt, resolution=resolution, out=out)
            note = f"every building was held out, in {groups} groups"
        else:
            results = evaluate(triples, resolution=resolution, out=out, jobs=jobs)
            note = NOTE
        written = _tell(triples, results, note, out if report else None, json_file)
    typer.echo("written: " + ", ".join(str(path) for path in [out, *written]))


def _tell(
    triples: Sequence[Triple],
    results: Iterable[PairScore],
    note: str,
    report: Path | None,
    json_file: Path | None,
) -> list[Path]:
    """Print the scores as they come and their summary; write the numbers, and a report if it has a folder.

    Returns the files of the report.
    """
    from layoutexplore.evaluation.closed_doors import summarise_closed_doors
    from layoutexplore.processes import command_line
    from layoutexplore.report.studies.closed_doors import write_closed_doors_report

    scores = []
    for triple, score in zip(triples, results, strict=True):
        scores.append(score)
        typer.echo(f"{triple.name}: {_line(score)}")
    summary = summarise_closed_doors(scores)
    _print(summary)
    typer.echo(f"note: {note}")
    write_numbers(json_file, {"summary": summary, "maps": [asdict(score) for score in scores]})
    if report is None:
        return []
    return write_closed_doors_report(report, triples, scores, summary, command=command_line(), note=note)


def train_closed_doors(
    folder: Annotated[Path, typer.Argument(help="Folder with NAME_k_doors_IN.png and NAME_GT.png.")],
    out: Annotated[Path, typer.Option(help="Folder for doors.json and rooms.json.")],
    plans: Annotated[
        list[str] | None, typer.Option(help="Floor plans to shut doors in besides (name, file or folder).")
    ] = None,
    cache: Annotated[
        Path | None, typer.Option(help="Keeps what is learnt from; a stopped run goes on.")
    ] = None,
) -> None:
    """Train the trees that find closed doors and score the rooms behind them."""
    from layoutexplore.training.closed_doors import fit, save

    check_places(out, cache=cache)
    learnt = _learn_from(folder, plans or (), cache)
    buildings = len({source.building for source, _ in learnt})
    note = f"trained on {len(learnt)} maps of {buildings} buildings"
    save(fit(samples for _, samples in learnt), out, note)
    typer.echo(f"{note}\nwritten: {out}")


def _line(score: PairScore) -> str:
    theirs = f"  reference {score.reference.iou:.3f}" if score.reference else ""
    return f"never seen {score.hidden_m2:.0f} m2, IoU {score.ours.iou:.3f}{theirs}"


def _learn_from(
    folder: Path, plans: Sequence[str], cache: Path | None
) -> list[tuple[Source, ClosedDoorSamples]]:
    """The samples of all maps and plans."""
    from layoutexplore.cli.progress import ProgressLine, plain_console
    from layoutexplore.maps.library import find_plans
    from layoutexplore.training.closed_doors import collect_all, find_sources

    sources = find_sources(folder, find_plans(plans))
    with ProgressLine(plain_console(), "maps to learn from") as line:
        return list(
            collect_all(
                sources, cache, lambda done, total, name: line.advance(done, total, done / total, name)
            )
        )


def _print(summary: Sequence[dict[str, Any]]) -> None:
    from layoutexplore.cli.progress import print_table

    rows = [
        [line["group"], line["method"], str(line["maps"]), *(shown(line[column]) for column in COLUMNS)]
        for line in summary
    ]
    typer.echo("")
    print_table(["group", "method", "maps", *COLUMNS], rows, keys=2)
