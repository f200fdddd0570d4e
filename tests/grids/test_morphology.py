"""Masks that shrink and grow."""

from __future__ import annotations

import math

import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from layoutexplore.grids.morphology import (
    closed_by_box,
    dilate_by_disc,
    disc,
    disc_offsets,
    grow,
    inflate,
    opened_by_box,
)


@settings(deadline=None, max_examples=40)
@given(arrays(np.bool_, (9, 9)), arrays(np.bool_, (9, 9)), st.floats(0.5, 6.0))
def test_grow_is_a_bounded_geodesic(free: NDArray[np.bool_], seeds: NDArray[np.bool_], limit: float) -> None:
    distance = np.where(seeds & free, 0.0, np.inf)
    for _ in range(81):  # relax every step until nothing changes
        before = distance.copy()
        for r, c in np.argwhere(free):
            for dr, dc in ((0, 1), (1, 0), (1, 1), (1, -1), (0, -1), (-1, 0), (-1, -1), (-1, 1)):
                rr, cc = r + dr, c + dc
                if 0 <= rr < 9 and 0 <= cc < 9 and free[rr, cc] and free[r, cc] and free[rr, c]:
                    distance[rr, cc] = min(distance[rr, cc], distance[r, c] + math.hypot(dr, dc))
        if np.array_equal(before, distance):
            break
    clear = np.abs(distance - limit) > 1e-3
    assert np.array_equal(grow(seeds, free, limit)[clear], (distance <= limit)[clear])


@settings(max_examples=100, deadline=None)
@given(
    st.integers(0, 2**32),
    st.sampled_from([0.0, 0.1, 0.15, 0.2, 0.3, 0.35, 1.3]),
    st.sampled_from([0.05, 0.1]),
)
def test_inflation_is_by_centre_distance(seed: int, radius: float, resolution: float) -> None:
    occupied = np.random.default_rng(seed).random((15, 19)) < 0.04
    cells = np.argwhere(occupied)
    expected = occupied.copy()
    # In tenths of millimetres and squared, so that "exactly the radius" is exact.
    reach, side = round(radius * 10_000), round(resolution * 10_000)
    for cell in np.ndindex(occupied.shape):
        squared = ((cells - cell) ** 2).sum(axis=1) * side**2
        expected[cell] |= bool((squared < reach**2).any())
    assert np.array_equal(inflate(occupied, radius, resolution), expected)


def test_inflation_of_nothing() -> None:
    for radius in (0.0, 0.3, 5.0):
        assert not inflate(np.zeros((5, 5), bool), radius, 0.1).any()


def test_disc_offsets() -> None:
    assert len(disc_offsets(1.0)) == 1 and len(disc_offsets(1.5)) == 9 and len(disc_offsets(2.0)) == 9


@settings(deadline=None, max_examples=40)
@given(arrays(np.bool_, (30, 40), elements=st.sampled_from([False] * 300 + [True])), st.integers(1, 400))
def test_dilation_by_a_large_disc_is_that_by_its_cells(mask: NDArray[np.bool_], squared: int) -> None:
    radius = math.sqrt(squared)
    expected = cv2.dilate(mask.view(np.uint8), disc(radius, closed=True)) > 0
    assert np.array_equal(dilate_by_disc(mask, radius), expected)


masks = st.tuples(st.integers(1, 9), st.integers(1, 9)).flatmap(lambda shape: arrays(np.bool_, shape))


@settings(deadline=None, max_examples=100)
@given(masks, st.integers(1, 5), st.integers(1, 5))
def test_a_box_of_any_side_opens_and_closes_in_place(mask: NDArray[np.bool_], rows: int, cols: int) -> None:
    expected = np.zeros_like(mask)
    for row in range(-(rows // 2), mask.shape[0] - (rows - rows // 2) + 1):
        for col in range(-(cols // 2), mask.shape[1] - (cols - cols // 2) + 1):
            box = np.s_[max(row, 0) : row + rows, max(col, 0) : col + cols]
            expected[box] |= mask[box].all()
    assert np.array_equal(opened_by_box(mask, rows, cols), expected)
    assert np.array_equal(closed_by_box(~mask, rows, cols), ~expected)
