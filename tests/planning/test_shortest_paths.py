"""Distances and paths against a heap-based Dijkstra."""

from __future__ import annotations

import heapq
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError, MapError
from layoutexplore.grids.grid import Cell
from layoutexplore.grids.morphology import inflate
from layoutexplore.planning import canonical_search as wavefront
from layoutexplore.planning.shortest_paths import (
    check_path,
    descend,
    distance_matrix,
    distances_between,
    geodesic_distances,
    shortest_path,
)


def heap_distances(traversable: NDArray[np.bool_], source: tuple[int, int]) -> NDArray[np.float64]:
    """Octile distances in cells by Dijkstra's algorithm with a heap; no corner is cut."""
    rows, cols = traversable.shape
    best = np.full(traversable.shape, np.inf)
    best[source] = 0.0
    heap = [(0.0, source)]
    while heap:
        length, (r, c) = heapq.heappop(heap)
        if length > best[r, c]:
            continue
        for dr, dc in ((-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (-1, 1), (1, -1), (1, 1)):
            a, b = r + dr, c + dc
            if not (0 <= a < rows and 0 <= b < cols and traversable[a, b]):
                continue
            if dr and dc and not (traversable[r, b] and traversable[a, c]):
                continue
            there = length + math.hypot(dr, dc)
            if there < best[a, b]:
                best[a, b] = there
                heapq.heappush(heap, (there, (a, b)))
    return best


def close(a: NDArray[np.floating], b: NDArray[np.floating]) -> bool:
    return bool(np.array_equal(np.isinf(a), np.isinf(b)) and np.allclose(a, b, rtol=3e-7, atol=1e-6))


@st.composite
def masks(draw: st.DrawFn) -> NDArray[np.bool_]:
    """Clutter, pillars in rank and file (many ties), or rooms with doors."""
    rows, cols = draw(st.tuples(st.integers(1, 40), st.integers(1, 40)))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    kind = draw(st.sampled_from(["clutter", "pillars", "rooms"]))
    if kind == "clutter":
        return rng.random((rows, cols)) > draw(st.sampled_from([0.0, 0.02, 0.1, 0.3, 0.45]))
    mask = np.ones((rows, cols), bool)
    pitch = draw(st.integers(2, 7))
    if kind == "pillars":
        mask[1::pitch, 1::pitch] = False
        return mask
    mask[pitch :: pitch + 2] = False
    mask[:, pitch :: pitch + 2] = False
    doors = rng.random((rows, cols)) < 0.15
    return mask | doors


def draw_cell(draw: st.DrawFn, mask: NDArray[np.bool_]) -> tuple[int, int]:
    return draw(st.integers(0, mask.shape[0] - 1)), draw(st.integers(0, mask.shape[1] - 1))


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_distances_are_those_of_a_heap(data: st.DataObject) -> None:
    mask = data.draw(masks())
    source = draw_cell(data.draw, mask)
    resolution = data.draw(st.sampled_from([0.05, 0.1, 1.0]))
    assert close(
        geodesic_distances(mask, Cell(*source), resolution), heap_distances(mask, source) * resolution
    )


@settings(max_examples=100, deadline=None)
@given(st.data())
def test_stopping_early_keeps_what_is_needed(data: st.DataObject) -> None:
    mask = data.draw(masks())
    source = draw_cell(data.draw, mask)
    stops = np.array([draw_cell(data.draw, mask) for _ in range(data.draw(st.integers(1, 4)))], np.int32)
    full = geodesic_distances(mask, Cell(*source), 0.1)
    early = geodesic_distances(mask, Cell(*source), 0.1, stop_at=stops)
    assert np.array_equal(early[tuple(stops.T)], full[tuple(stops.T)])
    finite = np.isfinite(early)
    assert np.array_equal(early[finite], full[finite])
    farthest = full[tuple(stops.T)].max()
    assert finite[full <= farthest - 0.1].all() or np.isinf(farthest)


@settings(max_examples=100, deadline=None)
@given(st.data())
def test_descent_is_a_shortest_path(data: st.DataObject) -> None:
    mask = data.draw(masks())
    source = draw_cell(data.draw, mask)
    distances = geodesic_distances(mask, Cell(*source), 0.1)
    reached = np.argwhere(np.isfinite(distances))
    target = Cell(*(int(v) for v in reached[data.draw(st.integers(0, len(reached) - 1))]))
    path = descend(distances, mask, target)
    assert path.dtype == np.int32 and tuple(path[0]) == source and tuple(path[-1]) == target
    assert mask[tuple(path[1:].T)].all()
    steps = np.diff(path, axis=0)
    assert (abs(steps).max(axis=1, initial=0) == 1).all()
    for (r, c), (dr, dc) in zip(path[:-1], steps, strict=True):
        assert not (dr and dc) or (mask[r + dr, c] and mask[r, c + dc])
    assert math.isclose(np.hypot(*steps.T).sum() * 0.1, distances[target], rel_tol=1e-5, abs_tol=1e-6)
    assert np.array_equal(path, descend(distances, mask, target))


@settings(max_examples=80, deadline=None)
@given(st.data())
def test_matrix_holds_all_pairs(data: st.DataObject) -> None:
    mask = data.draw(masks())
    cells = np.array(
        [draw_cell(data.draw, mask) for _ in range(data.draw(st.integers(0, 7)))], np.int32
    ).reshape(-1, 2)
    matrix = distance_matrix(mask, cells, 0.1)
    assert matrix.dtype == np.float32 and matrix.shape == (len(cells), len(cells))
    assert np.array_equal(matrix, matrix.T) and not matrix.diagonal().any()
    for i, source in enumerate(cells):
        expected = heap_distances(mask, tuple(source)) * 0.1
        for j, target in enumerate(cells):
            if mask[tuple(target)]:
                assert close(matrix[i, j], expected[tuple(target)])


def test_matrix_from_and_to_cells_that_are_not_traversable() -> None:
    mask = np.array([[c == "." for c in line] for line in ("#....", "..#..", "....#")])
    shut = np.array([[0, 0], [1, 2], [2, 4]], np.int32)
    matrix = distance_matrix(mask, shut, 1.0)
    # Each neighbouring pair is a diagonal and a straight move apart; the outer two may not go through the
    # middle one.
    assert np.array_equal(matrix, matrix.T)
    assert np.allclose(matrix[[0, 1, 0], [1, 2, 2]], [1 + 2**0.5, 1 + 2**0.5, 4 + 2**0.5])
    twice = distance_matrix(mask, np.array([[0, 0], [0, 0], [0, 3]], np.int32), 1.0)
    assert twice[0, 1] == 0.0 and np.isclose(twice[1, 2], 3.0)


def test_matrix_between_components() -> None:
    mask = np.ones((5, 9), bool)
    mask[:, 4] = False
    matrix = distance_matrix(mask, np.array([[0, 0], [4, 8], [4, 0], [0, 8]], np.int32), 1.0)
    assert np.isinf(matrix[0, 1]) and np.isinf(matrix[2, 3]) and matrix[0, 2] == matrix[1, 3] == 4.0


def test_many_searches_share_their_distances() -> None:
    """More places than searches fit between two clearings, some of them cut off."""
    rng = np.random.default_rng(3)
    mask = rng.random((40, 50)) > 0.35
    cells = np.argwhere(mask)[rng.choice(int(mask.sum()), 40, replace=False)].astype(np.int32)
    expected = [
        geodesic_distances(mask, Cell(*cell), 0.1)[cells[:, 0], cells[:, 1]] for cell in cells.tolist()
    ]
    np.testing.assert_array_equal(distance_matrix(mask, cells, 0.1), np.array(expected))
    for cell, lengths in zip(cells.tolist(), expected, strict=True):
        np.testing.assert_array_equal(distances_between(mask, Cell(*cell), cells, 0.1), lengths)


def test_a_path_too_long_for_shared_distances_is_found_all_the_same() -> None:
    mask = np.ones((301, 301), bool)
    mask[1::2] = False
    mask[1::4, -1] = mask[3::4, 0] = True  # One corridor of 45 000 cells, to and fro.
    cells = np.array([[0, 0], [300, 300], [150, 7]], np.int32)
    matrix = distance_matrix(mask, cells, 1.0)
    assert matrix[0, 1] == 150 * 302 + 300 and matrix[0, 2] + matrix[2, 1] == matrix[0, 1]


def test_a_search_outgrows_its_queue() -> None:
    mask = np.random.default_rng(0).random((60, 60)) > 0.3
    expected = geodesic_distances(mask, Cell(30, 30), 1.0)
    space = wavefront.workspace(mask)
    space.memory.resize(4)
    assert np.array_equal(geodesic_distances(mask, Cell(30, 30), 1.0), expected)
    assert space.memory.queue.items.size > 4


def test_a_path_too_long_to_count_is_none() -> None:
    mask = np.ones((1201, 1201), bool)
    mask[1::2] = False
    mask[1::4, -1] = mask[3::4, 0] = True  # One corridor of 720 000 cells, to and fro.
    distances = geodesic_distances(mask, Cell(0, 0), 1.0)
    finite = np.isfinite(distances)
    assert distances[0, 1200] == 1200.0 and np.isinf(distances[1200, 600])
    assert (np.diff(distances[600][finite[600]]) == -1).all() or (
        np.diff(distances[600][finite[600]]) == 1
    ).all()
    assert 300_000 < distances[finite].max() < 375_000


def test_a_path_is_copied_in_the_order_of_memory_that_kernels_know() -> None:
    path = np.asfortranarray(np.array([[1, 1], [1, 2], [2, 3]], np.int32))
    checked = check_path(path, Cell(1, 1))
    assert checked.flags.c_contiguous and checked.tolist() == path.tolist()
    assert not np.shares_memory(check_path(checked, Cell(1, 1)), checked)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.uint64])
def test_paths_of_unsigned_numbers_lead_anywhere(dtype: type) -> None:
    path = [[3, 3], [2, 3], [1, 2], [2, 1]]
    assert check_path(np.array(path, dtype), Cell(3, 3)).tolist() == path
    with pytest.raises(ConfigError, match=r"jumps from \(3, 3\) to \(1, 3\)"):
        check_path(np.array([[3, 3], [1, 3]], dtype), Cell(3, 3))


def test_bad_input_is_refused() -> None:
    mask = np.ones((4, 5), bool)
    with pytest.raises(ConfigError, match=r"cell \(4, 0\) lies outside"):
        geodesic_distances(mask, Cell(4, 0), 1.0)
    with pytest.raises(ConfigError, match=r"cell \(0, -1\) lies outside"):
        geodesic_distances(mask, Cell(0, 0), 1.0, stop_at=np.array([[0, -1]], np.int32))
    with pytest.raises(ConfigError, match="lies outside"):
        distance_matrix(mask, np.array([[0, 0], [9, 9]], np.int32), 1.0)
    with pytest.raises(MapError, match="bool"):
        geodesic_distances(mask.astype(np.int8), Cell(0, 0), 1.0)  # type: ignore[arg-type]
    with pytest.raises(MapError, match="resolution"):
        distance_matrix(mask, np.zeros((2, 2), np.int32), math.nan)
    for radius in (-0.1, math.nan):
        with pytest.raises(ConfigError, match="radius"):
            inflate(mask, radius, 0.1)
    mask[:, 2] = False
    with pytest.raises(ConfigError, match="cannot be reached"):
        descend(geodesic_distances(mask, Cell(0, 0), 1.0), mask, Cell(0, 4))
    with pytest.raises(ConfigError, match="another grid"):
        descend(np.ones((4, 5), np.float32), mask, Cell(0, 0))


@given(mask=masks(), seed=st.integers(0, 2**32))
@settings(max_examples=40, deadline=None)
def test_one_path_is_the_one_down_the_distances(mask: NDArray[np.bool_], seed: int) -> None:
    cells = np.argwhere(mask)
    if len(cells) == 0:
        return
    rng = np.random.default_rng(seed)
    start, end = (Cell(*cells[rng.integers(len(cells))].tolist()) for _ in range(2))
    search = wavefront.Workspace((mask.shape[0], mask.shape[1]))
    search.load(mask)
    path = shortest_path(search, start, end, 0.1)
    distances = geodesic_distances(mask, start, 0.1)
    if np.isinf(distances[end]):
        assert len(path) == 0
    else:
        assert np.array_equal(path, descend(distances, mask, end))
