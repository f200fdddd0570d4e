"""How far walls enclose a region: on how many sides of its cells there is one, and how far out it lies."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Floats, Ints, Ints32, Mask
from layoutexplore.grids.bitsets import true_cells
from layoutexplore.grids.runs import find_runs
from layoutexplore.layout.limits import cells_at_most

SAMPLE = 0.1
"""Distance of the rows and columns whose cells are looked at [m]."""

FARTHEST = 5.0
"""What lies farther inside or outside the box of the walls than this lies so far [m]."""

OUTERMOST = 0.01
"""Share of the walls' cells that may lie outside their box, on each of its sides."""


class Enclosure(NamedTuple):
    """Of each region, means over its known free cells; 0 where none of them is looked at.

    Attributes:
        walled: float64 (k + 1,), share of the cells with walls to all four sides, however far.
        nearly: float64 (k + 1,), share with walls to at least three sides.
        outside: float64 (k + 1,), distance beyond the box of nearly all walls, below 0 inside it [m].
    """

    walled: Floats
    nearly: Floats
    outside: Floats


class WallExtents(NamedTuple):
    """Where the walls of each row and column begin and end, and the box of nearly all of them.

    A row without walls begins behind its last column and ends before its first one: nothing lies between.

    Attributes:
        left: int64 (rows,), first column of each row's walls.
        right: int64 (rows,), their last column.
        low: int64 (cols,), first row of each column's walls.
        high: int64 (cols,), their last row.
        box: int64 (4,), first and last row, first and last column.
    """

    left: Ints
    right: Ints
    low: Ints
    high: Ints
    box: Ints


@njit(cache=True, nogil=True)
def _extents(walls: Ints, rows: int, cols: int) -> tuple[Ints, Ints]:
    """First cell, last cell and number of the walls' cells: int64 (rows, 3) and (cols, 3)."""
    of_row, of_col = np.zeros((rows, 3), np.int64), np.zeros((cols, 3), np.int64)
    of_row[:, 0], of_row[:, 1] = cols, -1
    of_col[:, 0], of_col[:, 1] = rows, -1
    for i in walls:
        r, c = i // cols, i % cols
        of_row[r, 0], of_row[r, 1] = min(of_row[r, 0], c), max(of_row[r, 1], c)
        of_col[c, 0], of_col[c, 1] = min(of_col[c, 0], r), max(of_col[c, 1], r)
        of_row[r, 2] += 1
        of_col[c, 2] += 1
    return of_row, of_col


def wall_extents(wall: Mask) -> WallExtents:
    """The extents of the walls bool (rows, cols); without walls the box is that of the map."""
    rows, cols = wall.shape
    of_row, of_col = _extents(true_cells(wall), rows, cols)
    ends = []
    for counts in (of_row[:, 2], of_col[:, 2]):
        total = np.cumsum(counts)
        if total[-1] == 0:
            ends += [0, len(counts) - 1]
            continue
        least = OUTERMOST * total[-1]
        # the first line with more walls before it than may lie outside, and the last with more behind it
        ends += [
            int(np.searchsorted(total, least, side="right")),
            int(np.searchsorted(total, total[-1] - least)),
        ]
    left, right = (np.ascontiguousarray(of_row[:, k]) for k in (0, 1))
    low, high = (np.ascontiguousarray(of_col[:, k]) for k in (0, 1))
    return WallExtents(left, right, low, high, np.array(ends, np.int64))


@njit(cache=True, nogil=True)
def _add_up(labels: Ints32, free: Mask, part: Ints32, extents: WallExtents, step: int, sums: Floats) -> None:
    """Add up the cells of every `step`-th row and column by region, in `sums` (k + 1, 4), in cells.

    Column 0 counts them, 1 and 2 those with walls to four and to three sides, 3 is the distance outside.
    """
    row0, row1, col0, col1 = extents.box
    runs, begin = find_runs(labels, np.int32(0)), step // 2
    for k in range(len(runs)):
        r, first, last = runs[k]
        if r % step != begin:
            continue
        left, right = extents.left[r], extents.right[r]
        n, four, three, beyond = 0, 0, 0, 0
        for c in range(first + (begin - first) % step, last, step):
            if free[r, c]:
                # a free cell is no wall itself: strictly between means beside
                sides = int(c > left) + int(c < right) + int(r > extents.low[c]) + int(r < extents.high[c])
                n += 1
                four += sides == 4
                three += sides >= 3
                beyond += max(row0 - r, r - row1, col0 - c, c - col1)
        region = sums[part[labels[r, first]]]
        region[0] += n
        region[1] += four
        region[2] += three
        region[3] += beyond


def enclosure_of_regions(
    labels: Ints32, free: Mask, part: Ints32, wall: Mask, resolution: float
) -> Enclosure:
    """How far walls enclose each region.

    Args:
        labels: int32 (rows, cols), 0 for none.
        free: bool (rows, cols), known free cells.
        part: int32 (labels + 1,), region of each label, 0 for none.
        wall: bool (rows, cols), occupied cells that are no clutter.
        resolution: Metres a cell.
    """
    sums = np.zeros((int(part.max(initial=0)) + 1, 4))
    step = cells_at_most(SAMPLE, resolution, max(labels.shape))
    _add_up(labels, free, part, wall_extents(wall), step, sums)
    mean = sums[:, 1:] / np.maximum(sums[:, :1], 1.0)
    return Enclosure(mean[:, 0], mean[:, 1], np.clip(mean[:, 2] * resolution, -FARTHEST, FARTHEST))
