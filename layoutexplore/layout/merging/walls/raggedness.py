"""Whether the walls of a map are ragged: drawn ones run straight for metres, recorded ones do not."""

from __future__ import annotations

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Bytes, Cells, Mask
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
    surface = surfaces(cells)
    length = cells_at_most(LONG_RUN, resolution, max(cells.shape) + 1)
    count = int(np.count_nonzero(surface))
    return _in_runs(surface, length) / count if count else 1.0


def is_ragged(cells: Cells, resolution: float) -> bool:
    """Whether the walls of a map, turned to them, are ragged."""
    return straight_share(cells, resolution) < RAGGED


@njit("int64(boolean[:,::1], int64)", cache=True, nogil=True)
def _in_runs(mask: Mask, length: int) -> int:
    """How many cells lie in a run of at least `length` true cells along their row or column."""
    rows, cols = mask.shape
    found: Bytes = np.zeros((rows, cols), np.uint8)
    for r in range(rows):
        run = 0
        for c in range(cols + 1):
            # a run ends before the first cell that is not in it, the row's end included
            if c < cols and mask[r, c]:
                run += 1
                continue
            if run >= length:
                found[r, c - run : c] = 1
            run = 0
    # all columns at once, row by row: each keeps the length of its run so far
    runs = np.zeros(cols, np.int64)
    for r in range(rows + 1):
        for c in range(cols):
            if r < rows and mask[r, c]:
                runs[c] += 1
                continue
            if runs[c] >= length:
                found[r - runs[c] : r, c] = 1
            runs[c] = 0
    return int(found.sum())
