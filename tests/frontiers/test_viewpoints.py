"""Viewpoints see their frontier; kernels against slow obvious versions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from layoutexplore.frontiers.detection import find_frontiers
from layoutexplore.frontiers.viewpoints import (
    MAX_REACH,
    NONE_FAILED,
    ViewpointSelector,
    cells_in_view,
    choose_viewpoints,
    facing,
    remaining_share,
)
from layoutexplore.grids.grid import Cell, OccupancyGrid, Pose
from layoutexplore.planning.shortest_paths import geodesic_distances
from layoutexplore.planning.traversability import Traversability
from layoutexplore.simulation.config import SimulationConfig

TRINARY = hnp.arrays(
    np.int8, st.tuples(st.integers(3, 24), st.integers(3, 24)), elements=st.sampled_from([-1, 0, 0, 0, 100])
)


def border_cells(cells: NDArray[np.int8]) -> NDArray[np.bool_]:
    """Free cells with an unknown 4-neighbour, by shifting the whole array."""
    padded = np.pad(cells, 1, constant_values=100)
    neighbours = [padded[:-2, 1:-1], padded[2:, 1:-1], padded[1:-1, :-2], padded[1:-1, 2:]]
    return (cells == 0) & np.any([n == -1 for n in neighbours], axis=0)


def padded(distances: NDArray[np.float32]) -> NDArray[np.int32]:
    """0 where a cell has a finite distance and 1 elsewhere, with a border of 1."""
    return np.pad(np.isinf(distances).astype(np.int32), 1, constant_values=1)


@settings(max_examples=60, deadline=None)
@given(cells=TRINARY, data=st.data())
def test_remaining_share(cells: NDArray[np.int8], data: st.DataObject) -> None:
    every = np.argwhere(np.ones_like(cells)).astype(np.int32)
    chosen = every[data.draw(st.lists(st.integers(0, len(every) - 1), min_size=1, max_size=20))]
    expected = ((cells == -1) | border_cells(cells))[chosen[:, 0], chosen[:, 1]].mean()
    assert remaining_share(cells, chosen) == expected


@settings(max_examples=60, deadline=None)
@given(cells=TRINARY, seed=st.integers(0, 1000))
def test_viewpoints_are_reachable_near_and_in_sight(cells: NDArray[np.int8], seed: int) -> None:
    free = np.argwhere(cells == 0)
    if len(free) == 0:
        return
    start = Cell(*map(int, free[seed % len(free)]))
    distances = geodesic_distances(cells == 0, start, 0.1)
    clusters = find_frontiers(cells)
    view, found, _ = choose_viewpoints(cells, padded(distances), 0, clusters, 0.1, NONE_FAILED)
    for k in range(len(clusters)):
        members = clusters.cluster(k)
        if found[k]:
            assert np.isfinite(distances[tuple(view[k])])
            assert np.hypot(*(members - view[k]).T).min() * 0.1 <= MAX_REACH + 1e-9
            assert len(cells_in_view(cells, members, tuple(view[k]), 0.1)) > 0, (
                "the viewpoint sees a part of the frontier"
            )
        else:
            assert not np.isfinite(distances[tuple(members.T)]).all(), (
                "a frontier on reachable cells has a viewpoint"
            )


@pytest.mark.parametrize("resolution", [0.08, 0.1, 0.2, 0.4])
def test_the_farthest_viewpoint_sees_its_frontier_at_any_resolution(resolution: float) -> None:
    """Where it did not, a frontier that looking did not clear was never given up: the robot stayed there."""
    reach = math.ceil(MAX_REACH / resolution)
    cells, distances = np.zeros((1, reach + 2), np.int8), np.full((1, reach + 2), np.inf, np.float32)
    cells[0, -1], distances[0, 0] = -1, 0.0
    clusters = find_frontiers(cells)
    view, found, _ = choose_viewpoints(cells, padded(distances), 0, clusters, resolution, NONE_FAILED)
    assert found.all() and view.tolist() == [[0, 0]]
    assert cells_in_view(cells, clusters.cells, (0, 0), resolution).tolist() == [[0, reach]]


@settings(max_examples=60, deadline=None)
@given(cells=TRINARY, seed=st.integers(0, 1000))
def test_what_was_searched_in_vain_is_searched_again_when_something_changes(
    cells: NDArray[np.int8], seed: int
) -> None:
    rng, failed = np.random.default_rng(seed), NONE_FAILED
    distances = padded(
        np.where((cells == 0) & (rng.random(cells.shape) < 0.5), 1.0, np.inf).astype(np.float32)
    )
    for _ in range(4):
        clusters = find_frontiers(cells)
        view, found, failed = choose_viewpoints(cells, distances, 0, clusters, 0.1, failed)
        expected = choose_viewpoints(cells, distances, 0, clusters, 0.1, NONE_FAILED)
        np.testing.assert_array_equal(view, expected[0])
        np.testing.assert_array_equal(found, expected[1])
        assert len(failed) == np.count_nonzero(~found)
        for changed in (cells, distances[1:-1, 1:-1]):
            row, col = (int(rng.integers(n)) for n in cells.shape)
            other = (int(rng.integers(n)) for n in cells.shape)
            changed[row, col] = changed[tuple(other)]


def test_wall_hides_the_nearest_cell() -> None:
    """The reachable cell behind the wall is nearer as the crow flies, but does not see the frontier."""
    cells = np.zeros((9, 9), np.int8)
    cells[4, :8] = 100
    cells[:4, 0] = -1
    distances = np.where(cells == 0, 1.0, np.inf).astype(np.float32)
    distances[:4, :4] = np.inf
    clusters = find_frontiers(cells)
    view, found, _ = choose_viewpoints(cells, padded(distances), 0, clusters, 0.1, NONE_FAILED)
    assert found.all() and (view[:, 0] < 4).all()


def test_a_long_frontier_is_offered_through_the_doorway_that_few_of_its_cells_lie_in() -> None:
    """A few rays beyond a door make a frontier of hundreds of cells, which only those at the door show."""
    cells = np.full((12, 400), -1, np.int8)
    cells[:6, :20], cells[6, :20], cells[6, 18], cells[7, 10:] = 0, 100, 0, 0
    distances = np.full(cells.shape, np.inf, np.float32)
    distances[:6, :20] = 1.0
    clusters = find_frontiers(cells).chosen(find_frontiers(cells).cells[:, 0] == 7)
    view, found, _ = choose_viewpoints(cells, padded(distances), 0, clusters, 0.1, NONE_FAILED)
    assert len(clusters) == 1 and len(clusters.cells) == 390
    assert found.all() and view[0].tolist() == [5, 18]


def test_facing_looks_into_the_unknown() -> None:
    cells = np.zeros((5, 5), np.int8)
    cells[4] = -1
    frontier = np.array([[3, c] for c in range(5)], np.int32)
    assert facing(cells, frontier, (1, 2)) == math.pi / 2


@settings(max_examples=60, deadline=None)
@given(cells=TRINARY, data=st.data())
def test_offered_frontiers_are_listed_as_if_one_by_one(cells: NDArray[np.int8], data: st.DataObject) -> None:
    """Blacklisted cells are left out, and what is kept as a table is what each frontier tells."""
    free = np.argwhere(cells == 0)
    if len(free) == 0:
        return
    config = SimulationConfig(robot_radius=0.1, frontier_min_size=data.draw(st.sampled_from([0.0, 0.3])))
    grid, ground, selector = (
        OccupancyGrid(cells, 0.1),
        Traversability(cells.shape, 0.1, 0.1),
        ViewpointSelector(
            cells.shape,
            config.resolution,
            min_size=config.frontier_min_size,
            gain_range=min(config.gain_range, config.lidar.range_max),
            gain_rays=config.gain_rays,
        ),
    )
    ground.note((0, cells.shape[0], 0, cells.shape[1]))
    start = Cell(*map(int, free[data.draw(st.integers(0, len(free) - 1))]))
    here = Pose(*grid.cell_to_world(*start), 0.0)
    blacklisted: set[tuple[int, int]] = set()
    for _ in range(3):
        distances = ground.distances(cells, start)
        found = selector.frontiers(grid, here, distances, find_frontiers(cells), (0, 0, 0, 0))
        clusters = find_frontiers(cells)
        rest = [
            [tuple(c) for c in clusters.cluster(k).tolist() if tuple(c) not in blacklisted]
            for k in range(len(clusters))
        ]
        expected = [cluster for cluster in rest if cluster]
        offered = [[tuple(c) for c in frontier.cells.tolist()] for frontier in found]
        assert all(cluster in expected for cluster in offered)
        lengths = [frontier.path_length for frontier in found]
        assert lengths == sorted(lengths) and len(found) == len(offered)
        for k, frontier in enumerate(found):
            assert found[k] is frontier is found[k - len(found)] and found[k : k + 1] == (frontier,)
            assert frontier.size == len(frontier.cells) * 0.1
            assert frontier.path_length == distances.metres()[frontier.viewpoint]
            middle = frontier.cells.mean(axis=0)
            assert frontier.centroid == grid.cell_to_world(*middle) and not blacklisted & set(offered[k])
            told = (
                *frontier.centroid,
                frontier.path_length,
                frontier.straight_distance,
                frontier.size,
                frontier.visible_area,
            )
            assert tuple(column[k] for column in found.table) == (*told, 0.0, 0.0, 0.0)
        if len(found):
            chosen = found[data.draw(st.integers(0, len(found) - 1))].cells
            seen = chosen[: data.draw(st.integers(1, len(chosen)))]
            selector.blacklist(seen)
            blacklisted |= {tuple(c) for c in seen.tolist()}
