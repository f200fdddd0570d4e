"""`layoutexplore evaluate partial-rooms`: how well half-seen rooms and frontiers are predicted."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from layoutexplore.cli.evaluate.options import (
    FloorPlans,
    JsonFile,
    Sensors,
    asked_predictors,
    asked_sensors,
    holding,
    write_numbers,
)
from layoutexplore.files import check_places

if TYPE_CHECKING:
    from layoutexplore.evaluation.partial_rooms import Scores
    from layoutexplore.evaluation.partial_rooms_summary import PredictorSummary
    from layoutexplore.predictors.protocol import RoomPredictor

ROOM_COLUMNS = (
    "rooms",
    "hidden_iou",
    "hidden_low",
    "hidden_high",
    "hidden_mean",
    "iou",
    "log_area",
    "boundary_m",
    "spearman",
    "mae_m2",
)
FRONTIER_COLUMNS = (
    "frontiers",
    "mcc",
    "f1_closed",
    "f1_open",
    "leftover_accuracy",
    "leftover_mcc",
    "calibration_error",
)


NOTE = (
    "the predictor layout that ships has learnt from the KTH and school floors and from the plans of the "
    "split train, and half of its trees for frontiers from floors of MIT; "
    "scores on these are not held out: evaluate train-predictor --folds"
)


NOTHING = {
    "rooms": "no room is judged: on these plans none was half seen where an exploration was looked at",
    "frontiers": "no frontier is judged: these plans are seen whole before there is a decision to look at",
}
"""What is said instead of a table without lines."""


def partial_rooms(
    plans: FloorPlans,
    predictor: Annotated[
        list[str] | None, typer.Option("--predictor", "-p", help="Predictor; all when none is named.")
    ] = None,
    sensor: Sensors = None,
    starts: Annotated[int, typer.Option(min=1, max=10_000, help="Explorations per plan and sensor.")] = 1,
    snapshots: Annotated[
        Path | None, typer.Option(help="Folder that keeps the explorations, to ask again later.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for a page with tables, plots and pictures of rooms.")
    ] = None,
    json_file: JsonFile = None,
) -> None:
    """Half-seen rooms and frontiers: every predictor on the same snapshots.

    Hidden IoU, room IoU, areas; closed or open frontiers.
    """
    from layoutexplore.agents import make_agent
    from layoutexplore.benchmark.runner import MOST_RUNS
    from layoutexplore.errors import ConfigError, require
    from layoutexplore.evaluation.partial_rooms import score_predictors
    from layoutexplore.evaluation.partial_rooms_summary import summarise_partial_rooms
    from layoutexplore.maps.library import find_plans, load_plan
    from layoutexplore.predictors import predictor_names
    from layoutexplore.processes import command_line
    from layoutexplore.report.studies.partial_rooms import Gallery, write_partial_rooms_report
    from layoutexplore.training.explorations import protocol_explorations

    if out is not None:
        require("jinja2", "bench")
    check_places(out, json_file, snapshots=snapshots)
    sensors = asked_sensors(sensor)
    # `learned` is `layout` as long as no other layout method is named.
    predictors = asked_predictors(predictor or [name for name in predictor_names() if name != "learned"])
    sources = find_plans(plans)
    if (count := len(sources) * len(sensors) * starts) > MOST_RUNS:
        raise ConfigError(f"{count} explorations are more than {MOST_RUNS}: give fewer plans or starts")
    taken = (
        snapshot
        for source in sources
        for exploration in protocol_explorations(
            load_plan(source), make_agent, snapshots, sensors=sensors, starts=starts
        )
        for snapshot in exploration
    )
    names = list(predictors)
    gallery = Gallery("layout" if "layout" in names else names[0])
    with holding(out):
        scores = score_predictors(taken, predictors, gallery if out else None)
        summary = summarise_partial_rooms(scores)
        print_summary(summary)
        if "layout" in names:
            typer.echo(f"note: {NOTE}")
        data = {
            "summary": {name: asdict(part) for name, part in summary.items()},
            "rooms": [asdict(r) for r in scores.rooms],
            "ms": scores.milliseconds,
        }
        write_numbers(json_file, data | {"frontiers": [asdict(f) for f in scores.frontiers]}, indent=None)
        if out is not None:
            written = write_partial_rooms_report(out, scores, summary, gallery, command=command_line())
            typer.echo(f"written: {written[0]} and {len(written) - 1} files beside it")


def judge_explorations(
    sources: Sequence[str],
    predictors: Mapping[str, RoomPredictor],
    *,
    sensors: Sequence[str],
    starts: int,
    store: Path,
    noise: str = "",
) -> Scores:
    """Scores on snapshots of explorations, under a progress line.

    Args:
        sources: Floor plans.
        predictors: Who is asked, by name.
        sensors: Names of sensors.
        starts: Explorations by each sensor.
        store: Folder that keeps them.
        noise: Level of noise; none without.
    """
    from layoutexplore.agents import make_agent
    from layoutexplore.cli.progress import ProgressLine, plain_console
    from layoutexplore.evaluation.partial_rooms import Scores, score_predictors
    from layoutexplore.maps.library import cached_plan
    from layoutexplore.training.explorations import protocol_explorations

    scores = Scores([], [], {name: [] for name in predictors})
    done, total = 0, len(sources) * len(sensors) * starts
    level = f", noise {noise}" if noise else ""
    with ProgressLine(plain_console(), f"explorations judged{level}") as line:
        for plan in map(cached_plan, sources):
            for part in protocol_explorations(
                plan, make_agent, store, sensors=sensors, starts=starts, noise=noise
            ):
                scores.extend(score_predictors(part, predictors))
                done += 1
                line.advance(done, total, done / total, plan.name)
    return scores


def print_summary(summary: Mapping[str, PredictorSummary]) -> None:
    """Tables of rooms and frontiers, and what a decision costs; a sentence where nothing is judged."""
    for what, stratum, columns in (
        ("rooms", "explored", ROOM_COLUMNS),
        ("frontiers", "coverage", FRONTIER_COLUMNS),
    ):
        if any(getattr(part, what) for part in summary.values()):
            _print(what, stratum, summary, columns)
        else:
            typer.echo(NOTHING[what])
    times = [f"{name} {part.ms:.1f}" for name, part in summary.items() if not math.isnan(part.ms)]
    if times:
        typer.echo("median ms a decision: " + ", ".join(times))


def shown(value: float) -> str:
    """A number; a dash for what so few rooms do not tell."""
    return str(value) if isinstance(value, int) else "-" if math.isnan(value) else f"{value:.3f}"


def _print(what: str, stratum: str, summary: Mapping[str, PredictorSummary], columns: Sequence[str]) -> None:
    """One line a stratum and predictor, the predictors of a stratum below each other."""
    from layoutexplore.cli.progress import print_table

    lines = [
        (getattr(line, stratum), name, line) for name, part in summary.items() for line in getattr(part, what)
    ]
    order = list(dict.fromkeys(level for level, _, _ in lines))
    rows = [
        [level, name, *(shown(getattr(line, column)) for column in columns)]
        for level, name, line in sorted(lines, key=lambda entry: order.index(entry[0]))
    ]
    print_table([stratum, "predictor", *columns], rows, keys=2)
    typer.echo("")
