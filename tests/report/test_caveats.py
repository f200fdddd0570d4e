"""What a report says that its results do not tell: cells that differ, runs that are missing, the budget."""

from __future__ import annotations

import dataclasses
import itertools

from layoutexplore.benchmark.config import BenchmarkConfig, settings
from layoutexplore.benchmark.rows import Row
from layoutexplore.report.caveats import caveats
from layoutexplore.simulation.config import SimulationConfig

CELLS = list(itertools.product(("a", "b", "c"), range(4)))


def runs(agent: str, count: int, *, failed: int = 0) -> list[Row]:
    """Runs of an agent in the first cells; some more failed."""
    return [
        Row(plan=plan, start=start, sensor="stage", seed=0, agent=agent, error="Boom" if k >= count else "")
        for k, (plan, start) in enumerate(CELLS[: count + failed])
    ]


def said(rows: list[Row], simulation: SimulationConfig | None = None, planned: int = 0) -> str:
    made = settings(BenchmarkConfig(simulation=simulation or SimulationConfig()))
    return " ".join(caveats(rows, made, baseline="nearest", planned=planned))


def test_agents_that_ran_other_cells_are_named() -> None:
    rows = [*runs("nearest", 12), *runs("tour", 12), *runs("own.py:Small", 8, failed=4)]
    assert "own.py:Small ran 8 of the 12 cells: its ratios are of those." in said(rows)
    rows += [*runs("far", 8), *runs("bad", 0, failed=12)]
    assert "far, own.py:Small ran 8 of the 12 cells: their ratios are of those." in said(rows)
    assert "bad failed in every cell and is in no table." in said(rows)
    rows = [*runs("nearest", 6), *runs("tour", 12)]
    assert "nearest ran 6 of the 12 cells: all ratios are of those." in said(rows)
    assert "cells" not in said([*runs("nearest", 6, failed=2), *runs("tour", 6)])


def test_runs_that_are_missing_are_counted() -> None:
    rows = [*runs("nearest", 12), *runs("tour", 8, failed=4)]
    assert "24 of 36 runs are there" in said(rows, planned=36)
    assert "runs are there" not in said(rows, planned=24) + said(rows)


def test_the_budget_is_told_whoever_set_it() -> None:
    rows = runs("nearest", 2)
    assert "A run is ended after 100 m + 1 m per m² of target area; a level not reached is charged" in said(
        rows
    )
    limited = said(rows, SimulationConfig(max_distance=40.0))
    assert "A run is ended after 40 m; a level not reached is charged that many metres." in limited


def test_caveats_follow_the_settings() -> None:
    rows = runs("nearest", 12)
    made = settings(BenchmarkConfig())
    made["simulation"] |= {
        "odometry_noise": {"translation": 0.1, "rotation": 0.0},
        "turn_cost": 1.0,
        "coverage_goal": 0.95,
    }
    del made["simulation"]["max_distance"]
    said = " ".join(caveats(rows[:1], made))
    assert "no intervals at all" in said and "Odometry" not in said and "Turning" not in said and "95" in said
    assert "best of" not in said and "has learnt" not in said


def test_what_flatters_is_said() -> None:
    rows = [dataclasses.replace(row, agent="layout-tour", plan="office-01") for row in runs("nearest", 3)]
    made = settings(BenchmarkConfig())
    assert (
        "has learnt from the KTH and school floors and from the plans of the split train (office-01 here)"
        in " ".join(caveats(rows, made))
    )
    assert "half of its trees for frontiers from floors of MIT" in " ".join(caveats(rows, made))
    rows = [dataclasses.replace(row, agent="layout-tour:predictor=oracle") for row in rows]
    assert "has learnt" not in " ".join(caveats(rows, made))
    assert "the best of 3 on these very runs" in " ".join(caveats(rows, made, candidates=3))


def test_buildings_whose_runs_all_failed_give_no_interval() -> None:
    rows = [
        dataclasses.replace(row, plan=f"{row.plan}-{k}", error="Boom" if k else "")
        for k in range(12)
        for row in runs("nearest", 1)
    ]
    assert "there is only one: there are no intervals at all" in said(rows)
    assert "Intervals resample" not in said([dataclasses.replace(row, error="Boom") for row in rows])
