"""The known grid as a bit map, a byte a cell, with a margin of unknown cells.

The margin spares kernels the test for the border. It also keeps predictors from learning anything from where
the array ends: it is unknown like all the rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Bytes, Cells, Ints, Mask
from layoutexplore.grids.boxes import known_box
from layoutexplore.grids.grid import in_cells
from layoutexplore.layout.doorways import Gaps, Regions

FREE_BIT, WALL_BIT, UNKNOWN_BIT, DOOR_BIT = 1, 2, 4, 8
"""What a cell is known to be, and whether it lies in a gap that may be a door."""

ALONG_ROWS, ALONG_COLS = 16, 32
"""The cell is unknown and continues a wall that runs along its row, along its column."""

WALL_MIN, EXTENSION_REACH = 0.4, 10.0
"""Metres: walls from this length on are thought to go on, and how far."""

_BLOCK = 16
"""So many bytes of a row are passed over at once where no wall is, whatever a cell measures."""


@dataclass(frozen=True, eq=False)
class BitMap:
    """A grid with a margin.

    Attributes:
        code: uint8 (rows + 2 margin, cols + 2 margin), the bits of each cell.
        margin: Cells around the grid.
    """

    code: Bytes
    margin: int


def draw_bit_map(cells: Cells, regions: Regions, resolution: float, margin: float) -> BitMap:
    """Draw what is known.

    Args:
        cells: int8 (rows, cols), -1 unknown, 0 free, 100 occupied.
        regions: The seen rooms, for their doors.
        resolution: Metres per cell.
        margin: Metres around the grid.

    Example:
        >>> cells = np.full((3, 9), -1, np.int8)
        >>> cells[1, :3] = 100
        >>> regions = Regions(np.zeros((3, 9), np.int32), 0, np.zeros((3, 9), np.uint8), 0.2)
        >>> draw_bit_map(cells, regions, 0.2, 0.2).code[2].tolist()
        [20, 2, 2, 2, 20, 20, 20, 20, 20, 20, 20]
    """
    border = in_cells(margin, resolution)
    rows, cols = cells.shape
    code = np.full((rows + 2 * border, cols + 2 * border), UNKNOWN_BIT, np.uint8)
    row0, row1, col0, col1 = known_box(cells)
    box = np.array([row0, col0, row1, col1], np.int64)
    draw_cells(cells, regions.gaps, box, border, code)
    box += border
    _extend_walls(code, box, in_cells(WALL_MIN, resolution), round(EXTENSION_REACH / resolution))
    return BitMap(code, border)


def extended_walls(bit_map: BitMap) -> Mask:
    """The unknown cells of the grid, without the margin, that continue a wall."""
    inner = slice(bit_map.margin, -bit_map.margin)
    return np.asarray(bit_map.code[inner, inner] & (ALONG_ROWS | ALONG_COLS) > 0)


@njit(cache=True, nogil=True)
def draw_cells(cells: Cells, gaps: Gaps, box: Ints, margin: int, code: Bytes) -> None:
    """Write the bits that cells have by themselves, in a box int64 (4,): row0, col0, row1, col1."""
    low, high = box[1], box[3]
    for r in range(box[0], box[2]):
        values, widths = cells[r, low:high], gaps[r, low:high]
        bits = code[r + margin, low + margin : high + margin]
        for c in range(values.size):
            bits[c] = bits_of(values[c], widths[c])


@njit(cache=True, nogil=True, inline="always")
def bits_of(value: int, width: int) -> int:
    """The bits that a cell has by itself, of its value and the width of the gap that it lies in."""
    known = WALL_BIT if value == 100 else FREE_BIT
    return (UNKNOWN_BIT if value == -1 else known) | (DOOR_BIT if width > 0 else 0)


@njit(cache=True, nogil=True)
def _extend_walls(code: Bytes, box: Ints, shortest: int, reach: int) -> None:
    """Mark the unknown cells that continue a wall straight on, up to the next known cell."""
    first, last = box[1], min(box[3] + 1, code.shape[1])
    runs = np.zeros(code.shape[1], np.int64)
    above = np.zeros((last - first) // _BLOCK + 1, np.bool_)  # Blocks of the row before that hold some wall.
    for r in range(box[0], min(box[2] + 1, code.shape[0])):
        run, line = 0, code[r]
        for k in range(len(above)):
            begin, end = first + k * _BLOCK, min(first + (k + 1) * _BLOCK, last)
            bits = np.uint8(0)
            for c in range(begin, end):
                bits |= line[np.uint64(c)]
            if not (run or bits & WALL_BIT or above[k]):
                continue
            above[k] = bits & WALL_BIT > 0
            for c in range(begin, end):
                if code[r, c] & WALL_BIT:
                    run += 1
                    runs[c] += 1
                    if run == shortest:
                        _extend(code, r, c - run, 0, -1, reach, ALONG_ROWS)
                    if runs[c] == shortest:
                        _extend(code, r - runs[c], c, -1, 0, reach, ALONG_COLS)
                    continue
                if run >= shortest:
                    _extend(code, r, c, 0, 1, reach, ALONG_ROWS)
                if runs[c] >= shortest:
                    _extend(code, r, c, 1, 0, reach, ALONG_COLS)
                run = runs[c] = 0


@njit(cache=True, nogil=True)
def _extend(code: Bytes, r: int, c: int, dr: int, dc: int, reach: int, bit: int) -> None:
    for _ in range(reach):
        if not (0 <= r < code.shape[0] and 0 <= c < code.shape[1] and code[r, c] & UNKNOWN_BIT):
            return
        code[r, c] |= bit
        r += dr
        c += dc
