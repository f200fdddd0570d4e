"""The box around what is known of a grid."""

from __future__ import annotations

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Cells, Ints32, Mask
from layoutexplore.grids.grid import UNKNOWN


def known_box(cells: Cells, margin: int = 0) -> tuple[int, int, int, int]:
    """Half-open box (row0, row1, col0, col1) of the known cells and a margin; all 0 when none is known.

    Args:
        cells: int8 (rows, cols), -1 unknown.
        margin: In cells.

    Example:
        >>> known_box(np.array([[-1, -1, -1], [-1, 0, 100], [-1, -1, -1]], np.int8))
        (1, 2, 1, 3)
    """
    # Of a read-only array the kernel would be compiled once more.
    box = _box_without(np.require(cells, np.int8, ("C", "W")), np.int8(UNKNOWN))
    return grown_box(box, margin, cells.shape) if box[1] else box


def true_box(mask: Mask) -> tuple[int, int, int, int]:
    """Half-open box (row0, row1, col0, col1) of the true cells; all 0 when none is.

    Args:
        mask: bool (rows, cols).

    Example:
        >>> true_box(np.array([[False, False, False], [False, True, True]]))
        (1, 2, 1, 3)
    """
    return _box_without(np.require(mask, requirements=("C", "W")).view(np.int8), np.int8(0))


def window(mask: Mask, margin: int = 0) -> tuple[slice, slice]:
    """The rows and columns of the true cells and a margin; all of them where no cell is true.

    Args:
        mask: bool (rows, cols).
        margin: In cells.

    Example:
        >>> window(np.array([[False, False, False], [False, True, True]]))
        (slice(1, 2, None), slice(1, 3, None))
    """
    row0, row1, col0, col1 = (
        grown_box(true_box(mask), margin, mask.shape) if mask.any() else (0, None, 0, None)
    )
    return slice(row0, row1), slice(col0, col1)


@njit(cache=True, nogil=True)
def _box_without(cells: Cells, value: np.int8) -> tuple[int, int, int, int]:
    """The box of the cells that have not this value."""
    rows, cols = cells.shape
    row0, row1 = rows, 0
    seen = np.zeros(cols, np.bool_)  # columns with such a cell
    for r in range(rows):
        found = False
        for c in range(cols):
            found |= cells[r, c] != value
        if found:
            row0, row1 = min(row0, r), r + 1
            for c in range(cols):
                seen[c] |= cells[r, c] != value
    at = np.flatnonzero(seen)
    return (row0, row1, at[0], at[-1] + 1) if len(at) else (0, 0, 0, 0)


@njit(cache=True, nogil=True)
def box_around(members: Ints32) -> tuple[int, int, int, int]:
    """Half-open box (row0, row1, col0, col1) of cells int32 (n, 2), at least one."""
    # In kernels instead of `min` and `max` of a column, which take a second each to compile.
    row0 = row1 = int(members[0, 0])
    col0 = col1 = int(members[0, 1])
    for n in range(1, len(members)):
        row0, row1 = min(row0, members[n, 0]), max(row1, members[n, 0])
        col0, col1 = min(col0, members[n, 1]), max(col1, members[n, 1])
    return row0, row1 + 1, col0, col1 + 1


Box = tuple[int, int, int, int]
"""(row0, row1, col0, col1), half open; empty where row0 >= row1."""


def union(a: Box, b: Box) -> Box:
    """The smallest box around two; an empty one does not count.

    Example:
        >>> union((0, 0, 0, 0), (2, 3, 4, 5)), union((0, 1, 0, 1), (2, 3, 4, 5))
        ((2, 3, 4, 5), (0, 3, 0, 5))
    """
    if a[0] >= a[1]:
        return b
    if b[0] >= b[1]:
        return a
    return min(a[0], b[0]), max(a[1], b[1]), min(a[2], b[2]), max(a[3], b[3])


def box_size(box: Box) -> int:
    """Cells in a half-open box.

    Example:
        >>> box_size((2, 4, 4, 7)), box_size((3, 2, 4, 7))
        (6, 0)
    """
    return max(box[1] - box[0], 0) * max(box[3] - box[2], 0)


def grown_box(box: Box, margin: int, shape: tuple[int, ...]) -> Box:
    """A half-open box with a margin around it, inside of a grid of (rows, cols).

    Example:
        >>> grown_box((2, 3, 4, 5), 3, (10, 6))
        (0, 6, 1, 6)
    """
    row0, row1, col0, col1 = box
    rows, cols = shape
    return max(row0 - margin, 0), min(row1 + margin, rows), max(col0 - margin, 0), min(col1 + margin, cols)
