"""Path lengths that are kept while a map grows and shrinks are those that are computed anew."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.errors import ConfigError
from layoutexplore.planning.canonical_search import DIAGONAL, STRAIGHT
from layoutexplore.planning.distance_cache import DistanceCache, nearest_change
from layoutexplore.planning.known_lengths import next_source
from layoutexplore.planning.shortest_paths import distance_matrix
from layoutexplore.simulation.simulation import Simulation, SimulationConfig
from tests.envs.cases import rooms


@given(seed=st.integers(0, 100_000))
@settings(max_examples=80, deadline=None)
def test_kept_lengths_are_exact(seed: int) -> None:
    """Places come, go and coincide, some in walls; a few cells open and shut each time, now and then many."""
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(3, 40, 2).tolist())
    mask = rng.random(shape) > rng.uniform(0, 0.5)
    cache = DistanceCache()
    places = np.stack([rng.integers(0, n, 30) for n in shape], axis=1)
    for _ in range(8):
        asked = places[rng.choice(30, int(rng.integers(0, 20)))]
        np.testing.assert_array_equal(
            cache.lengths(mask, asked, 0.1), distance_matrix(mask, asked.astype(np.int32), 0.1)
        )
        flips = rng.integers(0, 4) if rng.random() < 0.9 else mask.size
        where = rng.integers(0, mask.size, flips)
        mask = mask.copy()
        mask.ravel()[where] ^= True


@given(seed=st.integers(0, 100_000))
@settings(max_examples=40, deadline=None)
def test_thenearest_change_is_as_far_as_the_straight_way(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows, cols = rng.integers(1, 900, 2).tolist()
    places = np.stack([rng.integers(0, rows, 9), rng.integers(0, cols, 9)], axis=1)
    changes = rng.choice(rows * cols, int(rng.integers(1, min(rows * cols, 40) + 1)), replace=False)
    away = abs(places[:, None] - np.stack(np.divmod(changes, cols), axis=1))
    diagonal = away.min(axis=2)
    expected = (STRAIGHT * (away.max(axis=2) - diagonal) + DIAGONAL * diagonal).min(axis=1)
    assert nearest_change(places, changes, cols).tolist() == expected.tolist()


@given(seed=st.integers(0, 100_000))
@settings(max_examples=80, deadline=None)
def test_the_next_source_knows_least_and_lies_farthest(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 9))
    units = rng.integers(0, 5, (count, count))
    units[rng.random((count, count)) < rng.uniform(0, 0.6)] = -1
    missing = (units == -1).sum(axis=1)
    most = np.flatnonzero(missing == missing.max())
    for first in range(-1, count):
        best = most[0] if first < 0 else most[np.argmax(units[first, most])]
        assert next_source(units, first) == (best if missing.any() else -1)


def test_far_changes_need_no_search() -> None:
    mask = np.ones((20, 200), bool)
    places = np.array([[5, 5], [8, 30], [15, 12], [3, 190]])
    cache = DistanceCache()
    cache.lengths(mask, places, 0.1)
    before = cache.searches
    mask[10:, 150] = False
    np.testing.assert_array_equal(
        cache.lengths(mask, places[:3], 0.1), distance_matrix(mask, places[:3].astype(np.int32), 0.1)
    )
    assert cache.searches == before, "the way to the change is longer than the ways between them"
    np.testing.assert_array_equal(
        cache.lengths(mask, places, 0.1), distance_matrix(mask, places.astype(np.int32), 0.1)
    )
    assert cache.searches == before + 1, "one search from the place behind it finds all"


def test_the_table_does_not_grow_without_end() -> None:
    mask, rng, cache = np.ones((60, 60), bool), np.random.default_rng(0), DistanceCache()
    for _ in range(12):
        places = rng.integers(0, 60, (40, 2))
        np.testing.assert_array_equal(
            cache.lengths(mask, places, 0.1), distance_matrix(mask, places.astype(np.int32), 0.1)
        )
        assert len(cache._known.cells) <= 256 + 40


def test_another_shape_is_another_map() -> None:
    cache = DistanceCache()
    cache.lengths(np.ones((4, 4), bool), np.array([[0, 0], [3, 3]]), 1.0)
    assert cache.lengths(np.ones((5, 4), bool), np.array([[0, 0], [4, 0]]), 1.0)[0, 1] == 4.0
    with pytest.raises(ConfigError, match="outside"):
        cache.lengths(np.ones((5, 4), bool), np.array([[0, 9]]), 1.0)


def test_an_exploration_keeps_most_lengths() -> None:
    simulation = Simulation(rooms(), SimulationConfig(sensor="short"))
    decision, asked = simulation.reset(3), 0
    while not simulation.done:
        everything = range(len(decision.frontiers))
        lengths = decision.path_lengths(everything)
        cells = np.array([f.viewpoint for f in decision.frontiers], np.int32)
        np.testing.assert_array_equal(lengths[1:, 1:], distance_matrix(decision.traversable, cells, 0.1))
        asked += len(cells)
        copy.deepcopy(simulation.state.traversability.cache)
        decision = simulation.step(len(decision.frontiers) // 2)
    assert simulation.state.traversability.cache.searches < 0.8 * asked
