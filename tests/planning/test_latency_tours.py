"""Latency tours: valid, cheaper than their start, close to the best, between a short and a greedy tour."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError
from layoutexplore.planning.latency_tours import latency_cost, latency_tour
from layoutexplore.planning.tours import open_tour, tour_length

seeds = st.integers(0, 100_000)
patiences = st.sampled_from([0.0, 0.3, 1.0, 5.0])


def case(seed: int, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distances on a plane between a start and `count` places, coarse for ties, and weights with zeros."""
    rng = np.random.default_rng(seed)
    points = np.round(rng.uniform(0, 10, (count + 1, 2)), int(rng.integers(0, 3)))
    weights = np.maximum(rng.uniform(-1, 4, count), 0.0)
    return np.linalg.norm(points[:, None] - points[None], axis=2), weights


def slow_cost(
    distances: NDArray[np.float64], weights: NDArray[np.float64], order: NDArray[np.int64], patience: float
) -> float:
    """The cost by walking the tour place by place."""
    here, metres, cost = 0, 0.0, 0.0
    shares = weights / weights.sum() if weights.sum() > 0 else np.full(len(weights), 1 / len(weights))
    for place in order.tolist():
        metres += distances[here, place]
        cost += shares[place - 1] * metres
        here = place
    return cost + patience * metres


@given(seed=seeds, count=st.integers(1, 40), patience=patiences)
@settings(max_examples=60, deadline=None)
def test_every_place_once_and_no_dearer_than_the_short_tour(seed: int, count: int, patience: float) -> None:
    distances, weights = case(seed, count)
    order = latency_tour(distances, weights, patience)
    assert sorted(order.tolist()) == list(range(1, count + 1))
    assert np.array_equal(order, latency_tour(distances, weights, patience))
    assert (
        slow_cost(distances, weights, order, patience)
        <= slow_cost(distances, weights, open_tour(distances), patience) + 1e-9
    )


@given(seed=seeds, count=st.integers(1, 6), patience=patiences)
@settings(max_examples=40, deadline=None)
def test_small_tours_are_close_to_the_best(seed: int, count: int, patience: float) -> None:
    distances, weights = case(seed, count)
    orders = [np.array(order) for order in itertools.permutations(range(1, count + 1))]
    best = min(slow_cost(distances, weights, order, patience) for order in orders)
    assert (
        best - 1e-9
        <= slow_cost(distances, weights, latency_tour(distances, weights, patience), patience)
        <= 1.25 * best + 1e-9
    )


@given(seed=seeds, count=st.integers(1, 12), patience=patiences)
@settings(max_examples=40, deadline=None)
def test_the_cost_is_that_of_walking(seed: int, count: int, patience: float) -> None:
    distances, weights = case(seed, count)
    weights = weights + 0.1
    order = np.random.default_rng(seed).permutation(count) + 1
    assert latency_cost(distances, weights, order, patience) == pytest.approx(
        slow_cost(distances, weights, order, patience)
    )


def test_the_cost_is_what_the_tour_is_chosen_by() -> None:
    position = np.array([0.0, 7.0, -1.0, 3.0])
    distances, order = abs(position[:, None] - position), np.array([2, 3, 1])
    alike = latency_cost(distances, np.ones(3), order)
    assert latency_cost(distances, np.zeros(3), order) == alike == pytest.approx((1 + 5 + 9) / 3 + 9)
    assert latency_tour(distances, np.zeros(3)).tolist() == order.tolist()
    apart = np.array([[0, 5, np.inf], [5, 0, np.inf], [np.inf, np.inf, 0]])
    costs = [latency_cost(apart, np.array([1.0, 0.0]), np.array(tour)) for tour in ([1, 2], [2, 1])]
    assert np.isfinite(costs).all() and costs[0] < costs[1]
    assert latency_cost(np.zeros((1, 1)), np.empty(0), np.empty(0)) == 0.0
    with pytest.raises(ConfigError, match="finite weights"):
        latency_cost(distances, np.ones(2), order)


def test_patience_makes_tours_short_and_impatience_goes_where_much_is() -> None:
    excess, delays = [], []
    for seed in range(30):
        distances, weights = case(seed, 15)
        heavy = int(np.argmax(weights)) + 1
        patient, hasty = (latency_tour(distances, weights, patience) for patience in (1000.0, 0.0))
        excess.append(tour_length(distances, patient) / tour_length(distances, open_tour(distances)))
        delays.append(patient.tolist().index(heavy) - hasty.tolist().index(heavy))
    assert np.mean(excess) <= 1.0 + 1e-9
    assert np.mean(delays) > 2


def test_unconnected_places_come_last() -> None:
    distances = np.array([[0, 5, np.inf], [5, 0, np.inf], [np.inf, np.inf, 0]])
    assert latency_tour(distances, np.array([0.1, 50.0])).tolist() == [1, 2]


@pytest.mark.parametrize(
    ("distances", "weights", "patience"),
    [
        (np.zeros((2, 3)), np.ones(1), 1.0),
        (np.zeros((3, 3)), np.ones(3), 1.0),
        (np.zeros((3, 3)), np.array([1.0, np.nan]), 1.0),
        (np.zeros((3, 3)), np.array([1.0, -1.0]), 1.0),
        (np.zeros((3, 3)), np.ones(2), -1.0),
        (np.zeros((3, 3)), np.ones(2), np.inf),
    ],
)
def test_nonsense_is_refused(
    distances: NDArray[np.float64], weights: NDArray[np.float64], patience: float
) -> None:
    with pytest.raises(ConfigError):
        latency_tour(distances, weights, patience)
