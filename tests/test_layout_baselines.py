"""The classic segmentations: small plans with a known answer, ties, hard inputs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from layoutexplore.grid import OccupancyGrid
from layoutexplore.layout.baselines_merging import Borders
from layoutexplore.layout.outlines import label_polygons, number_rooms
from layoutexplore.layout.pipeline import reconstruct
from layoutexplore.layout.wavefront import grow_labels

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
@given(hnp.arrays(np.int32, (9, 11), elements=st.sampled_from([0, 0, 0, 0, 0, 1, 2])), hnp.arrays(np.bool_, (9, 11)))
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
    assert borders.alive() == [3, 2, 1]
    borders.merge(3, 2)
    assert borders.area.tolist() == [2, 4, 3, 0]
    assert 3 not in borders.shares[1] and borders.shares[1][2] == 3
