"""Outlines of labels, and the numbers of rooms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from layoutexplore.errors import MapError
from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.layout.outlines import label_polygons, number_rooms, rooms_of_labels


@settings(max_examples=80, deadline=None)
@given(hnp.arrays(np.int32, (8, 9), elements=st.integers(0, 3)))
def test_outlines_cover_the_largest_part_of_each_label(labels: np.ndarray) -> None:
    import cv2

    labels.flags.writeable = False
    shapes = label_polygons(labels)
    assert sorted(shapes) == sorted(set(labels.ravel().tolist()) - {0})
    for label, shape in shapes.items():
        count, parts = cv2.connectedComponents((labels == label).astype(np.uint8), connectivity=4)
        largest = max(int((parts == k).sum()) for k in range(1, count))
        assert shape.is_valid and shape.area == largest


def test_rooms_are_numbered_in_raster_order() -> None:
    assert number_rooms(np.array([[0, 7, 7], [3, 0, 9]], np.int32)).tolist() == [[0, 1, 1], [2, 0, 3]]


def test_a_part_within_a_hole_of_its_label_keeps_its_own_hole() -> None:
    labels = np.ones((15, 15), np.int32)
    labels[2:13, 2:13] = 0
    labels[4:11, 4:11] = 1
    labels[6:9, 6:9] = 2
    shapes = label_polygons(labels)
    assert shapes[1].is_valid and shapes[1].area == 15**2 - 11**2
    assert shapes[2].area == 9


def test_labels_that_have_no_footprint_are_no_rooms() -> None:
    grid = OccupancyGrid(np.zeros((40, 50), np.int8), resolution=1.0)
    labels = np.arange(2000, dtype=np.int32).reshape(40, 50)
    footprint = np.where(labels == 3, labels, 0)
    assert [room.id for room in rooms_of_labels(labels, grid, footprint)] == [3]
    assert rooms_of_labels(labels, grid, np.zeros_like(labels)) == ()
    with pytest.raises(MapError, match="number the rooms"):
        rooms_of_labels(-labels, grid, footprint)
