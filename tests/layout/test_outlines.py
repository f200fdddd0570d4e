"""Outlines of labels, and the numbers of rooms."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from layoutexplore.layout.outlines import label_polygons, number_rooms


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


def test_a_part_within_a_hole_of_its_label_keeps_its_own_hole() -> None:
    labels = np.ones((15, 15), np.int32)
    labels[2:13, 2:13] = 0
    labels[4:11, 4:11] = 1
    labels[6:9, 6:9] = 2
    shapes = label_polygons(labels)
    assert shapes[1].is_valid and shapes[1].area == 15**2 - 11**2
    assert shapes[2].area == 9
