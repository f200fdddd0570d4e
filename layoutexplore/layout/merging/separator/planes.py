"""What the separator network sees of a map: shares of what the cells of each square are, in a fixed scale."""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.arrays import Cells, Floats32, Ints32, Mask
from layoutexplore.grids.grid import FREE, OCCUPIED

T = TypeVar("T", bound=np.generic)

FINE = 0.1
"""Side of the finest squares that the network sees [m]."""

SQUARE = 0.2
"""Side of the squares that it judges [m]."""

PATCH, DEPTH = 4, 8
"""Fine squares along a side of what the network takes as one place, and places along the side of what its
coarsest layer takes as one: maps are padded to whole ones of these."""

KINDS = 4
"""What is told apart: free space, walls, other obstacles, door gaps."""


def fine_index(size: int, resolution: float) -> Ints32:
    """int32 (size,): the row or column of fine squares that holds the middle of each one of cells."""
    return np.asarray(np.floor((np.arange(size) + 0.5) * (resolution / FINE)), np.int32)


def square_middles(squares: int, resolution: float) -> Ints32:
    """int32 (squares,): the row or column of cells at the middle of each of squares, beyond the map too."""
    return np.asarray(np.floor((np.arange(squares) + 0.5) * (SQUARE / resolution)), np.int32)


def network_input(cells: Cells, wall: Mask, gap: Ints32, resolution: float) -> Floats32:
    """float32 (places, places, PATCH * PATCH * KINDS), rows before columns before kinds; 0 beyond the map.

    Args:
        cells: int8 (rows, cols), trinary, turned to its walls.
        wall: bool (rows, cols), occupied cells that are walls.
        gap: int32 (rows, cols), not 0 for the cells of door gaps.
        resolution: Metres a cell.
    """
    if resolution > FINE:
        # cells larger than the squares: each becomes several, so that no square is without one
        times = math.ceil(resolution / FINE)
        cells, wall, gap = _enlarged(cells, times), _enlarged(wall, times), _enlarged(gap, times)
        resolution /= times
    index = [fine_index(size, resolution) for size in cells.shape]
    whole = PATCH * DEPTH
    rows, cols = (-(-(int(i[-1]) + 1) // whole) * whole for i in index)
    shares = _shares(cells, wall, gap, index[0], index[1], rows, cols)
    parts = shares.reshape(rows // PATCH, PATCH, cols // PATCH, PATCH, KINDS)
    return np.ascontiguousarray(parts.transpose(0, 2, 1, 3, 4)).reshape(rows // PATCH, cols // PATCH, -1)


def _enlarged(values: NDArray[T], times: int) -> NDArray[T]:
    return np.repeat(np.repeat(values, times, axis=0), times, axis=1)


@njit(cache=True, nogil=True)
def _shares(
    cells: Cells, wall: Mask, gap: Ints32, row_index: Ints32, col_index: Ints32, rows: int, cols: int
) -> Floats32:
    """float32 (rows, cols, KINDS): what share of the cells of each fine square is of each kind."""
    out = np.zeros((rows, cols, KINDS), np.float32)
    in_row, in_col = np.zeros(rows, np.int64), np.zeros(cols, np.int64)
    # a cell belongs to the fine square that its middle lies in: of some there are more than of others
    for r in row_index:
        in_row[r] += 1
    for c in col_index:
        in_col[c] += 1
    for r in range(cells.shape[0]):
        line = out[row_index[r]]
        for c in range(cells.shape[1]):
            kind = cells[r, c]
            if kind == FREE:
                line[col_index[c], 0] += 1
            elif kind == OCCUPIED:
                line[col_index[c], 1 if wall[r, c] else 2] += 1
            if gap[r, c] > 0:
                line[col_index[c], 3] += 1
    for r in range(rows):
        for c in range(cols):
            # beyond the map there are none, and the shares stay 0
            if in_row[r] * in_col[c] > 1:
                out[r, c] /= in_row[r] * in_col[c]
    return out
