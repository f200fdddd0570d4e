"""Openings in walls, on a grid whose walls run along rows and columns: candidates for doors.

A candidate is a short gap in line with a run of wall, behind which the free space widens on both sides. Every
gap knows its width and the length of the walls beside it; whether it parts two rooms is decided later.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.bitsets import true_cells
from layoutexplore.grids.runs import run_end

WIDTH, LONG, SHORT = range(3)
"""Columns of the table of gaps: width, longer and shorter run of wall beside it, all in cells."""

LONGEST_RUN = 5.0
"""A wall beside a gap is followed no farther than this [m]."""


@dataclass(frozen=True, kw_only=True)
class OpeningConfig:
    """What counts as a candidate; lengths in metres.

    Attributes:
        door_min: Narrowest gap.
        door_max: Widest door.
        door_run: The wall on at least one side of a door is this long.
        widening: The space behind a door widens by this much ...
        reach: ... within this distance, on both sides.
        slack: A wall may step aside by this much.
    """

    door_min: float = 0.45
    door_max: float = 3.0
    door_run: float = 0.3
    widening: float = 0.4
    reach: float = 0.6
    slack: float = 0.1


@dataclass(frozen=True, eq=False)
class Openings:
    """Candidate openings.

    Attributes:
        gap: int32 (rows, cols), row of the table for the cells of a gap, 0 elsewhere.
        table: int32 (n, 3), WIDTH, LONG and SHORT of each gap in cells; row 0 is empty.
    """

    gap: NDArray[np.int32]
    table: NDArray[np.int32]


@njit(cache=True, nogil=True)
def free_runs(blocked: NDArray[np.bool_]) -> NDArray[np.int16]:
    """Length of the run of cells that are not blocked in its row, for each cell; 0 for blocked ones."""
    rows, cols = blocked.shape
    out = np.empty((rows, cols), np.int16)
    for r in range(rows):
        line, lengths = blocked[r], out[r]
        c = 0
        while c < cols:
            if line[c]:
                lengths[c] = 0
                c += 1
                continue
            end = run_end(line, c, False)
            length = np.int16(min(end - c, 32767))
            for k in range(c, end):
                lengths[k] = length
            c = end
    return out


@njit(cache=True, nogil=True)
def _run_length(blocked: NDArray[np.bool_], r: int, c: int, step: int, slack: int, longest: int) -> int:
    """Cells in line from (r, c) on that are blocked, at most `slack` rows aside."""
    n = 0
    first, last = max(r - slack, 0), min(r + slack + 1, blocked.shape[0])
    while 0 <= c < blocked.shape[1] and n < longest:
        found = False
        for rr in range(first, last):
            found |= blocked[rr, c]
        if not found:
            break
        n += 1
        c += step
    return n


@njit(cache=True, nogil=True)
def widens(runs: NDArray[np.int16], r: int, c: int, step: int, reach: int, wanted: int) -> bool:
    """Whether the run of a cell is followed, up (`step` -1) or down (1), by one of the wanted length within `reach` rows."""
    for k in range(1, reach + 1):
        rr = r + step * k
        if rr < 0 or rr >= runs.shape[0] or runs[rr, c] == 0:
            return False
        if runs[rr, c] >= wanted:
            return True
    return False


@njit(cache=True, nogil=True)
def _mark(
    blocked: NDArray[np.bool_],
    cells: NDArray[np.int64],
    runs: NDArray[np.int16],
    sizes: tuple[int, int, int, int, int, int, int],
    gap: NDArray[np.int32],
    strides: tuple[int, int],
    table: NDArray[np.int32],
) -> NDArray[np.int32]:
    """Mark the gaps between blocked cells (flat, rising) of one row and add them to the table; a cell of two keeps the narrower.

    `gap` is flat; `strides` are its steps from row to row and from column to column.
    """
    narrowest, widest, run_min, widening, reach, longest, slack = sizes
    rows, cols = runs.shape
    count = len(table)
    new = np.empty((256, 3), np.int32)
    n_new = 0
    for k in range(1, len(cells)):
        n = cells[k] - cells[k - 1] - 1
        if n < narrowest or n > widest:
            continue
        r, c = cells[k] // cols, cells[k] % cols - n
        if c < 1 or r < 1 or r >= rows - 1:
            continue
        middle, wanted = c + n // 2, n + widening
        if not (widens(runs, r, middle, -1, reach, wanted) and widens(runs, r, middle, 1, reach, wanted)):
            continue
        one, other = (
            _run_length(blocked, r, c - 1, -1, slack, longest),
            _run_length(blocked, r, c + n, 1, slack, longest),
        )
        if max(one, other) < run_min:
            continue
        if n_new >= len(new):
            new = np.concatenate((new, np.empty_like(new)))
        new[n_new, 0], new[n_new, 1], new[n_new, 2] = n, max(one, other), min(one, other)
        for at in range(r * strides[0] + c * strides[1], r * strides[0] + (c + n) * strides[1], strides[1]):
            if gap[at] == 0 or n < table[gap[at], WIDTH]:
                gap[at] = count + n_new
        n_new += 1
    return np.concatenate((table, new[:n_new]))


def find_openings(blocked: NDArray[np.bool_], resolution: float, config: OpeningConfig) -> Openings:
    """Gaps along rows and columns that may part rooms.

    Args:
        blocked: bool (rows, cols), the obstacles.
        resolution: Metres a cell.
        config: What counts.
    """
    lengths = (
        config.door_min,
        config.door_max,
        config.door_run,
        config.widening,
        config.reach,
        LONGEST_RUN,
        config.slack,
    )
    narrowest, widest, run_min, widening, reach, longest, slack = (
        max(round(v / resolution), 1) for v in lengths
    )
    sizes = narrowest, widest, run_min, widening, reach, longest, slack
    upright = np.ascontiguousarray(blocked)
    lying = cv2.transpose(upright.view(np.uint8)).view(np.bool_)
    table = np.zeros((1, 3), np.int32)
    gap = np.zeros(upright.shape, np.int32)
    for mask, strides in ((upright, (upright.shape[1], 1)), (lying, (1, upright.shape[1]))):
        cells = true_cells(mask)
        table = _mark(mask, cells, free_runs(mask), sizes, gap.reshape(-1), strides, table)
    return Openings(gap, table)
