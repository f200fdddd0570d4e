"""Comparing runs: pairs, plans, sensors, curves."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from layoutexplore.benchmark.analysis import (
    METRICS,
    POOLED,
    by_plan,
    cells_of_agents,
    compare,
    failed_runs,
    groups,
    headline_level,
    measured_levels,
    over_all_sensors,
    pooled_curves,
    ratios_by_plan,
    summarise_agents,
)
from layoutexplore.benchmark.rows import Row, knows_the_plan
from layoutexplore.errors import ConfigError


def row(plan: str, agent: str, d95: float, *, start: int = 0, sensor: str = "stage", **more: Any) -> Row:
    return Row(
        plan=plan,
        start=start,
        sensor=sensor,
        agent=agent,
        seed=0,
        d90=d95,
        d95=d95,
        d99=more.pop("d99", d95),
        reached95=True,
        distance=d95,
        **more,
    )


def test_comparisons_are_paired_by_cell() -> None:
    rows = [
        row("a", "nearest", 100),
        row("a", "tour", 50),
        row("b", "nearest", 10),
        row("b", "tour", 20),
        row("c", "tour", 7),
    ]
    found = {(c.agent, c.metric): c for c in compare(rows, "nearest")}
    tour = found["tour", "d95"]
    assert (tour.cells, tour.plans) == (2, 2)  # plan c has no baseline
    assert tour.ratio.estimate == pytest.approx(1.0)  # a half and a double cancel
    assert (tour.ratio.low, tour.ratio.high) == (pytest.approx(0.5), pytest.approx(2.0))
    assert tour.improvement.estimate == 0.5
    assert found["nearest", "d95"].ratio.estimate == 1.0


def test_plans_count_once_in_the_second_ratio() -> None:
    rows = [row("a", "nearest", 100, start=k) for k in range(3)] + [
        row("a", "tour", 50, start=k) for k in range(3)
    ]
    rows += [row("b", "nearest", 100), row("b", "tour", 100)]
    tour = next(c for c in compare(rows, "nearest") if (c.agent, c.metric) == ("tour", "d95"))
    assert tour.plan_ratio.estimate == pytest.approx(math.sqrt(0.5))
    assert tour.ratio.estimate < tour.plan_ratio.estimate


def test_floors_of_one_building_are_resampled_together() -> None:
    rows = [
        row(plan, agent, metres, building="tower")
        for plan, tour in (("a", 50), ("b", 200))
        for agent, metres in (("nearest", 100), ("tour", tour))
    ]
    alone = next(c for c in compare(rows, "nearest") if (c.agent, c.metric) == ("tour", "d95"))
    assert (alone.plans, alone.buildings) == (2, 1)
    assert math.isnan(alone.ratio.low)  # one building tells nothing of others
    rows += [row("c", "nearest", 100), row("c", "tour", 100)]
    found = next(c for c in compare(rows, "nearest") if (c.agent, c.metric) == ("tour", "d95"))
    assert (found.plans, found.buildings) == (3, 2)
    assert (found.plan_ratio.low, found.plan_ratio.high) == pytest.approx((1.0, 1.0))


def test_levels_that_were_not_measured_are_left_out() -> None:
    rows = [row("a", "nearest", 10, d99=math.nan), row("a", "tour", 10, d99=math.nan)]
    assert {c.metric for c in compare(rows, "nearest")} == {"d90", "d95"}


def test_a_level_that_some_runs_overshot_is_not_measured() -> None:
    rows = [row("a", "nearest", 10, d99=math.nan), row("b", "nearest", 10), row("b", "tour", 9)]
    assert measured_levels(rows) == ("d90", "d95") and headline_level(rows) == "d95"
    assert {c.metric for c in compare(rows, "nearest")} == {"d90", "d95"}
    low = [dataclasses.replace(each, d95=math.nan, d99=math.nan) for each in rows]
    assert headline_level(low) == "d90"
    assert headline_level([dataclasses.replace(each, d90=math.nan) for each in low]) == ""
    assert measured_levels([row("a", "tour", math.nan, error="Boom")]) == ()


def test_two_runs_of_an_agent_in_a_cell_are_refused() -> None:
    here = [row("a", agent, 10, config_hash="one") for agent in ("nearest", "tour")]
    noisy = [dataclasses.replace(each, d95=12.0, config_hash="two") for each in here]
    with pytest.raises(ConfigError, match=r"nearest has two runs on a, start 0, stage \(.* one and two\)"):
        compare([*here, *noisy], "nearest")
    failed = dataclasses.replace(here[1], error="Boom")
    assert len(compare([*here, failed], "nearest")) == 6  # a run that failed before it was made again
    renamed = [dataclasses.replace(each, agent=f"{each.agent}, noisy") for each in noisy]
    assert {c.agent for c in compare([*here, *renamed], "nearest")} == {
        *("nearest", "tour"),
        *("nearest, noisy", "tour, noisy"),
    }


def test_failed_runs_by_agent() -> None:
    rows = [row("a", "tour", 5), row("b", "tour", 5, error="Boom: 1"), row("a", "far", 5, error="Boom: 2")]
    assert [str(line) for line in failed_runs(rows)] == [
        "far: its only run failed with Boom: 2",
        "tour: 1 of 2 runs failed, first with Boom: 1",
    ]
    assert cells_of_agents(rows) == {"tour": {("a", 0, "stage")}, "far": set()}


def test_no_baseline_no_comparison() -> None:
    assert compare([row("a", "tour", 5)], "nearest") == []


def test_sensors_are_pooled_only_when_there_are_several() -> None:
    one = [row("a", "tour", 5), row("a", "nearest", 5, error="MapError: broken")]
    assert {name: len(part) for name, part in groups(one).items()} == {"stage": 1}
    both = [*one, row("a", "tour", 5, sensor="indoor")]
    assert list(groups(both)) == [POOLED, "indoor", "stage"]
    for rows, name in ((one, "stage"), (both, POOLED)):
        found = over_all_sensors(compare(rows, "tour"))
        assert {key: c.sensor for key, c in found.items()} == {("tour", m): name for m in METRICS}


def test_curves_are_in_units_of_the_baseline() -> None:
    rows = [row("a", "nearest", 100), row("a", "tour", 50)]
    curves = {"nearest": [[0, 0], [100, 1]], "tour": [[0, 0], [50, 1]]}
    pooled = {c.agent: c for c in pooled_curves(rows, "nearest", lambda r: np.array(curves[r.agent], float))}
    assert np.interp(0.5, pooled["tour"].x, pooled["tour"].mean) == pytest.approx(1.0)
    assert np.interp(0.5, pooled["nearest"].x, pooled["nearest"].mean) == pytest.approx(0.5)
    tour = next(
        s
        for s in summarise_agents(rows, "nearest", lambda r: np.array(curves[r.agent], float))
        if s.agent == "tour"
    )
    assert tour.auc_difference is not None and tour.auc_difference.estimate == pytest.approx(0.25)


def test_table_by_plan() -> None:
    rows = [row("a", "tour", 10), row("a", "tour", 20, start=1), row("b", "tour", 4)]
    assert by_plan(rows, "d95") == {("a", "stage"): {"tour": 15.0}, ("b", "stage"): {"tour": 4.0}}


def test_ratios_by_plan_are_of_the_starts_that_both_ran() -> None:
    """An agent that failed on the long starts does not look shorter for it."""
    rows = [row("a", "nearest", metres, start=k) for k, metres in enumerate((10, 100, 100))]
    rows += [row("a", "tour", 12), row("a", "tour", 1, start=1, error="Boom"), row("b", "tour", 4)]
    rows += [row("c", "nearest", 0), row("c", "tour", 0)]
    assert ratios_by_plan(rows, "d95", "nearest") == {
        ("a", "stage"): {"nearest": 1.0, "tour": pytest.approx(1.2)}
    }
    assert by_plan(rows, "d95")["a", "stage"] == {"nearest": 85.0, "tour": 12.0}


def test_who_knows_the_plan() -> None:
    assert knows_the_plan("clairvoyant")
    assert knows_the_plan("layout-tour:predictor=oracle")
    assert not knows_the_plan("nearest")
    assert not knows_the_plan("clairvoyant-of-tomorrow")
    assert knows_the_plan("plan-tour:predictor=prior:true") and knows_the_plan(
        "plan-tour:predictor=prior:rough"
    )
    for name in ("wrong", "empty", "other-floor", "office-01"):
        assert not knows_the_plan(f"plan-tour:predictor=prior:{name}")
