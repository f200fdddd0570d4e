"""Whether the walls of a map are ragged: drawn ones run straight for metres, recorded ones do not."""

from __future__ import annotations

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Cells, Ints
from layoutexplore.grids.bitsets import true_cells
from layoutexplore.layout.alignment import surfaces
from layoutexplore.layout.limits import cells_at_most

LONG_RUN = 1.0
"""A straight run of a wall's surface is long from this length on [m]."""

RAGGED = 0.22
"""Walls are ragged where less than this share of their surface lies in long runs."""


def straight_share(cells: Cells, resolution: float) -> float:
    """The share of the surface of the obstacles that lies in long runs along rows or columns; 1 without any.

    Args:
        cells: int8 (rows, cols), trinary, turned to its walls.
        resolution: Metres a cell.
    """
    surface = true_cells(surfaces(cells))
    length = cells_at_most(LONG_RUN, resolution, max(cells.shape) + 1)
    return _in_runs(surface, cells.shape[1], length) / len(surface) if len(surface) else 1.0


def is_ragged(cells: Cells, resolution: float) -> bool:
    """Whether the walls of a map, turned to them, are ragged."""
    return straight_share(cells, resolution) < RAGGED


@njit(cache=True, nogil=True)
def _in_runs(cells: Ints, cols: int, length: int) -> int:
    """How many cells lie in a run of at least `length` of them along their row or column.

    `cells` (n,) are flat indices, rising, of a grid of so many columns.
    """
    long = np.zeros(len(cells), np.bool_)
    # of each column its last cell so far; of each cell the one before it in its column's run, -1 for none,
    # and how many the run has up to it
    last, below = np.full(cols, -1, np.int64), np.full(len(cells), -1, np.int64)
    height = np.ones(len(cells), np.int64)
    first = 0
    for k in range(len(cells)):
        c = cells[k] % cols
        # a run ends before a cell that does not follow, and before one of the next row
        if c == 0 or (k > 0 and cells[k] != cells[k - 1] + 1):
            if k - first >= length:
                long[first:k] = True
            first = k
        before = last[c]
        if before >= 0 and cells[before] == cells[k] - cols:
            below[k], height[k] = before, height[before] + 1
        last[c] = k
    if len(cells) - first >= length:
        long[first:] = True
    # from its upper end on, all of a long run is
    tall = height >= length
    for k in range(len(cells) - 1, -1, -1):
        if tall[k]:
            long[k] = True
            if below[k] >= 0:
                tall[below[k]] = True
    return int(long.sum())
