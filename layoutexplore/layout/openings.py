"""Openings in walls, on a grid whose walls run along rows and columns: candidates for doors.

A candidate is a short gap in line with a run of wall, behind which the free space widens on both sides. Every gap knows its
width and the length of the walls beside it; whether it parts two rooms is decided later.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

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


def thicken(mask: NDArray[np.bool_], slack: int, *, across_rows: bool) -> NDArray[np.uint8]:
    """A mask grown by `slack` cells up and down (`across_rows`) or left and right, uint8 (rows, cols)."""
    size = 2 * slack + 1
    kernel = np.ones((size, 1) if across_rows else (1, size), np.uint8)
    return np.asarray(cv2.dilate(np.ascontiguousarray(mask).view(np.uint8), kernel), np.uint8)


@njit(cache=True, nogil=True)
def free_runs(blocked: NDArray[np.bool_]) -> NDArray[np.int16]:
    """Length of the run of cells that are not blocked in its row, for each cell; 0 for blocked ones."""
    rows, cols = blocked.shape
    out = np.zeros((rows, cols), np.int16)
    for r in range(rows):
        begin = 0
        for c in range(cols + 1):
            if c == cols or blocked[r, c]:
                n = min(c - begin, 32767)
                for k in range(begin, c):
                    out[r, k] = n
                begin = c + 1
    return out


@njit(cache=True, nogil=True)
def _run_length(thick: NDArray[np.uint8], r: int, c: int, step: int, longest: int) -> int:
    n = 0
    while 0 <= c < thick.shape[1] and thick[r, c] and n < longest:
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
    runs: NDArray[np.int16], thick: NDArray[np.uint8], sizes: NDArray[np.int64], gap: NDArray[np.int32], table: NDArray[np.int32]
) -> NDArray[np.int32]:
    """Mark the gaps along the rows and add them to the table."""
    narrowest, widest, run_min, widening, reach, longest = (
        int(sizes[0]), int(sizes[1]), int(sizes[2]), int(sizes[3]), int(sizes[4]), int(sizes[5]))  # fmt: skip
    rows, cols = runs.shape
    count = len(table)
    new = np.empty((256, 3), np.int32)
    n_new = 0
    for r in range(1, rows - 1):
        c = 0
        while c < cols:
            n = int(runs[r, c])
            if n == 0:
                c += 1
                continue
            middle = c + n // 2
            if (
                narrowest <= n <= widest
                and c > 0
                and c + n < cols
                and widens(runs, r, middle, -1, reach, n + widening)
                and widens(runs, r, middle, 1, reach, n + widening)
            ):
                one, other = _run_length(thick, r, c - 1, -1, longest), _run_length(thick, r, c + n, 1, longest)
                if max(one, other) >= run_min:
                    if n_new >= len(new):
                        new = np.concatenate((new, np.empty_like(new)))
                    new[n_new, 0], new[n_new, 1], new[n_new, 2] = n, max(one, other), min(one, other)
                    n_new += 1
                    for k in range(c, c + n):
                        gap[r, k] = count + n_new - 1
            c += n
    return np.concatenate((table, new[:n_new]))


@njit("void(int32[:,::1], int32[:,::1], int32[:,::1])", cache=True, nogil=True)
def _join(gap: NDArray[np.int32], turned: NDArray[np.int32], table: NDArray[np.int32]) -> None:
    """Add the gaps of the transposed grid; a cell of two belongs to the narrower."""
    rows, cols = gap.shape
    for c in range(cols):
        for r in range(rows):
            other = turned[c, r]
            if other == 0:
                continue
            mine = gap[r, c]
            if mine == 0 or table[other, WIDTH] < table[mine, WIDTH]:
                gap[r, c] = other


def find_openings(blocked: NDArray[np.bool_], resolution: float, config: OpeningConfig) -> Openings:
    """Gaps along rows and columns that may part rooms.

    Args:
        blocked: bool (rows, cols), the obstacles.
        resolution: Metres a cell.
        config: What counts.
    """
    lengths = (config.door_min, config.door_max, config.door_run, config.widening, config.reach, LONGEST_RUN)
    sizes = np.array([max(round(v / resolution), 1) for v in lengths], np.int64)
    slack = max(round(config.slack / resolution), 1)
    upright = np.ascontiguousarray(blocked)
    lying = cv2.transpose(upright.view(np.uint8)).view(np.bool_)
    table = np.zeros((1, 3), np.int32)
    gap, turned = np.zeros(upright.shape, np.int32), np.zeros(lying.shape, np.int32)
    table = _mark(free_runs(upright), thicken(upright, slack, across_rows=True), sizes, gap, table)
    table = _mark(free_runs(lying), thicken(lying, slack, across_rows=True), sizes, turned, table)
    _join(gap, turned, np.ascontiguousarray(table))
    return Openings(gap, table)
