"""`layoutexplore evaluate in-the-loop`: what predictors of rooms are worth to a robot that explores."""

from __future__ import annotations

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
    from layoutexplore.evaluation.in_the_loop import LoopScore
    from layoutexplore.maps.floorplan import FloorPlan
    from layoutexplore.predictors.protocol import RoomPredictor
    from layoutexplore.report.studies.in_the_loop import BelievedRooms

PREDICTORS = (
    "none",
    "reconstruct:rose2",
    "reconstruct:ias15",
    "reconstruct:default",
    "reconstruct:morphological",
    "layout",
    "oracle",
)
"""Who is asked when no predictor is named."""

SHOWN = (0.25, 0.5, 0.75)
"""Coverages at which one exploration is drawn."""


def in_the_loop(
    plans: FloorPlans,
    out: PageFolder,
    predictor: Annotated[
        list[str] | None,
        typer.Option("--predictor", "-p", help="Predictor; a choice of all kinds when none is named."),
    ] = None,
    sensor: Sensors = None,
    starts: Starts = 2,
    jobs: Workers = None,
) -> None:
    """Predictors on snapshots, and the metres of layout-tour with each.

    A table, and pictures of what they believed.
    """
    from layoutexplore.benchmark.analysis import failed_runs
    from layoutexplore.benchmark.config import BenchmarkConfig
    from layoutexplore.cli.benchmark import run_shared
    from layoutexplore.errors import require
    from layoutexplore.evaluation.in_the_loop import BASELINE, driver_of, score_in_the_loop
    from layoutexplore.evaluation.partial_rooms_summary import summarise_partial_rooms
    from layoutexplore.maps.library import cached_plan, find_plans
    from layoutexplore.processes import command_line
    from layoutexplore.report.studies.in_the_loop import write_in_the_loop_report

    require("jinja2", "bench")
    check_places(out)
    sensors = asked_sensors(sensor)
    predictors = asked_predictors(predictor or PREDICTORS)
    sources = find_plans(plans)
    config = BenchmarkConfig(
        plans=tuple(sources),
        starts=starts,
        sensors=sensors,
        agents=(BASELINE, *map(driver_of, predictors)),
        explain=False,
    )
    rows = run_shared(config, out / "runs", jobs)
    store, loaded = out / "snapshots", [cached_plan(source) for source in sources]
    pictures = _believed(loaded[0], sensors[0], predictors, store)
    scores = judge_explorations(sources, predictors, sensors=sensors, starts=starts, store=store)
    found = score_in_the_loop(summarise_partial_rooms(scores), rows)
    facts = {
        "command": command_line(),
        "plans": len(sources),
        "buildings": len({plan.building for plan in loaded}),
        "starts": starts,
        "sensors": sensors,
        "plan": loaded[0].name,
    }
    failed = failed_runs(rows)
    written = write_in_the_loop_report(out, found, pictures, facts=facts, failed=failed)
    _print(found)
    typer.echo(f"written: {written[0]} and {len(written) - 1} files beside it")
    if failed:
        raise typer.Exit(1)


def _believed(
    plan: FloorPlan, sensor: str, predictors: Mapping[str, RoomPredictor], store: Path
) -> list[BelievedRooms]:
    """Pictures of what predictors believe in one exploration."""
    from layoutexplore.agents import make_agent
    from layoutexplore.evaluation.partial_rooms import asking
    from layoutexplore.report.studies.in_the_loop import BelievedRooms, draw_believed_rooms
    from layoutexplore.training.explorations import PROTOCOL_AGENT
    from layoutexplore.training.snapshots import explore_plan

    agent = make_agent(PROTOCOL_AGENT)
    found = []
    for snapshot in explore_plan(plan, agent, sensor=sensor, coverages=SHOWN, store=store):
        for name, predictor in predictors.items():
            with asking(predictor, name, snapshot):
                image = draw_believed_rooms(snapshot, predictor.rooms(snapshot.decision))
            found.append(BelievedRooms(name, snapshot.coverage, image))
    return found


def _print(scores: Sequence[LoopScore]) -> None:
    from layoutexplore.cli.progress import print_table
    from layoutexplore.report.templates import number, percent

    rows = [
        [
            s.predictor,
            number(s.mcc),
            number(s.hidden_iou.estimate),
            percent(s.leftover, 1),
            number(s.ms, 1),
            *(f"{ways:.2f}" if ways else "-" for ways in (s.d95, s.d99)),
        ]
        for s in scores
    ]
    print_table(["predictor", "MCC", "hidden IoU", "leftover", "ms", "d95", "d99"], rows)
