"""`layoutexplore evaluate foresight`: what knowing rooms before they are seen is worth to a robot."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from layoutexplore.cli.evaluate.options import FloorPlans, Sensors, Starts, Workers, asked_sensors
from layoutexplore.files import check_places

if TYPE_CHECKING:
    from layoutexplore.evaluation.foresight import ForesightScore

COLUMNS = (
    *("sensor", "predictor", "cells", "buildings", "d95", "d99", "reached", "ms"),
    *("d95_low", "d95_high", "d99_low", "d99_high"),
)
"""Those of foresight.csv."""


def foresight(
    plans: FloorPlans,
    out: Annotated[
        Path, typer.Option(help="Folder for the table and the runs; the same command goes on in it.")
    ],
    predictor: Annotated[
        list[str] | None,
        typer.Option("--predictor", "-p", help="Who foresees; oracle:horizon=0 to inf when none is named."),
    ] = None,
    sensor: Sensors = None,
    starts: Starts = 1,
    jobs: Workers = None,
) -> None:
    """Metres of plan-tour with foresight of 0, 1, 2, 3 and all doors, or of any predictor.

    They are compared with those of layout-tour in the same cells; a table with intervals over buildings.
    """
    from layoutexplore.benchmark.analysis import failed_runs
    from layoutexplore.benchmark.config import BenchmarkConfig
    from layoutexplore.cli.benchmark import run_shared
    from layoutexplore.evaluation.foresight import (
        HORIZONS,
        PLANNER,
        REFERENCE,
        explorer_with,
        foresight_table,
        score_foresight,
    )
    from layoutexplore.files import write_atomically, write_csv
    from layoutexplore.maps.library import find_plans

    check_places(out)
    predictors = list(dict.fromkeys(predictor or HORIZONS))
    config = BenchmarkConfig(
        plans=tuple(find_plans(plans)),
        starts=starts,
        sensors=asked_sensors(sensor),
        agents=tuple(dict.fromkeys((REFERENCE, *map(explorer_with, predictors)))),
        baseline=REFERENCE,
        explain=False,
    )
    rows = run_shared(config, out / "runs", jobs)
    scores = score_foresight(rows, predictors)
    write_csv(out / "foresight.csv", [_line(score) for score in scores], columns=COLUMNS)
    text = foresight_table(scores)
    if failed := failed_runs(rows):
        text += "\nFailed runs are in no figure above:\n\n" + "".join(f"- {line}\n" for line in failed)
    if not scores:
        text += f"\nNothing is compared: {REFERENCE} and {PLANNER} did not both end a run well in one cell.\n"
    write_atomically(out / "foresight.md", text)
    typer.echo(text + f"\nwritten: {out / 'foresight.md'} and {out / 'foresight.csv'}")
    if failed:
        raise typer.Exit(1)


def _line(score: ForesightScore) -> dict[str, Any]:
    """A line of the table, each interval as an estimate and its ends."""
    return vars(score) | score.d95.as_columns("d95") | score.d99.as_columns("d99")
