"""The classic segmentations: small plans with a known answer, ties, hard inputs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.spatial import Voronoi

from layoutexplore.grids.flood import grow_labels
from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.layout.outlines import label_polygons, number_rooms
from layoutexplore.layout.pipeline import reconstruct
from layoutexplore.layout.survey.border_merging import Borders, _target, merge_by_borders
from layoutexplore.layout.survey.critical_lines import critical_lines
from layoutexplore.layout.survey.voronoi_graph import contour_cells, voronoi_edges

METHODS = ("morphological", "distance", "voronoi")


def two_rooms() -> OccupancyGrid:
    """Two rooms of 7 m x 8 m with a door of 0.9 m between them, at 0.1 m."""
    cells = np.full((90, 152), 100, np.int8)
    cells[5:85, 5:75] = 0
    cells[5:85, 77:147] = 0
    cells[40:49, 75:77] = 0
    return OccupancyGrid(cells, 0.1)


@pytest.mark.parametrize("method", METHODS)
def test_two_rooms_are_two_rooms(method: str) -> None:
    grid = two_rooms()
    layout = reconstruct(grid, method)
    assert len(layout.rooms) == 2
    assert not layout.labels[grid.occupied].any()
    assert layout.labels[45, 30] != layout.labels[45, 120]
    assert all(room.polygon.is_valid for room in layout.rooms)
    assert layout.rooms[0].polygon.intersection(layout.rooms[1].polygon).area == 0
    again = reconstruct(grid, method)
    assert (again.labels == layout.labels).all()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("value", [-1, 0, 100])
def test_uniform_grids(method: str, value: int) -> None:
    layout = reconstruct(OccupancyGrid(np.full((40, 30), value, np.int8), 0.05), method)
    assert len(layout.rooms) <= 1
    if value != 0:
        assert layout.warnings


@settings(max_examples=25, deadline=None)
@given(hnp.arrays(np.int8, (24, 31), elements=st.sampled_from([-1, 0, 0, 0, 100])), st.sampled_from(METHODS))
def test_random_grids_never_break_them(cells: np.ndarray, method: str) -> None:
    grid = OccupancyGrid(cells, 0.2)
    layout = reconstruct(grid, method)
    assert not layout.labels[cells != 0].any()
    assert sorted(np.unique(layout.labels[layout.labels > 0])) == [room.id for room in layout.rooms]


def slow_wave(seeds: np.ndarray, mask: np.ndarray) -> np.ndarray:
    labels = seeds.copy()
    while True:
        before = labels.copy()
        for r, c in np.argwhere(mask & (before == 0)):
            near = before[max(r - 1, 0) : r + 2, max(c - 1, 0) : c + 2].ravel()
            near = near[near > 0]
            if len(near):
                labels[r, c] = near[0]
        if (labels == before).all():
            return labels


@settings(max_examples=60, deadline=None)
@given(
    hnp.arrays(np.int32, (9, 11), elements=st.sampled_from([0, 0, 0, 0, 0, 1, 2])),
    hnp.arrays(np.bool_, (9, 11)),
)
def test_the_wave_equals_the_slow_one(seeds: np.ndarray, mask: np.ndarray) -> None:
    assert (grow_labels(seeds, mask) == slow_wave(seeds, mask)).all()


@settings(max_examples=80, deadline=None)
@given(hnp.arrays(np.int32, (8, 9), elements=st.integers(0, 3)))
def test_outlines_cover_the_largest_part_of_each_label(labels: np.ndarray) -> None:
    import cv2

    shapes = label_polygons(labels)
    assert sorted(shapes) == sorted(set(labels.ravel().tolist()) - {0})
    for label, shape in shapes.items():
        count, parts = cv2.connectedComponents((labels == label).astype(np.uint8), connectivity=4)
        largest = max(int((parts == k).sum()) for k in range(1, count))
        assert shape.is_valid
        assert shape.area <= largest
        # a hole that touches its part's outline at a corner may cost a piece of it, nothing else may
        assert shape.area == largest or not _simple(parts, count)


def _simple(parts: np.ndarray, count: int) -> bool:
    """No 2 x 2 block in which one part touches itself at a corner only."""
    for k in range(1, count):
        m = parts == k
        diagonal = m[:-1, :-1] & m[1:, 1:] & ~m[:-1, 1:] & ~m[1:, :-1]
        other = ~m[:-1, :-1] & ~m[1:, 1:] & m[:-1, 1:] & m[1:, :-1]
        if diagonal.any() or other.any():
            return False
    return True


def test_rooms_are_numbered_in_raster_order() -> None:
    assert number_rooms(np.array([[0, 7, 7], [3, 0, 9]], np.int32)).tolist() == [[0, 1, 1], [2, 0, 3]]


def test_borders_count_distinct_cells_and_merge() -> None:
    labels = np.array([[1, 1, 2], [1, 1, 2], [0, 0, 3]], np.int32)
    borders = Borders(labels)
    assert borders.shares[1][2] == 2 and borders.shares[1][3] == 1
    assert borders.shares[2][1] == 2
    assert borders.around(1) == {1, 2, 3}
    borders.merge(3, 2)
    assert borders.area == [2, 4, 3, 0]
    assert borders.perimeter == [0, *(sum(borders.shares[k].values()) for k in (1, 2, 3))]
    assert 3 not in borders.shares[1] and borders.shares[1][2] == 3


def slow_merging(labels: np.ndarray, resolution: float, merge_area: float) -> np.ndarray:
    """Every merge starts again from the smallest piece."""
    borders = Borders(labels)
    merged = labels.copy()
    while True:
        alive = sorted((area, piece) for piece, area in enumerate(borders.area) if piece > 0 and area > 0)
        targets = (
            (piece, _target(borders, piece, area * resolution**2, merge_area)) for area, piece in alive
        )
        piece, target = next((pair for pair in targets if pair[1] > 0), (0, 0))
        if target == 0:
            return merged
        borders.merge(piece, target)
        merged[merged == piece] = target


@settings(max_examples=60, deadline=None)
@given(hnp.arrays(np.int32, (12, 13), elements=st.integers(0, 6)), st.sampled_from([0.05, 0.3, 1.0]))
def test_pieces_merge_as_if_every_merge_started_again(labels: np.ndarray, resolution: float) -> None:
    wide = np.ascontiguousarray(np.repeat(np.repeat(labels, 3, axis=0), 3, axis=1))
    assert (merge_by_borders(wide, resolution, merge_area=12.5) == slow_merging(wide, resolution, 12.5)).all()


@settings(max_examples=40, deadline=None)
@given(hnp.arrays(np.int32, (10, 11), elements=st.integers(0, 3)))
def test_borders_are_counted_as_in_the_slow_way(labels: np.ndarray) -> None:
    borders = Borders(labels)
    padded = np.pad(labels, 1)
    inside = np.pad(np.ones(labels.shape, bool), 1)  # what lies beyond the map is nobody's border
    for label in range(1, labels.max(initial=0) + 1):
        near = np.zeros(padded.shape, bool)
        for r, c in np.argwhere(padded == label):
            near[r - 1 : r + 2, c - 1 : c + 2] = True
        counts = np.bincount(padded[near & inside & (padded != label)])
        assert borders.shares[label] == {k: n for k, n in enumerate(counts.tolist()) if n > 0}


@settings(max_examples=40, deadline=None)
@given(hnp.arrays(np.bool_, (34, 41), elements=st.sampled_from([True, True, True, False])))
def test_the_voronoi_graph_has_the_edges_of_the_diagram(free: np.ndarray) -> None:
    sites = contour_cells(free)
    if len(sites) < 3 or np.linalg.matrix_rank(sites - sites[0]) < 2:  # on one line: no edge is finite
        assert len(voronoi_edges(sites, free.shape)) == 0
        return
    diagram = Voronoi(sites.astype(float))
    pairs = np.array([pair for pair in diagram.ridge_vertices if min(pair) >= 0], np.int64).reshape(-1, 2)
    ends = diagram.vertices[np.unique(pairs)].round(4)
    inside = ends[(ends >= 0).all(axis=1) & (ends < free.shape).all(axis=1)]
    edges = voronoi_edges(sites, free.shape).reshape(-1, 2)
    assert {tuple(end) for end in inside.tolist()} <= {tuple(end) for end in edges.round(4).tolist()}


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_basis_points_are_the_nearest_cells(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(20, 90, 2).tolist())
    walls = np.argwhere(rng.random(shape) < 0.01).astype(np.int32)
    points = np.stack([rng.integers(0, n, 12) for n in shape], axis=1).astype(np.int32)
    distance = rng.integers(1, 12, shape).astype(np.uint8)
    lines = critical_lines(points, walls, distance, 0.0)
    expected = []
    for point in points:
        far = ((walls - point) ** 2).sum(axis=1)
        if not len(far):
            continue
        first = walls[far.argmin()]
        apart = ((walls - first) ** 2).sum(axis=1) > int(distance[tuple(point)]) ** 2
        if apart.any():
            expected.append([point, first, walls[apart][far[apart].argmin()]])
    assert lines.tolist() == np.array(expected, np.int32).reshape(-1, 3, 2).tolist()


def test_of_close_critical_points_the_widest_angle_stays() -> None:
    walls = np.array([(28, 37), *((r, c) for r in (10, 30) for c in range(60))], np.int32)
    points = np.array([(20, 30), (21, 33), (20, 50)], np.int32)
    distance = np.full((41, 60), 10, np.uint8)
    kept = critical_lines(points, walls, distance, 0.5)
    assert [row[0].tolist() for row in kept] == [[20, 30], [20, 50]]
    assert kept[0, 1].tolist() == [10, 30] and kept[0, 2].tolist() == [30, 30]
