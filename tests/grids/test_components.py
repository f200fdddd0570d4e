"""Connected parts of masks against OpenCV's."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import scipy.ndimage
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from layoutexplore.grids.components import components, label_components, split_labels


def check(mask: NDArray[np.bool_]) -> None:
    labels, count = label_components(mask)
    expected, wanted = cv2.connectedComponents(mask.astype(np.uint8), connectivity=4, ltype=cv2.CV_32S)
    assert labels.dtype == np.int32 and count == expected - 1
    np.testing.assert_array_equal(labels, wanted)


@settings(deadline=None)
@given(st.integers(1, 40), st.integers(1, 70), st.floats(0.0, 1.0), st.integers(0, 2**32 - 1))
def test_random_masks(rows: int, cols: int, density: float, seed: int) -> None:
    check(np.random.default_rng(seed).random((rows, cols)) < density)


@settings(deadline=None)
@given(st.integers(1, 12), st.integers(1, 12), st.integers(1, 20), st.integers(0, 2**32 - 1))
def test_masks_of_long_runs(rows: int, cols: int, size: int, seed: int) -> None:
    """Whole words of set and bare cells, at any place in a row, also of a turned or cut array."""
    coarse = np.random.default_rng(seed).random((rows, cols)) < 0.6
    mask = np.kron(coarse, np.ones((2, size), np.bool_))
    for shown in (mask, mask.T, mask[::-1], mask[:, 1:-1] if cols * size > 2 else mask):
        check(shown)


@pytest.mark.parametrize("shape", [(0, 0), (0, 5), (5, 0)])
def test_nothing(shape: tuple[int, int]) -> None:
    labels, count = label_components(np.zeros(shape, np.bool_))
    assert labels.shape == shape and count == 0


def test_a_spiral_is_one_part() -> None:
    """Runs that only meet at last are joined."""
    rows = [
        "#########",
        "#.......#",
        "#.#####.#",
        "#.#...#.#",
        "#.#.#.#.#",
        "#.#.###.#",
        "#.#.....#",
        "#.#######",
    ]
    mask = np.array([[c == "#" for c in row] for row in rows])
    assert label_components(mask)[1] == 1 and label_components(~mask)[1] == 1
    check(mask)
    check(~mask)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_split_labels_match_scipy(seed: int) -> None:
    labels = np.random.default_rng(seed).integers(-1, 3, (13, 17)).astype(np.int32)
    parts, sizes = split_labels(labels)
    count = 0
    for value in range(3):
        expected, n = scipy.ndimage.label(labels == value)
        count += n
        for k in range(1, n + 1):
            (found,) = np.unique(parts[expected == k])
            assert sizes[found] == (expected == k).sum()
    assert count == len(sizes)
    assert (parts[labels < 0] == -1).all()
    firsts = np.unique(parts[labels >= 0], return_index=True)[1]
    assert (np.diff(firsts) > 0).all()


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 30), st.integers(0, 40), st.integers(0, 10**6))
def test_components_are_numbered_by_their_first_member(count: int, edges: int, seed: int) -> None:
    first, second = np.random.default_rng(seed).integers(0, count, (2, edges))
    found = components(first, second, count)
    _, slow = connected_components(
        coo_array((np.ones(edges), (first, second)), (count, count)), directed=False
    )
    firsts = [slow.tolist().index(s) for s in slow]
    assert found.tolist() == [sorted(set(firsts)).index(f) for f in firsts]


def test_parts_are_numbered_after_those_that_are_there() -> None:
    rng = np.random.default_rng(2)
    first, second = rng.random((2, 20, 30)) < 0.5
    labels, count = label_components(first)
    rest = second & ~first
    parts, more = label_components(rest)
    expected = np.where(rest, parts + count, labels)
    same, found = label_components(rest, labels, count)
    assert same is labels and found == more
    np.testing.assert_array_equal(labels, expected)
