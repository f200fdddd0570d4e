"""Which frontiers a tour visits, their places in it and their detours, against slow obvious versions."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError
from layoutexplore.frontiers.table import Frontier, FrontierTable
from layoutexplore.frontiers.tour_features import (
    LAYOUT_TOUR_SIZE,
    TourConfig,
    ready_frontiers,
    sizeable_frontiers,
    tour_features,
    tour_weights,
)
from layoutexplore.grids.grid import Cell
from layoutexplore.planning.latency_tours import latency_tour
from layoutexplore.planning.tours import tour_length


def frontier(x: float, size: float = 2.0, closed: bool | None = None, area: float | None = None) -> Frontier:
    return Frontier(
        cells=np.zeros((1, 2), np.int32),
        size=size,
        centroid=(x, 0.0),
        viewpoint=Cell(0, 0),
        path_length=abs(x),
        straight_distance=abs(x),
        visible_area=1.0,
        is_closed=closed,
        expected_area=area,
    )


def decision(frontiers: list[Frontier], points: NDArray[np.float64]) -> Any:
    """A stand-in whose robot and frontiers lie at points float64 (n + 1, 2)."""
    distances = np.linalg.norm(points[:, None] - points[None], axis=2).astype(np.float32)

    def path_lengths(chosen: Any) -> NDArray[np.float32]:
        places = [0, *(int(k) + 1 for k in chosen)]
        return distances[np.ix_(places, places)]

    def path_lengths_from(index: int, chosen: Any) -> NDArray[np.float32]:
        return distances[index + 1, np.asarray(chosen) + 1]

    placed = tuple(replace(f, path_length=float(distances[0, k + 1])) for k, f in enumerate(frontiers))
    table = FrontierTable.of(placed)
    return SimpleNamespace(
        path_lengths=path_lengths, path_lengths_from=path_lengths_from, frontiers=placed, table=table
    )


def on_a_line(*frontiers: Frontier) -> Any:
    where = np.array([0.0, *(f.centroid[0] for f in frontiers)])
    return decision(list(frontiers), np.stack([where, np.zeros(len(where))], axis=1))


def test_the_detour_is_the_cost_of_going_there_first() -> None:
    """Robot at 0, frontiers at 1, 3 and -4: tours 1, 3, -4 and 3, 1, -4 take 10 m; -4, 1, 3 takes 11."""
    features = tour_features(on_a_line(frontier(1.0), frontier(3.0), frontier(-4.0)))
    assert features.detour.tolist() == [0.0, 0.0, 1.0]
    assert features.rank == pytest.approx([1.0, 1 / 2, 1 / 3])


def test_what_waits_has_no_place_in_the_tour_and_costs_what_inserting_it_first_adds() -> None:
    waits, leads_on, rich = (
        frontier(-1.0, closed=True, area=0.5),
        frontier(2.0, closed=False),
        frontier(5.0, closed=True, area=2),
    )
    features = tour_features(on_a_line(waits, leads_on, rich))
    assert features.rank.tolist() == [0.0, 1.0, 0.5]
    assert features.detour.tolist() == [2.0, 0.0, 3.0], "-1, 2, 5 takes 7 m and 5, 2 takes 8 m instead of 5 m"


def test_who_is_ready() -> None:
    small, waits = frontier(1.0, size=0.5), frontier(2.0, closed=True, area=0.5)
    leads_on, unjudged = frontier(3.0, closed=False, area=0.1), frontier(4.0)
    everything = on_a_line(small, waits, leads_on, unjudged)
    assert sizeable_frontiers(everything).tolist() == [1, 2, 3]
    assert ready_frontiers(everything).tolist() == [2, 3]
    assert ready_frontiers(everything, min_size=0.4).tolist() == [0, 2, 3]
    assert ready_frontiers(on_a_line(small, waits)).tolist() == [1], "when all would wait, none does"
    assert ready_frontiers(on_a_line(small, frontier(2.0, size=0.5, closed=True, area=0.5))).tolist() == [0]
    assert ready_frontiers(on_a_line(waits, frontier(4.0, closed=True, area=3.0)), area=4.0).tolist() == [
        0,
        1,
    ]


def test_what_may_be_judged_wrong_does_not_wait() -> None:
    sure, unsure, untold = (
        replace(frontier(x, closed=True, area=0.5), visible_area=50.0, confidence=confidence)
        for x, confidence in ((1.0, 0.99), (2.0, 0.9), (3.0, None))
    )
    several = on_a_line(sure, unsure, untold, frontier(4.0))
    assert ready_frontiers(several).tolist() == [3]
    assert ready_frontiers(several, doubted=3.0).tolist() == [1, 3], "0.9 of 0.5 m2 and a tenth of 30 m2"
    assert ready_frontiers(several, doubted=3.5).tolist() == [3]
    assert ready_frontiers(several, doubted=0.79).tolist() == [0, 1, 3], "0.99 of 0.5 m2, 0.01 of 30 m2"


def test_a_decision_without_frontiers_has_no_features() -> None:
    features = tour_features(decision([], np.zeros((1, 2))))
    assert features.rank.shape == features.detour.shape == (0,)


@given(seed=st.integers(0, 100_000), count=st.integers(1, 12))
@settings(max_examples=60, deadline=None)
def test_detours_are_differences_of_tour_lengths(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    frontiers = [
        frontier(
            0.0,
            size=float(rng.uniform(0.4, 3.0)),
            closed=bool(rng.random() < 0.5),
            area=float(rng.uniform(0, 2)),
        )
        for _ in range(count)
    ]
    given_decision = decision(frontiers, rng.uniform(0, 20, (count + 1, 2)))
    distances = given_decision.path_lengths(range(count)).astype(np.float64)
    places = [0, *(ready_frontiers(given_decision, LAYOUT_TOUR_SIZE) + 1).tolist()]
    order = [places[k] for k in latency_tour(distances[np.ix_(places, places)], np.ones(len(places) - 1))]
    features = tour_features(given_decision)
    assert [round(1 / rank) for rank in sorted(features.rank[features.rank > 0], reverse=True)] == list(
        range(1, len(order) + 1)
    )
    for k in range(count):
        first = [k + 1, *(place for place in order if place != k + 1)]
        grown = tour_length(distances, np.array(first)) - tour_length(distances, np.array(order))
        assert features.detour[k] == pytest.approx(max(0.0, grown), abs=1e-4)
        assert features.rank[k] == (pytest.approx(1 / (order.index(k + 1) + 1)) if k + 1 in order else 0.0)


def test_weights_by_area_in_view_and_expected() -> None:
    seen, predicted = (
        replace(frontier(1.0), visible_area=40.0),
        replace(frontier(2.0, area=3.0), visible_area=9.0),
    )
    given_decision = on_a_line(seen, predicted)
    config = TourConfig(most_area=16.0, area_exponent=0.5, expected_exponent=1.5)
    assert tour_weights(given_decision, np.arange(2)).tolist() == [30.0, 9.0]
    assert tour_weights(given_decision, np.arange(2), config).tolist() == [4.0, 24.0]


def test_a_first_leg_that_counts_more_keeps_the_robot_near() -> None:
    """The robot at 0, much to see at 6, a little at -4: first 6, until the longer first leg counts more."""
    much, little = replace(frontier(6.0), visible_area=30.0), replace(frontier(-4.0), visible_area=1.0)
    assert tour_features(on_a_line(much, little)).rank.tolist() == [1.0, 0.5]
    features = tour_features(on_a_line(much, little), TourConfig(first_leg=3.0))
    assert features.rank.tolist() == [0.5, 1.0]
    assert features.detour.tolist() == [2.0, 0.0], "metres are metres, whatever the weights"


def test_what_is_left_of_the_last_goal_is_held_on_to() -> None:
    far, near = frontier(4.0), frontier(-3.0)
    given_decision = on_a_line(far, near)
    for goal, first in (((3.5, 0.0), 0), ((9.0, 0.0), 1), (None, 1)):
        given_decision.goal = goal
        assert int(tour_features(given_decision, TourConfig(hold=3.0)).rank.argmax()) == first


def test_how_little_may_wait_is_for_the_tour_to_say() -> None:
    waits, rich = frontier(-1.0, closed=True, area=2.5), frontier(5.0, closed=True, area=9.0)
    assert tour_features(on_a_line(waits, rich)).rank[0] > 0
    assert tour_features(on_a_line(waits, rich), TourConfig(little_left=3.0)).rank.tolist() == [0.0, 1.0]


@pytest.mark.parametrize(
    "changes", [{"patience": -1.0}, {"hold": float("nan")}, {"most_area": "much"}, {"first_leg": True}]
)
def test_tours_that_make_no_sense(changes: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=f"tour.{next(iter(changes))} must be a number from 0 to"):
        TourConfig(**changes)
