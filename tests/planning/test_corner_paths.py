"""Path lengths by the corners of a grid that changes are those of a search over all its cells."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from layoutexplore.planning.canonical_search import FAR, Workspace
from layoutexplore.planning.corner_paths import CornerPaths
from layoutexplore.planning.corner_search import find_links
from layoutexplore.planning.corner_sight import numbers_at
from layoutexplore.planning.shortest_paths import flat_indices
from layoutexplore.planning.traversability import Traversability
from layoutexplore.sensing.lidar import sensor
from layoutexplore.simulation import state
from layoutexplore.simulation.robot import OdometryNoise
from layoutexplore.simulation.simulation import Simulation, SimulationConfig
from tests.envs.cases import rooms


def searched(world: NDArray[np.bool_], places: NDArray[np.int64]) -> NDArray[np.int64]:
    """Lengths int64 (n, n) between traversable places, each by a search over all cells."""
    space = Workspace((world.shape[0], world.shape[1]))
    space.load(world)
    flat = flat_indices(places, space)
    return np.array([space.lengths_to(int(source), flat) for source in flat]).reshape(len(flat), -1)


@given(seed=st.integers(0, 2**32))
@settings(max_examples=80, deadline=None)
def test_lengths_are_those_of_a_search_over_all_cells(seed: int) -> None:
    """The world opens and shuts in boxes, a few cells of it or all; some places stay, others come and go."""
    rng = np.random.default_rng(seed)
    rows, cols = rng.integers(1, 60, 2).tolist()
    world, paths = np.zeros((rows, cols), bool), CornerPaths((rows, cols))
    for _ in range(7):
        largest = rng.choice([3, 60])
        row, col = int(rng.integers(rows)), int(rng.integers(cols))
        part = world[
            row : row + int(rng.integers(1, largest + 1)), col : col + int(rng.integers(1, largest + 1))
        ]
        part[:] = rng.random(part.shape) > rng.choice([0.0, 0.05, 0.3, 1.0])
        paths.update(part.astype(np.uint8), row, col)
        open_cells = np.argwhere(world)
        if len(open_cells) == 0:
            continue
        places = open_cells[np.linspace(0, len(open_cells) - 1, 12).astype(int)]
        expected = searched(world, places)
        np.testing.assert_array_equal(paths.between(places), expected)
        first = places[0].tolist()
        np.testing.assert_array_equal(paths.lengths_from((first[0], first[1]), places), expected[0])
    np.testing.assert_array_equal(paths.world[1:-1, 1:-1], world)


@given(seed=st.integers(0, 2**32))
@settings(max_examples=10, deadline=None)
def test_lengths_stay_right_where_the_graph_outgrows_its_memory(seed: int) -> None:
    """Thousands of corners come at once, some go, and more come: all three tables need more room."""
    rng = np.random.default_rng(seed)
    world, paths = np.zeros((220, 230), bool), CornerPaths((220, 230))
    memory = [len(part) for part in (paths.graph.nodes.cell, paths.graph.edges.end, paths.graph.ground.node)]
    for rows, share in ((slice(None), 0.05), (slice(0, 90), 0.0), (slice(60, 220), 0.08)):
        part = world[rows]
        part[:] = rng.random(part.shape) > share
        paths.update(part.astype(np.uint8), rows.start or 0, 0)
        places = np.argwhere(world)[rng.integers(np.count_nonzero(world), size=8)]
        np.testing.assert_array_equal(paths.between(places), searched(world, places))
    grown = [len(part) for part in (paths.graph.nodes.cell, paths.graph.edges.end, paths.graph.ground.node)]
    assert all(now > before for now, before in zip(grown, memory, strict=True))


@given(seed=st.integers(0, 2**32))
@settings(max_examples=60, deadline=None)
def test_corners_are_joined_from_both_ends(seed: int) -> None:
    """After changes in boxes every edge stands at both its corners, which are those of the world."""
    rng = np.random.default_rng(seed)
    rows, cols = rng.integers(2, 40, 2).tolist()
    world, graph = np.zeros((rows, cols), bool), CornerPaths((rows, cols)).graph
    for _ in range(5):
        row, col = int(rng.integers(rows)), int(rng.integers(cols))
        part = world[row : row + 12, col : col + 12]
        part[:] = rng.random(part.shape) > 0.2
        graph.update(part.astype(np.uint8), row + 1, col + 1)
    padded = np.pad(world, 1)
    corners = np.zeros_like(world)
    for r, c in np.argwhere(world):
        for dr, dc in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            beside = padded[r + 1 + dr, c + 1] and padded[r + 1, c + 1 + dc]
            corners[r, c] |= beside and not padded[r + 1 + dr, c + 1 + dc]
    cells = np.argwhere(np.ones_like(world)).astype(np.int32) + np.int32(1)
    numbers = numbers_at(graph.ground, cells)
    np.testing.assert_array_equal(numbers.reshape(world.shape) > 0, corners)
    assert len(set(numbers[numbers > 0].tolist())) == np.count_nonzero(corners)
    ends = {
        (k, int(graph.edges.end[e]), int(graph.edges.length[e]))
        for k in numbers[numbers > 0].tolist()
        for e in range(graph.nodes.first[k], graph.nodes.first[k] + graph.nodes.degree[k])
    }
    assert ends == {(b, a, length) for a, b, length in ends}


def test_far_changes_need_no_search() -> None:
    world = np.zeros((60, 300), np.uint8)
    world[20:40] = 1
    world[::7, ::9] = 0
    paths = CornerPaths(world.shape)
    paths.update(world, 0, 0)
    places = np.array([[21, 1], [29, 40], [36, 80], [27, 120]])
    before = paths.between(places)
    count = paths.searches
    paths.update(np.zeros((4, 4), np.uint8), 30, 280)
    np.testing.assert_array_equal(paths.between(places), before)
    assert paths.searches == count, "the way to the change is longer than the ways between them"
    assert count > 0 and (before < FAR).all()


def test_places_see_corners_only() -> None:
    world = np.ones((9, 9), np.uint8)
    world[4, 4] = 0
    paths = CornerPaths((9, 9))
    paths.update(world, 0, 0)
    links = find_links(paths.graph.ground, np.array([[0, 0], [3, 3]]))
    cells = {tuple(paths.graph.nodes.cell[k].tolist()) for k in links.corner[: links.first[1]]}
    assert cells == {(4, 4)}, "the others lie behind it on a shortest path, or behind the pillar"
    assert links.length[links.first[1]] == 0, "a place on a corner is joined to it"


@pytest.mark.parametrize("noise", [{}, {"range_noise_std": 0.03, "dropout": 0.02}], ids=["exact", "noisy"])
@pytest.mark.parametrize("drift", [0.0, 0.03], ids=["sure", "drifting"])
def test_an_exploration_is_the_same_with_corners(
    noise: dict[str, float], drift: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = SimulationConfig(
        sensor=replace(sensor("short"), **noise),
        odometry_noise=OdometryNoise(translation=drift, rotation=drift / 3),
        max_distance=80.0,
    )

    def explored(large: int) -> list[tuple[float, ...]]:
        monkeypatch.setattr(state, "Traversability", partial(Traversability, large=large))
        simulation = Simulation(rooms(), config)
        decision, seen = simulation.reset(3), []
        while not simulation.done:
            count = len(decision.frontiers)
            lengths = [
                *decision.path_lengths(range(count)).ravel(),
                *decision.path_lengths_from(0, range(count)),
            ]
            seen.append((*simulation.pose, *lengths, *decision.viewpoints.ravel().tolist()))
            decision = simulation.step(count // 2)
        return seen

    with_corners = explored(1)
    assert len(with_corners) > 5 and with_corners == explored(10**9)
