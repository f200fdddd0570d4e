"""Scores of exploration runs, against hand-computed cases."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from layoutexplore.errors import ConfigError
from layoutexplore.metrics.exploration import (
    auc_horizon,
    coverage_at,
    distance_to_coverage,
    mean_coverage,
    revisit_share,
    rooms_finished,
    score_curve,
)


def test_levels_are_interpolated_between_scans() -> None:
    scores = score_curve([(0, 0.2), (10, 0.8), (20, 0.9), (25, 0.97)], budget=300, target_area=100)
    assert scores.d90 == pytest.approx(20)
    assert scores.d95 == pytest.approx(20 + 5 * 5 / 7)
    assert (scores.d99, scores.reached90, scores.reached95, scores.reached99) == (300, True, True, False)


def test_a_level_seen_from_the_start_costs_nothing() -> None:
    assert distance_to_coverage([0, 5], [0.95, 1.0], 0.9, budget=9) == (0.0, True)


def test_a_level_above_the_goal_was_not_measured() -> None:
    scores = score_curve([(0, 0.2), (10, 0.96)], budget=300, target_area=100, goal=0.95)
    assert math.isnan(scores.d99)
    assert scores.reached95 and not scores.reached99


@pytest.mark.parametrize(("goal", "measured"), [(0.94, 1), (0.9, 1), (0.95, 2), (0.5, 0), (1.0, 3)])
def test_a_last_scan_that_sees_beyond_the_goal_measures_nothing(goal: float, measured: int) -> None:
    """Else the levels above the goal would come from the lucky runs alone."""
    scores = score_curve([(0, 0.2), (10, 1.0)], budget=300, target_area=100, goal=goal)
    metres = [scores.d90, scores.d95, scores.d99]
    reached = [scores.reached90, scores.reached95, scores.reached99]
    assert [not math.isnan(value) for value in metres] == reached == [k < measured for k in range(3)]


curves = st.lists(st.tuples(st.floats(0, 5), st.floats(0, 1)), min_size=1, max_size=30)


@given(curves, st.floats(0.01, 0.99), st.floats(0.5, 40))
def test_against_a_fine_sampling(steps: list[tuple[float, float]], level: float, horizon: float) -> None:
    array = np.array(steps)
    distance = np.cumsum(array[:, 0]) - array[0, 0]
    coverage = np.cumsum(array[:, 1]) / max(array[:, 1].sum(), 1.0)
    metres, reached = distance_to_coverage(distance, coverage, level, budget=1000)
    assert reached == (coverage[-1] >= level)
    if not reached:
        assert metres == 1000
    else:
        assert coverage_at(distance, coverage, metres + 1e-6) >= level - 1e-9
        if metres > 1e-6:
            assert coverage_at(distance, coverage, metres - 1e-6) <= level + 1e-9
    fine = np.linspace(0, horizon, 20001)
    assert mean_coverage(distance, coverage, horizon) == pytest.approx(
        coverage_at(distance, coverage, fine).mean(), abs=2e-3
    )


def test_a_mark_costs_the_budget_at_most() -> None:
    turned = [0.0, 9.0, 11.0], [0.5, 0.9, 1.0]
    assert distance_to_coverage(*turned, 0.99, budget=10.0) == (10.0, True)
    assert distance_to_coverage([0.0, 11.0, 11.0], [0.5, 0.9, 1.0], 1.0, budget=10.0) == (10.0, True)
    assert distance_to_coverage(*turned, 0.92, budget=10.0)[0] == pytest.approx(9.4)


def test_mean_coverage_by_hand() -> None:
    assert mean_coverage([0, 4], [0.5, 1.0], 4) == pytest.approx(0.75)
    assert mean_coverage([0, 4], [0.5, 1.0], 2) == pytest.approx(0.625)
    assert mean_coverage([0], [0.3], 7) == pytest.approx(0.3)
    assert mean_coverage([0, 1, 1], [0.0, 0.0, 1.0], 1) == 0.0, "what is seen while standing at the horizon"
    assert auc_horizon(400.0) == pytest.approx(100.0)


@pytest.mark.parametrize(
    ("distance", "coverage"), [([], []), ([0, 1], [0.5]), ([1, 0], [0.1, 0.2]), ([0, 1], [0.5, 0.4])]
)
def test_broken_curves(distance: list[float], coverage: list[float]) -> None:
    with pytest.raises(ConfigError):
        distance_to_coverage(distance, coverage, 0.5, budget=1)


def test_broken_arguments() -> None:
    for horizon in (0, math.inf, math.nan):
        with pytest.raises(ConfigError, match="horizon"):
            mean_coverage([0, 1], [0, 1], horizon)
    with pytest.raises(ConfigError, match="rows of"):
        score_curve([1.0, 2.0], budget=1, target_area=1)


def test_revisits_of_a_walk_there_and_back() -> None:
    there = np.column_stack([np.arange(0.05, 20.05, 0.1), np.full(200, 0.25)])
    assert revisit_share(there) == 0.0
    assert revisit_share(np.concatenate([there, there[::-1]])) == pytest.approx(0.5, abs=0.05)
    assert revisit_share(there[:1]) == 0.0


def test_walking_along_a_border_is_no_revisit() -> None:
    x = np.arange(0.0, 10.0, 0.1)
    y = 0.5 + 0.01 * (-1.0) ** np.arange(len(x))
    assert revisit_share(np.column_stack([x, y])) == 0.0


def test_rooms_finished_by_hand() -> None:
    rooms = np.repeat(np.array([[0, 1, 2, 3]], np.int32), 20, axis=0)
    target = rooms != 3
    seen = np.ones_like(target)
    assert rooms_finished(rooms, target, seen) == (2, 2)
    seen[0, 1] = False  # 19 of 20 cells of room 1: just finished
    seen[:2, 2] = False
    assert rooms_finished(rooms, target, seen) == (1, 2)
    assert rooms_finished(np.zeros_like(rooms), target, seen) == (0, 0)
