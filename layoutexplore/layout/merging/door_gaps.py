"""Door-gap candidates: short gaps in walls that run along rows and columns.

A candidate is a gap in line with a run of wall, behind which the free space widens on both sides. Every gap
knows its width and the length of the walls beside it; whether it parts two rooms is decided later.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Ints32, Mask
from layoutexplore.grids.runs import run_end
from layoutexplore.layout.limits import cells_at_most

LONGEST_RUN = 5.0
"""A wall beside a gap is followed no farther than this [m]."""


@dataclass(frozen=True, kw_only=True)
class DoorGapConfig:
    """What counts as a candidate; lengths in metres.

    Attributes:
        door_min: Narrowest gap.
        door_max: Widest door.
        door_run: The wall on at least one side of a door is this long.
        widening: The space behind a door widens by this much ...
        reach: ... within this distance, on both sides.
        slack: A wall may step aside by this much, and by one cell at least.
    """

    door_min: float = 0.45
    door_max: float = 3.0
    door_run: float = 0.3
    widening: float = 0.4
    reach: float = 0.6
    slack: float = 0.1


class GapColumns(NamedTuple):
    """Columns of the tables of gaps, all in cells.

    Attributes:
        line: Row that the gap lies in; column for one along the columns.
        begin: Its first cell in that line.
        width: Its cells.
        long: The longer run of wall beside it.
        short: The shorter one.
    """

    line: int
    begin: int
    width: int
    long: int
    short: int


GAP = GapColumns(*range(len(GapColumns._fields)))
"""The index of each column, constants to the compiler."""


class GapSizes(NamedTuple):
    """A `DoorGapConfig` in cells, and how far a wall is followed."""

    narrowest: int
    widest: int
    run: int
    widening: int
    reach: int
    slack: int
    longest: int


@dataclass(frozen=True, eq=False)
class DoorGaps:
    """Door-gap candidates.

    Attributes:
        gap: int32 (rows, cols), row of the table for the cells of a gap, 0 elsewhere.
        table: int32 (n, columns of `GAP`), the gaps along the rows first; row 0 is empty.
    """

    gap: Ints32
    table: Ints32


@njit(cache=True, nogil=True)
def _run_length(blocked: Mask, r: int, c: int, step: int, slack: int, longest: int) -> int:
    """Cells in line from (r, c) on that are blocked, at most `slack` rows aside."""
    n = 0
    first, last = max(r - slack, 0), min(r + slack + 1, blocked.shape[0])
    while 0 <= c < blocked.shape[1] and n < longest:
        # the wall may step aside anywhere within the slack, not only once
        found = False
        for rr in range(first, last):
            found |= blocked[rr, c]
        if not found:
            break
        n += 1
        c += step
    return n


@njit(cache=True, nogil=True)
def _widens(blocked: Mask, r: int, c: int, step: int, reach: int, wanted: int) -> bool:
    """Whether cells above (`step` 1) or below (-1) are free up to a run as long as wanted in `reach` rows.

    The border of the grid blocks: a gap in its first or last row leads nowhere.
    """
    for k in range(1, reach + 1):
        rr = r + step * k
        if not 0 <= rr < blocked.shape[0] or blocked[rr, c]:
            return False
        # the run around c is followed no farther than it is wanted
        first, last = c, c + 1
        while first > 0 and last - first < wanted and not blocked[rr, first - 1]:
            first -= 1
        while last < blocked.shape[1] and last - first < wanted and not blocked[rr, last]:
            last += 1
        if last - first >= wanted:
            return True
    return False


@njit(cache=True, nogil=True)
def _gaps_along_rows(blocked: Mask, sizes: GapSizes) -> Ints32:
    """The gaps int32 (n, columns of `GAP`) between blocked cells of one row, in raster order."""
    rows, cols = blocked.shape
    # a gap and the blocked cell before it
    gaps = np.empty((rows * cols // (sizes.narrowest + 1) + 1, len(GAP)), np.int32)
    count = 0
    for r in range(rows):
        line = blocked[r]
        before = run_end(line, 0, False)
        while before < cols:
            c, behind = before + 1, run_end(line, before + 1, False)
            n = behind - c
            if sizes.narrowest <= n <= sizes.widest and behind < cols:
                middle, wanted = c + n // 2, n + sizes.widening
                one = _run_length(blocked, r, before, -1, sizes.slack, sizes.longest)
                other = _run_length(blocked, r, behind, 1, sizes.slack, sizes.longest)
                if (
                    max(one, other) >= sizes.run
                    and _widens(blocked, r, middle, -1, sizes.reach, wanted)
                    and _widens(blocked, r, middle, 1, sizes.reach, wanted)
                ):
                    gaps[count, GAP.line], gaps[count, GAP.begin], gaps[count, GAP.width] = r, c, n
                    gaps[count, GAP.long], gaps[count, GAP.short] = max(one, other), min(one, other)
                    count += 1
            before = behind
    return gaps[:count].copy()


def list_gaps(
    blocked: Mask, resolution: float, config: DoorGapConfig, longest: float = LONGEST_RUN
) -> tuple[Ints32, Ints32]:
    """The gaps int32 (n, columns of `GAP`) along the rows and those along the columns.

    Args:
        blocked: bool (rows, cols), the obstacles.
        resolution: Metres a cell.
        config: What counts.
        longest: A wall beside a gap is followed no farther than this [m].
    """
    lengths = config.door_min, config.door_max, config.door_run, config.widening, config.reach, config.slack
    sizes = GapSizes(*(cells_at_most(v, resolution, 10**6) for v in (*lengths, longest)))
    upright = np.ascontiguousarray(blocked)
    lying = cv2.transpose(upright.view(np.uint8)).view(np.bool_)
    return _gaps_along_rows(upright, sizes), _gaps_along_rows(lying, sizes)


@njit(cache=True, nogil=True)
def _mark(table: Ints32, first: int, last: int, gap: Ints32) -> None:
    """Write the numbers of gaps first <= k < last of the table to their cells; of two the narrower counts.

    The first of equal ones stays, so gaps along the rows go before those along the columns.
    """
    for k in range(first, last):
        line, begin, n = table[k, GAP.line], table[k, GAP.begin], table[k, GAP.width]
        for c in range(begin, begin + n):
            if gap[line, c] == 0 or n < table[gap[line, c], GAP.width]:
                gap[line, c] = k


def find_door_gaps(blocked: Mask, resolution: float, config: DoorGapConfig) -> DoorGaps:
    """Gaps along rows and columns that may part rooms.

    Args:
        blocked: bool (rows, cols), the obstacles.
        resolution: Metres a cell.
        config: What counts.
    """
    along_rows, along_cols = list_gaps(blocked, resolution, config)
    table = np.concatenate((np.zeros((1, len(GAP)), np.int32), along_rows, along_cols))
    gap = np.zeros(blocked.shape, np.int32)
    _mark(table, 1, 1 + len(along_rows), gap)
    _mark(table, 1 + len(along_rows), len(table), gap.T)
    return DoorGaps(gap, table)
