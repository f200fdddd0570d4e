"""`layoutexplore evaluate robustness`: what noise costs strategies and predictors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from layoutexplore.cli.evaluate.options import (
    FloorPlans,
    PageFolder,
    Sensors,
    Starts,
    Workers,
    asked_predictors,
    asked_sensors,
)
from layoutexplore.cli.evaluate.partial_rooms import judge_explorations
from layoutexplore.files import check_places

if TYPE_CHECKING:
    from layoutexplore.benchmark.analysis import FailedRuns
    from layoutexplore.benchmark.rows import Row
    from layoutexplore.evaluation.partial_rooms_summary import PredictorSummary
    from layoutexplore.evaluation.robustness import AgentUnderNoise
    from layoutexplore.predictors.protocol import RoomPredictor

AGENTS = ("nearest", "latency-tour", "layout-tour")
"""Who explores when nobody is named."""


def robustness(
    plans: FloorPlans,
    out: PageFolder,
    agents: Annotated[
        list[str] | None,
        typer.Option(help="Agent; nearest, latency-tour and layout-tour without. Repeatable."),
    ] = None,
    predictor: Annotated[
        list[str] | None, typer.Option("--predictor", "-p", help="Predictor; layout when none is named.")
    ] = None,
    sensor: Sensors = None,
    level: Annotated[
        list[str] | None,
        typer.Option("--level", "-l", help="Level of noise: low, middle, high; all without. Repeatable."),
    ] = None,
    agents_only: Annotated[bool, typer.Option("--agents-only", help="Leave the predictors out.")] = False,
    starts: Starts = 1,
    jobs: Workers = None,
) -> None:
    """Strategies and predictors at each level of noise: metres, who still sees 99 %, how right rooms are."""
    from layoutexplore.benchmark.analysis import failed_runs
    from layoutexplore.errors import require
    from layoutexplore.evaluation.robustness import agents_under_noise, chosen_levels, predictors_under_noise
    from layoutexplore.maps.library import find_plans
    from layoutexplore.processes import command_line
    from layoutexplore.report.studies.robustness import write_robustness_report

    require("jinja2", "bench")
    check_places(out)
    sources, names = find_plans(plans), tuple(dict.fromkeys(agents or AGENTS))
    sensors = asked_sensors(sensor)
    levels, named = chosen_levels(level), [] if agents_only else predictor or ["layout"]
    asked = asked_predictors(named)
    rows = {each: _explore(each, sources, names, sensors, starts, out, jobs) for each in levels}
    summaries = {each: _judge(each, sources, asked, sensors, starts, out) for each in levels if asked}
    found = agents_under_noise(rows)
    facts = {
        "command": command_line(),
        "plans": len(sources),
        "starts": starts,
        "sensors": sensors,
        "levels": levels,
    }
    failed = {each: failed_runs(part) for each, part in rows.items()}
    judged = predictors_under_noise(summaries)
    written = write_robustness_report(out, found, judged, facts=facts, failed=failed)
    _print(found, failed)
    typer.echo(f"written: {written[0]} and {len(written) - 1} files beside it")
    if any(failed.values()):
        raise typer.Exit(1)


def _explore(
    level: str,
    sources: Sequence[str],
    agents: Sequence[str],
    sensors: Sequence[str],
    starts: int,
    out: Path,
    jobs: int | None,
) -> list[Row]:
    """The runs at a level of noise."""
    from layoutexplore.benchmark.config import BenchmarkConfig
    from layoutexplore.cli.benchmark import run_shared
    from layoutexplore.evaluation.robustness import NOISELESS
    from layoutexplore.simulation.config import SimulationConfig

    config = BenchmarkConfig(
        plans=tuple(sources),
        starts=starts,
        sensors=tuple(sensors),
        agents=tuple(agents),
        baseline=agents[0],
        explain=False,
        simulation=SimulationConfig(noise="" if level == NOISELESS else level),
    )
    return run_shared(config, out / f"runs-{level}", jobs)


def _judge(
    level: str,
    sources: Sequence[str],
    predictors: Mapping[str, RoomPredictor],
    sensors: Sequence[str],
    starts: int,
    out: Path,
) -> dict[str, PredictorSummary]:
    """How right the predictors are on snapshots at a level of noise."""
    from layoutexplore.evaluation.partial_rooms_summary import summarise_partial_rooms
    from layoutexplore.evaluation.robustness import NOISELESS

    noise, store = "" if level == NOISELESS else level, out / "snapshots"
    return summarise_partial_rooms(
        judge_explorations(sources, predictors, sensors=sensors, starts=starts, store=store, noise=noise)
    )


def _print(found: Sequence[AgentUnderNoise], failed: Mapping[str, Sequence[FailedRuns]]) -> None:
    from layoutexplore.cli.progress import print_table

    rows = [
        [
            line.agent,
            line.level,
            str(line.runs),
            f"{line.reached:.1%}",
            *("-" if math.isnan(ratio.estimate) else f"{ratio:.2f}" for ratio in (line.d95, line.d99)),
        ]
        for line in found
    ]
    if rows:
        print_table(["strategy", "noise", "runs", "saw 99 %", "to 95 %", "to 99 %"], rows, keys=2)
    else:
        typer.echo("no run ended well: agents.csv has no line")
    for level, lines in failed.items():
        for one in lines:
            typer.echo(f"failed: level {level}, {one}")
