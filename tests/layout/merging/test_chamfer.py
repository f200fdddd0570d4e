"""Chamfer distances, against cell by cell sums and against OpenCV."""

from __future__ import annotations

import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.grids.runs import find_runs
from layoutexplore.layout.merging.chamfer import BORDER, edge_distances, run_distances

STEPS = [(-2, -1), (-2, 1), (-1, -2), (-1, -1), (-1, 0), (-1, 1), (-1, 2)]
LENGTHS = {1: np.float32(1.0), 2: np.float32(1.4), 5: np.float32(2.1969)}
"""Of steps by the squares of their lengths."""


def _slow_distances(is_open):
    """Cell by cell, in the order of the sums that the kernel promises."""
    rows, cols = is_open.shape
    far = np.zeros((rows + 4, cols + 4), np.float32)

    def from_rows(r, c, sign):
        return min(far[r + sign * y + 2, c + sign * x + 2] + LENGTHS[y * y + x * x] for y, x in STEPS)

    for r in range(rows):
        c = 0
        while c < cols:
            block = is_open[r, c : c + 4]
            if c % 4 == 3 and c + 4 <= cols - 1 and block.all():
                before = far[r + 2, c + 1]
                for k in range(4):
                    far[r + 2, c + k + 2] = min(from_rows(r, c + k, 1), before + np.float32(k + 1))
                c += 4
                continue
            if is_open[r, c]:
                far[r + 2, c + 2] = min(from_rows(r, c, 1), far[r + 2, c + 1] + np.float32(1))
            c += 1
    for r in range(rows - 1, -1, -1):
        for c in range(cols - 1, -1, -1):
            if is_open[r, c]:
                ahead = far[r + 2, c + 3] + np.float32(1)
                far[r + 2, c + 2] = min(far[r + 2, c + 2], from_rows(r, c, -1), ahead)
    return far


def _random_mask(seed, rows, cols):
    rng = np.random.default_rng(seed)
    return rng.random((rows, cols)) > rng.choice([0.0, 0.0005, 0.01, 0.2, 0.8])


@given(st.integers(0, 2**32 - 1), st.integers(1, 60), st.integers(1, 90))
@settings(max_examples=30, deadline=None)
def test_distances_are_the_slow_ones(seed, rows, cols):
    mask = _random_mask(seed, rows, cols)
    runs = find_runs(mask.view(np.uint8), np.uint8(0))
    np.testing.assert_array_equal(run_distances(runs, rows, cols), _slow_distances(mask))


@given(st.integers(0, 2**32 - 1), st.integers(1, 200), st.integers(1, 200))
@settings(deadline=None)
def test_distances_are_those_of_opencv(seed, rows, cols):
    mask = _random_mask(seed, rows, cols)
    padded = np.pad(mask, 1).view(np.uint8)
    expected = cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_5)[1:-1, 1:-1]
    # without Intel's library its sums are of whole numbers: steps of 1 / 65536 cell
    np.testing.assert_allclose(edge_distances(mask), expected - 0.5, atol=2e-3)


def test_a_border_of_closed_cells_lies_around_the_distances():
    runs = np.array([[0, 0, 3]], np.int32)
    far = run_distances(runs, 1, 3)
    assert far.shape == (1 + 2 * BORDER, 3 + 2 * BORDER)
    assert far[BORDER, BORDER:-BORDER].tolist() == [1.0, 1.0, 1.0]
    assert np.count_nonzero(far) == 3
