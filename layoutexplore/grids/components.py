"""The connected parts of a mask, found by its runs: cells are looked at eight at once, and only what touches is joined."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

_ALL_SET = np.uint64(0x0101010101010101)
"""Eight cells of the mask, side by side in one word."""


def label_components(mask: NDArray[np.bool_]) -> tuple[NDArray[np.int32], int]:
    """Label the 4-connected parts of a mask, as `cv2.connectedComponents` does.

    Args:
        mask: bool (rows, cols).

    Returns:
        int32 (rows, cols), the part of each cell, numbered from 1 by the first cell, row by row, and 0
        outside of the mask; and the number of parts.

    Example:
        >>> labels, count = label_components(np.array([[1, 0, 1], [1, 0, 1], [0, 1, 1]], bool))
        >>> labels.tolist(), count
        ([[1, 0, 2], [1, 0, 2], [0, 2, 2]], 2)
    """
    labels, count = _label(np.ascontiguousarray(mask, np.bool_).view(np.uint8))
    return labels, int(count)


@njit(cache=True, nogil=True)
def _label(mask: NDArray[np.uint8]) -> tuple[NDArray[np.int32], int]:
    rows, cols = mask.shape
    runs = np.empty((rows * (cols // 2 + 1), 3), np.int32)
    parent = np.empty(len(runs), np.int32)
    row = np.zeros((cols // 8 + 1) * 8, np.uint8)  # Ends with a cell that is not set.
    words = row.view(np.uint64)
    count, above, behind = 0, 0, 0
    for r in range(rows):
        for c in range(cols):
            row[c] = mask[r, c]
        begin, first = count, _next_set(row, words, 0)
        while first < cols:
            last = _next_bare(row, words, first)
            runs[count, 0], runs[count, 1], runs[count, 2] = r, first, last
            parent[count] = count
            while above < behind and runs[above, 2] <= first:
                above += 1
            k = above
            while k < behind and runs[k, 1] < last:
                join(parent, k, count)
                k += 1
            count += 1
            first = _next_set(row, words, last)
        above, behind = begin, count
    number = number_sets(parent[:count])
    labels = np.zeros((rows, cols), np.int32)
    for k in range(count):
        labels[runs[k, 0], runs[k, 1] : runs[k, 2]] = np.int32(number[k] + 1)
    return labels, number.max() + 1 if count else 0


@njit(cache=True, nogil=True)
def _next_set(row: NDArray[np.uint8], words: NDArray[np.uint64], c: int) -> int:
    """First column from `c` on that is set; the row's length if there is none."""
    while c < row.size and row[c] == 0:
        c += 1
        if c & 7 == 0:
            while c < row.size and words[c >> 3] == 0:
                c += 8
    return min(c, row.size)


@njit(cache=True, nogil=True)
def _next_bare(row: NDArray[np.uint8], words: NDArray[np.uint64], c: int) -> int:
    """First column from `c` on that is not set; there is one."""
    while row[c]:
        c += 1
        if c & 7 == 0:
            while words[c >> 3] == _ALL_SET:
                c += 8
    return c


@njit(cache=True, nogil=True)
def root_of(parent: NDArray[np.signedinteger[Any]], i: int) -> int:
    """The member that stands for the set of `i`; the way there is halved. `parent` int32 or int64 (n,)."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@njit(cache=True, nogil=True)
def join(parent: NDArray[np.int32], i: int, j: int) -> None:
    """Make one set of those of `i` and `j`."""
    a, b = root_of(parent, i), root_of(parent, j)
    parent[max(a, b)] = min(a, b)


@njit(cache=True, nogil=True)
def number_sets(parent: NDArray[np.int32]) -> NDArray[np.int64]:
    """The set of each member, numbered from 0 by first member, when all were made by `join`."""
    number = np.empty(len(parent), np.int64)
    n = 0
    for k in range(len(parent)):
        root = root_of(parent, k)
        if root == k:  # no member comes before it
            number[k] = n
            n += 1
        else:
            number[k] = number[root]
    return number


@njit(cache=True, nogil=True)
def _components(first: NDArray[np.int64], second: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    parent = np.arange(count).astype(np.int32)
    for k in range(len(first)):
        join(parent, first[k], second[k])
    return number_sets(parent)


def components(first: NDArray[np.int64], second: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Connected components int64 (count,) of an undirected graph, numbered by their first member.

    Args:
        first: int64 (m,), one end of each edge.
        second: int64 (m,), its other end.
        count: Number of members.

    Example:
        >>> components(np.array([3, 1]), np.array([0, 2]), 5).tolist()
        [0, 1, 1, 0, 2]
    """
    return np.asarray(
        _components(np.ascontiguousarray(first, np.int64), np.ascontiguousarray(second, np.int64), count)
    )
