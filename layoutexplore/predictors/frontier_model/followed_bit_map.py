"""The bit map of a grid that changes, drawn anew where it does, and what that changes of it."""

from __future__ import annotations

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Bytes, Cells
from layoutexplore.grids.boxes import Box, grown_box
from layoutexplore.grids.grid import in_cells
from layoutexplore.layout.doorways import Gaps, Regions
from layoutexplore.predictors.bit_map import (
    ALONG_COLS,
    ALONG_ROWS,
    DOOR_BIT,
    EXTENSION_REACH,
    FREE_BIT,
    UNKNOWN_BIT,
    WALL_BIT,
    WALL_MIN,
    BitMap,
    bits_of,
    draw_bit_map,
    draw_cells,
)

BLOCK = 8
"""Side of the blocks in which changes are noticed together: eight bytes are compared at once."""

_KNOWN = FREE_BIT | WALL_BIT | UNKNOWN_BIT | DOOR_BIT
"""The bits that a cell has by itself."""

_LANE = 16
"""So many columns are followed side by side, whatever a cell measures."""


class FollowedBitMap:
    """Bit maps of one grid after the other, in the same memory while the grids have the same shape."""

    def __init__(self) -> None:
        self._bit_map: BitMap | None = None
        self._resolution = 0.0

    def __call__(
        self, cells: Cells, regions: Regions, resolution: float, margin: float
    ) -> tuple[BitMap, Bytes | None]:
        """The same as `draw_bit_map`, for gaps within what is known; its code changes with the next call.

        Returns:
            The bit map; and what differs from the last one, uint8 (blocks down, blocks across), not 0 where
            one of `BLOCK` by `BLOCK` cells of the code does. None where that was of another shape.
        """
        border = in_cells(margin, resolution)
        kept, shape = self._bit_map, tuple(size + 2 * border for size in cells.shape)
        if kept is None or kept.code.shape != shape or resolution != self._resolution:
            self._bit_map = draw_bit_map(cells, regions, resolution, margin)
            self._resolution = resolution
            return self._bit_map, None
        return kept, self._follow(kept, cells, regions.gaps)

    def _follow(self, bit_map: BitMap, cells: Cells, gaps: Gaps) -> Bytes:
        """Draw what has changed; in which blocks something has."""
        code, margin = bit_map.code, bit_map.margin
        blocks = np.zeros([-(-size // BLOCK) for size in code.shape], np.uint8)
        row0, row1, col0, col1 = box = _changed_box(cells, gaps, code, margin)
        if row0 >= row1:
            return blocks
        shortest = in_cells(WALL_MIN, self._resolution)
        reach = round(EXTENSION_REACH / self._resolution)
        top, bottom, left, right = grown_box(box, reach + shortest, code.shape)
        top, left = top // BLOCK * BLOCK, left // BLOCK * BLOCK
        around = code[top:bottom, left:right]
        before = around.copy()
        draw_cells(cells, gaps, np.array([row0, col0, row1, col1]) - margin, margin, code)
        # What a wall is continued by lies in its own line: only lines with a change are looked at.
        _continue_along_rows(code[row0:row1], (left, right), shortest, reach)
        _continue_along_cols(code[:, col0:col1], (top, bottom), shortest, reach)
        changed = changed_blocks(before, around)
        down, across = top // BLOCK, left // BLOCK
        blocks[down : down + changed.shape[0], across : across + changed.shape[1]] = changed
        return blocks


@njit(cache=True, nogil=True)
def _changed_box(cells: Cells, gaps: Gaps, code: Bytes, margin: int) -> Box:
    """The half-open box of the code around the cells that have other bits by themselves than it holds."""
    rows, cols = cells.shape
    row0, row1, col0, col1 = rows, 0, cols, 0
    for r in range(rows):
        values, widths, bits = cells[r], gaps[r], code[r + margin, margin : margin + cols]
        differs = np.uint8(0)
        for c in range(cols):
            differs |= np.uint8(bits_of(values[c], widths[c]) ^ (bits[c] & _KNOWN))
        if not differs:
            continue
        first, last = 0, cols
        while bits_of(values[first], widths[first]) == bits[first] & _KNOWN:
            first += 1
        while bits_of(values[last - 1], widths[last - 1]) == bits[last - 1] & _KNOWN:
            last -= 1
        row0, row1, col0, col1 = min(row0, r), r + 1, min(col0, first), max(col1, last)
    if row0 >= row1:
        return 0, 0, 0, 0
    return row0 + margin, row1 + margin, col0 + margin, col1 + margin


@njit(cache=True, nogil=True)
def _course(part: tuple[int, int], before: int, size: int, backwards: bool) -> tuple[int, int, int]:
    """Where in a line of that size a course over a part begins, so much before it, its step and length."""
    begin, end = part
    if backwards:
        first = min(end + before, size) - 1
        return first, -1, first - begin + 1
    first = max(begin - before, 0)
    return first, 1, end - first


@njit(cache=True, nogil=True)
def _continue_along_rows(code: Bytes, box: tuple[int, int], shortest: int, reach: int) -> None:
    """Mark the unknown cells anew that continue a wall of some rows of a bit map, in some columns."""
    begin, end = box
    cols = code.shape[1]
    for r in range(code.shape[0]):
        line = code[r]
        for c in range(begin, end):
            line[c] &= 255 ^ ALONG_ROWS
        # A wall is long enough by its last cells; what continues it begins `reach` cells away at most.
        for backwards in range(2):
            run, ahead = 0, 0
            first, step, count = _course(box, reach + shortest, cols, backwards == 1)
            for k in range(count):
                c = first + k * step
                if line[c] & WALL_BIT:
                    run += 1
                    ahead = 0
                elif line[c] & UNKNOWN_BIT:
                    ahead = reach if run >= shortest else ahead
                    run = 0
                    if ahead > 0:
                        ahead -= 1
                        if begin <= c < end:
                            line[c] |= ALONG_ROWS
                else:
                    run = ahead = 0


@njit(cache=True, nogil=True)
def _continue_along_cols(code: Bytes, box: tuple[int, int], shortest: int, reach: int) -> None:
    """Mark the unknown cells anew that continue a wall of some columns of a bit map, in some rows."""
    begin, end = box
    rows, cols = code.shape
    for r in range(begin, end):
        for c in range(cols):
            code[r, c] &= 255 ^ ALONG_COLS
    run, ahead = np.zeros(_LANE, np.int64), np.zeros(_LANE, np.int64)
    for left in range(0, cols, _LANE):
        width = min(_LANE, cols - left)
        for backwards in range(2):
            run[:], ahead[:] = 0, 0
            first, step, count = _course(box, reach + shortest, rows, backwards == 1)
            goes_on = False  # whether a wall, or what continues it, comes from the row before
            for k in range(count):
                r = first + k * step
                line, bits = code[r, left : left + width], np.uint8(0)
                for c in range(width):
                    bits |= line[c]
                if not (goes_on or bits & WALL_BIT):
                    continue
                goes_on = False
                for c in range(width):
                    if line[c] & WALL_BIT:
                        run[c] += 1
                        ahead[c] = 0
                    elif line[c] & UNKNOWN_BIT:
                        ahead[c] = reach if run[c] >= shortest else ahead[c]
                        run[c] = 0
                        if ahead[c] > 0:
                            ahead[c] -= 1
                            if begin <= r < end:
                                line[c] |= ALONG_COLS
                    else:
                        run[c] = ahead[c] = 0
                    goes_on |= run[c] > 0 or ahead[c] > 0


@njit(cache=True, nogil=True)
def changed_blocks(before: Bytes, after: Bytes) -> Bytes:
    """Not 0 in blocks that hold a cell that differs."""
    changed = np.zeros(((before.shape[0] - 1) // BLOCK + 1, (before.shape[1] - 1) // BLOCK + 1), np.uint8)
    for r in range(before.shape[0]):
        old, new, row = before[r], after[r], changed[r // BLOCK]
        for k in range(old.size // BLOCK):
            differ = np.uint8(0)
            for c in range(BLOCK):
                differ |= old[np.uint64(BLOCK * k + c)] ^ new[np.uint64(BLOCK * k + c)]
            row[np.uint64(k)] |= differ
        for c in range(old.size // BLOCK * BLOCK, old.size):
            row[-1] |= old[c] ^ new[c]
    return changed
