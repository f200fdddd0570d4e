"""Stopping early: what is saved and lost, by rules that ran and by rules that are tried on finished runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.counterfactual import LOG, Counterfactual
from layoutexplore.benchmark.early_stop import early_stops, stop_at, tried_stops, try_rule
from layoutexplore.benchmark.rows import Row
from layoutexplore.benchmark.runner import run_benchmark
from layoutexplore.maps.geojson import save_plan
from layoutexplore.simulation.config import SimulationConfig
from tests.plans import offices


def row(
    agent: str, metres: float, coverage: float, *, plan: str = "a", stop: str = "coverage", **more: Any
) -> Row:
    reached = coverage >= 0.99
    return Row(
        plan=plan, start=0, sensor="stage", agent=agent, seed=0, distance=metres, coverage=coverage,
        d99=metres if reached else 500.0, reached99=reached, stop_reason=stop, **more,
    )  # fmt: skip


CURVES = {"nearest": np.array([[0.0, 0.0], [50.0, 0.9], [100.0, 0.99]])}


def test_pairs_of_saved_and_lost() -> None:
    rows = [
        row("nearest", 100, 0.99), row("nearest", 100, 0.99, plan="b"),
        row("early", 70, 0.96, stop="agent"), row("early", 80, 0.99, plan="b"),
    ]  # fmt: skip
    (stop,) = early_stops(rows, "nearest", lambda r: CURVES[r.agent])
    assert stop.agent == "early"
    assert stop.saved.estimate == pytest.approx(0.25)
    assert stop.lost.estimate == pytest.approx(0.015)
    assert stop.worst == pytest.approx(0.03) and stop.too_early == stop.stopped == 0.5
    assert stop.runs[0].baseline_saved == pytest.approx(1 - (50 + 50 * 6 / 9) / 100)
    assert stop.runs[1].baseline_saved == pytest.approx(0.0) and stop.runs[1].lost == 0.0


def test_nothing_to_say_without_a_stop_or_a_finished_baseline() -> None:
    assert (
        early_stops(
            [row("nearest", 100, 0.99), row("tour", 90, 0.99)], "nearest", lambda r: CURVES["nearest"]
        )
        == []
    )
    halted = [row("nearest", 100, 0.7, stop="budget"), row("early", 10, 0.5, stop="agent")]
    assert early_stops(halted, "nearest", lambda r: CURVES["nearest"]) == []


def test_a_stop_that_never_comes_is_told_too() -> None:
    rows = [row("nearest", 100, 0.99), row("layout-tour:stop_area=1", 80, 0.99), row("layout-tour", 80, 0.99)]
    (stop,) = early_stops(rows, "nearest", lambda r: CURVES["nearest"])
    assert stop.agent == "layout-tour:stop_area=1" and stop.saved.estimate == pytest.approx(0.2)
    assert stop.stopped == stop.lost.estimate == 0.0


def test_more_than_the_goal_is_not_lost_nor_saved_twice() -> None:
    stop = stop_at("a", 100.0, 1.0, 100.0, CURVES["nearest"])
    assert stop.saved == stop.lost == 0.0 and stop.baseline_saved == pytest.approx(0.0) and not stop.early


def test_a_tried_rule_is_what_the_agent_would_have_done(tmp_path: Path) -> None:
    save_plan(offices(), tmp_path / "offices.geojson")
    agents = ("nearest", "layout-nearest:predictor=oracle", "layout-nearest:stop_area=8,predictor=oracle")
    simulation = SimulationConfig(coverage_goal=1.0)
    config = BenchmarkConfig(
        plans=(str(tmp_path / "offices.geojson"),), starts=2, agents=agents, simulation=simulation
    )
    outcome = run_benchmark(config, tmp_path / "out")
    curves = lambda row: outcome.folder.episode(row)[0]  # noqa: E731
    found = {stop.agent: stop for stop in early_stops(outcome.rows, "nearest", curves)}
    (tried,) = tried_stops(outcome.rows, "nearest", agents[1], curves, outcome.folder.counterfactual, [8.0])
    assert not tried_stops(outcome.rows, "nearest", "tour", curves, outcome.folder.counterfactual)
    told = found[agents[2]]
    assert tried.tried and not told.tried and any(row.stop_reason == "agent" for row in outcome.rows)
    for a, b in zip(tried.runs, told.runs, strict=True):
        assert (a.building, a.saved, a.lost) == (
            b.building,
            pytest.approx(b.saved, abs=1e-4),
            pytest.approx(b.lost, abs=1e-4),
        )


def test_a_rule_is_tried_on_runs_that_went_on() -> None:
    log = np.zeros((4, len(LOG)), np.float32)
    log[:, LOG.index("distance")], log[:, LOG.index("coverage")] = [0, 30, 60, 90], [0.2, 0.8, 0.97, 0.98]
    log[:, LOG.index("total_left")] = [90, 9, 0.5, 0.1]
    runs = [(row("tour", 95, 0.99), Counterfactual(log, ()), row("nearest", 100, 0.99))]
    stop = try_rule(lambda told: told.column("total_left") < 1, runs, lambda r: CURVES[r.agent])
    assert stop.saved.estimate == pytest.approx(0.4) and stop.lost.estimate == pytest.approx(0.02, abs=1e-6)
    never = try_rule(lambda told: told.column("total_left") < 0, runs, lambda r: CURVES[r.agent])
    assert never.saved.estimate == pytest.approx(0.05) and never.lost.estimate == 0.0
