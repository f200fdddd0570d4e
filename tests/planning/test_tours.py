"""Open tours: valid, never longer after local search, and close to the best."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError
from layoutexplore.planning.tours import improve_tour, open_tour, tour_length

seeds = st.integers(0, 100_000)


def plane(seed: int, count: int) -> NDArray[np.float64]:
    """Distances between a start and `count` places on a coarse grid, so that there are ties."""
    rng = np.random.default_rng(seed)
    points = np.round(rng.uniform(0, 10, (count + 1, 2)), int(rng.integers(0, 3)))
    distances: NDArray[np.float64] = np.linalg.norm(points[:, None] - points[None], axis=2)
    return distances


def shortest(distances: NDArray[np.float64]) -> float:
    """Length of the best open tour, by trying all."""
    return min(
        tour_length(distances, np.array(order)) for order in itertools.permutations(range(1, len(distances)))
    )


@given(seed=seeds, count=st.integers(0, 60))
@settings(max_examples=60, deadline=None)
def test_a_tour_visits_every_place_once(seed: int, count: int) -> None:
    order = open_tour(plane(seed, count).astype(np.float32))
    assert sorted(order.tolist()) == list(range(1, count + 1))
    assert np.array_equal(order, open_tour(plane(seed, count).astype(np.float32)))


@given(seed=seeds, count=st.integers(1, 40))
@settings(max_examples=60, deadline=None)
def test_local_search_never_lengthens(seed: int, count: int) -> None:
    distances = plane(seed, count)
    order = np.random.default_rng(seed).permutation(count) + 1
    better = improve_tour(distances, order)
    assert sorted(better.tolist()) == list(range(1, count + 1))
    assert tour_length(distances, better) <= tour_length(distances, order) + 1e-9
    assert np.array_equal(improve_tour(distances, better), better), "a local optimum stays as it is"


def test_small_tours_are_close_to_the_best() -> None:
    excess = []
    for seed in range(60):
        distances = plane(seed, 2 + seed % 6)
        excess.append(tour_length(distances, open_tour(distances)) / shortest(distances) - 1.0)
    assert min(excess) >= -1e-12
    assert np.mean(excess) < 0.02 and max(excess) < 0.2


@given(seed=seeds)
@settings(max_examples=30, deadline=None)
def test_a_local_optimum_has_no_shorter_neighbour(seed: int) -> None:
    """No reversal and no moved stretch of up to three places shortens the result."""
    distances = plane(seed, 9)
    tour = [0, *open_tour(distances).tolist()]
    length = tour_length(distances, np.array(tour[1:]))
    neighbours = [tour[:i] + tour[i:j][::-1] + tour[j:] for i in range(1, 10) for j in range(i + 2, 11)]
    for size in (1, 2, 3):
        for i in range(1, 11 - size):
            stretch, rest = tour[i : i + size], tour[:i] + tour[i + size :]
            neighbours += [
                rest[:k] + piece + rest[k:]
                for k in range(1, len(rest) + 1)
                for piece in (stretch, stretch[::-1])
            ]
    for neighbour in neighbours:
        assert tour_length(distances, np.array(neighbour[1:])) >= length - 1e-5


def test_places_that_are_not_connected_come_last() -> None:
    distances = plane(3, 6)
    distances[2, :] = distances[:, 2] = np.inf
    order = open_tour(distances)
    assert order[-1] == 2 and sorted(order) == [1, 2, 3, 4, 5, 6]


@pytest.mark.parametrize("shape", [(0, 0), (2, 3), (4,)])
def test_a_matrix_must_be_square(shape: tuple[int, ...]) -> None:
    with pytest.raises(ConfigError, match="square"):
        open_tour(np.zeros(shape))


def test_an_order_must_be_a_permutation() -> None:
    with pytest.raises(ConfigError, match="permutation"):
        improve_tour(plane(0, 3), np.array([1, 1, 2]))
