"""Connected components: of masks and labels by their runs, of graphs by disjoint sets."""

from __future__ import annotations

from typing import Any, overload

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.arrays import Bytes, Ints, Ints32, Labels, Mask
from layoutexplore.grids.runs import find_runs


@overload
def label_components(mask: Mask) -> tuple[Ints32, int]: ...


@overload
def label_components(mask: Mask, out: Ints32, after: int = 0) -> tuple[Ints32, int]: ...


@overload
def label_components(mask: Mask, out: Labels, after: int = 0) -> tuple[Labels, int]: ...


def label_components(mask: Mask, out: Labels | None = None, after: int = 0) -> tuple[Labels, int]:
    """Label the 4-connected parts of a mask, as `cv2.connectedComponents` does.

    Args:
        mask: bool (rows, cols).
        out: int16 or int32 (rows, cols), C-contiguous, where the labels are written; new memory when None.
            Numbers that it cannot hold come out as others.
        after: The number after which those of the parts begin. Above 0, `out` keeps what it holds outside of
            the mask.

    Returns:
        `out`, or int32 (rows, cols): the part of each cell, numbered from `after` + 1 by the first cell, row
        by row, and 0 outside of the mask; and the number of parts.

    Example:
        >>> labels, count = label_components(np.array([[1, 0, 1], [1, 0, 1], [0, 1, 1]], bool))
        >>> labels.tolist(), count
        ([[1, 0, 2], [1, 0, 2], [0, 2, 2]], 2)
    """
    labels = np.zeros(mask.shape, np.int32) if out is None else out
    if not after:
        labels[:] = 0
    return labels, int(_label(np.ascontiguousarray(mask, np.bool_).view(np.uint8), labels, after))


def split_labels(labels: Ints32) -> tuple[Ints32, Ints]:
    """Split the cells of each label into their 4-connected parts.

    Args:
        labels: int32 (rows, cols), -1 for none.

    Returns:
        int32 (rows, cols), the part of each cell, numbered from 0 by the first cell, row by row, and -1 where
        there is no label; and the parts' sizes int64 (n,) in cells.

    Example:
        >>> parts, sizes = split_labels(np.array([[5, 5, -1], [3, 5, 3]], np.int32))
        >>> parts.tolist(), sizes.tolist()
        ([[0, 0, -1], [1, 0, 2]], [3, 1, 1])
    """
    return _split(np.ascontiguousarray(labels, np.int32))


@njit(cache=True, nogil=True)
def root_of(parent: Ints32, i: int) -> int:
    """The member that stands for the set of `i`; the way there is halved. `parent` int32 (n,)."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@njit(cache=True, nogil=True)
def join(parent: Ints32, i: int, j: int) -> None:
    """Make one set of those of `i` and `j`."""
    a, b = root_of(parent, i), root_of(parent, j)
    parent[max(a, b)] = min(a, b)


@njit(cache=True, nogil=True)
def number_sets(parent: Ints32) -> Ints:
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
def join_runs(runs: Ints32, cells: NDArray[Any], aside: int) -> Ints:
    """The connected part int64 (n,) of each run, numbered from 0 by first run.

    Runs join those of equal cells in the row before.

    Args:
        runs: int32 (n, 3), as `find_runs` finds them.
        cells: The (rows, cols) they were found in.
        aside: 0 where they must share a column, 1 where it is enough that they touch at a corner.
    """
    parent = np.empty(len(runs), np.int32)
    # Runs `begin` <= k are of this row, `below` <= j < end of the row before, as far as they can still touch.
    row, begin, below, end = -1, 0, 0, 0
    for k in range(len(runs)):
        parent[k] = k
        r, first, last = runs[k]
        if r != row:
            below, end = (begin if r == row + 1 else k), k
            begin, row = k, r
        # Runs of a row lie side by side: what ends before this one touches none of those that follow either.
        while below < end and runs[below, 2] + aside <= first:
            below += 1
        j = below
        while j < end and runs[j, 1] < last + aside:
            if cells[r - 1, runs[j, 1]] == cells[r, first]:
                join(parent, j, k)
            j += 1  # `below` stays: the last of these may touch the next run of this row as well.
    return number_sets(parent)


@njit(cache=True, nogil=True)
def _label(mask: Bytes, labels: Labels, after: int) -> int:
    """Write the labels of the mask's cells; how many there are."""
    runs = find_runs(mask, np.uint8(0))
    number = join_runs(runs, mask, 0)
    for k in range(len(runs)):
        labels[runs[k, 0], runs[k, 1] : runs[k, 2]] = np.int32(after + number[k] + 1)
    return number.max() + 1 if len(runs) else 0


@njit(cache=True, nogil=True)
def _split(labels: Ints32) -> tuple[Ints32, Ints]:
    runs = find_runs(labels, np.int32(-1))
    number = join_runs(runs, labels, 0)
    parts = np.full(labels.shape, -1, np.int32)
    sizes = np.zeros(number.max() + 1 if len(runs) else 0, np.int64)
    for k in range(len(runs)):
        parts[runs[k, 0], runs[k, 1] : runs[k, 2]] = np.int32(number[k])
        sizes[number[k]] += runs[k, 2] - runs[k, 1]
    return parts, sizes


@njit(cache=True, nogil=True)
def _components(first: Ints, second: Ints, count: int) -> Ints:
    parent = np.arange(count).astype(np.int32)
    for k in range(len(first)):
        join(parent, first[k], second[k])
    return number_sets(parent)


def components(first: Ints, second: Ints, count: int) -> Ints:
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
