"""The Hough transform finds the very segments that OpenCV's does."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.layout.lines.hough import hough_segments
from tests.layout.lines.cases import seeds


def _expected(image, votes, length, gap):
    found = cv2.HoughLinesP(image, 1, np.pi / 180, votes, minLineLength=length, maxLineGap=gap)
    return [] if found is None else found.reshape(-1, 4).tolist()


def _lines(rng, rows, cols, count):
    """An image with lines in random directions, and some noise."""
    image = (rng.random((rows, cols)) < rng.choice([0.0, 0.01, 0.2])).astype(np.uint8)
    ends = rng.integers(0, (cols, rows, cols, rows), (count, 4)).tolist()
    for x0, y0, x1, y1 in ends:
        cv2.line(image, (x0, y0), (x1, y1), 1)
    return image


@given(
    seeds, st.integers(1, 90), st.integers(1, 90), st.integers(1, 25), st.integers(0, 15), st.integers(0, 3)
)
@settings(deadline=None)
def test_segments_are_those_of_opencv(seed, rows, cols, votes, length, gap):
    rng = np.random.default_rng(seed)
    image = _lines(rng, rows, cols, int(rng.integers(0, 9)))
    assert hough_segments(image, votes, length, gap).tolist() == _expected(image, votes, length, gap)


@pytest.mark.parametrize("shape", [(1500, 1700), (3, 4000), (4000, 3)])
def test_segments_of_large_images_are_those_of_opencv(shape):
    # far from the corner the least difference of an angle is a whole cell
    image = _lines(np.random.default_rng(7), *shape, 200)
    image.flags.writeable = False
    found = hough_segments(image, 25, 5, 0)
    assert len(found) >= 3
    assert found.tolist() == _expected(image, 25, 5, 0)


def test_an_empty_image_has_no_segments():
    assert hough_segments(np.zeros((5, 7), np.uint8), 2, 0, 0).shape == (0, 4)
