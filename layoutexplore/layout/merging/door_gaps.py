"""Door-gap candidates: short gaps in walls that run along rows and columns, and along other given directions.

A candidate is a gap in line with a run of wall, behind which the free space widens on both sides. Every gap
knows its width and the length of the walls beside it; whether it parts two rooms is decided later.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numba import njit

from layoutexplore.errors import ConfigError
from layoutexplore.grids.arrays import ZERO, Floats, Ints32, Mask
from layoutexplore.grids.bitsets import true_cells
from layoutexplore.grids.runs import run_end
from layoutexplore.layout.limits import cells_at_most
from layoutexplore.options import check_fields

LONGEST_RUN = 5.0
"""A wall beside a gap is followed no farther than this [m]."""

NO_ANGLES = np.zeros(0)

ASKEW_RUN, ASKEW_SLACK = 1.2, 0.05
"""What `door_run` and `slack` are along directions in which only some of the walls run: no line that crosses
another wall at 18 degrees or more (as a pentagon's do) is a wall so long."""


LONGEST = 100.0
"""Metres: no opening is wider; what is looked at around one grows with the square."""


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

    def __post_init__(self) -> None:
        check_fields(self)
        if not 0 < self.door_min <= self.door_max:
            raise ConfigError("door_min must be above 0 and at most door_max")
        if min(self.door_run, self.widening, self.reach) <= 0 or self.slack < 0:
            raise ConfigError("lengths of openings must be above 0 (slack may be 0)")
        if max(self.door_max, self.door_run, self.widening, self.reach, self.slack) > LONGEST:
            raise ConfigError(f"lengths of openings are {LONGEST:g} m at most")


class GapColumns(NamedTuple):
    """Columns of the tables of gaps, all in cells.

    Attributes:
        line: Row that the gap lies in; column for one along the columns; for one askew that at column 0.
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
        askew: Whether some walls run along neither rows nor columns.
    """

    gap: Ints32
    table: Ints32
    askew: bool = False


@njit(cache=True, nogil=True)
def _run_along(blocked: Mask, rise: Ints32, line: int, c: int, step: int, sizes: GapSizes) -> int:
    """Cells along a line from column c on that are blocked, at most `slack` rows aside.

    A line lies in row `line` at a column where it has risen by nothing (`rise`): one along the rows in all.
    """
    n = 0
    while 0 <= c < blocked.shape[1] and n < sizes.longest:
        # the wall may step aside anywhere within the slack, not only once
        r, found = line + rise[c], False
        for rr in range(max(r - sizes.slack, 0), min(r + sizes.slack + 1, blocked.shape[0])):
            found |= blocked[rr, c]
        if not found:
            break
        n += 1
        c += step
    return n


@njit(cache=True, nogil=True)
def _is_free(blocked: Mask, r: int, c: int) -> bool:
    """Whether a cell of the grid's columns is free; none is blocked outside its rows."""
    return not (0 <= r < blocked.shape[0] and blocked[r, c])


@njit(cache=True, nogil=True)
def _widens_along(blocked: Mask, rise: Ints32, line: int, c: int, step: int, wanted: int, reach: int) -> bool:
    """Whether cells above a line (`step` 1) or below (-1) are free up to a run as long as wanted.

    It is looked for in `reach` rows. The border of the grid blocks: a gap in its first or last row leads
    nowhere.
    """
    for k in range(1, reach + 1):
        beside = line + step * k
        if not 0 <= beside + rise[c] < blocked.shape[0] or blocked[beside + rise[c], c]:
            return False
        # the run around c is followed no farther than it is wanted
        first, last = c, c + 1
        while first > 0 and last - first < wanted and _is_free(blocked, beside + rise[first - 1], first - 1):
            first -= 1
        while (
            last < blocked.shape[1] and last - first < wanted and _is_free(blocked, beside + rise[last], last)
        ):
            last += 1
        if last - first >= wanted:
            return True
    return False


@njit(cache=True, nogil=True, inline="always")
def _is_gap(
    blocked: Mask, rise: Ints32, line: int, begin: int, width: int, sizes: GapSizes, gap: Ints32
) -> bool:
    """Whether so many open cells of a line part two walls and widen on either side; written to `gap`."""
    one = _run_along(blocked, rise, line, begin - 1, -1, sizes)
    other = _run_along(blocked, rise, line, begin + width, 1, sizes)
    middle, wanted = begin + width // 2, width + sizes.widening
    if not (
        max(one, other) >= sizes.run
        and _widens_along(blocked, rise, line, middle, -1, wanted, sizes.reach)
        and _widens_along(blocked, rise, line, middle, 1, wanted, sizes.reach)
    ):
        return False
    gap[GAP.line], gap[GAP.begin], gap[GAP.width] = line, begin, width
    gap[GAP.long], gap[GAP.short] = max(one, other), min(one, other)
    return True


@njit(cache=True, nogil=True)
def _gaps_along_rows(blocked: Mask, sizes: GapSizes) -> Ints32:
    """The gaps int32 (n, columns of `GAP`) between blocked cells of one row, in raster order."""
    rows, cols = blocked.shape
    level = np.zeros(cols, np.int32)
    # a gap and the blocked cell before it
    gaps = np.empty((rows * cols // (sizes.narrowest + 1) + 1, len(GAP)), np.int32)
    count = 0
    for r in range(rows):
        line = blocked[r]
        before = run_end(line, ZERO, False)
        while before < cols:
            c, behind = before + 1, run_end(line, before + 1, False)
            n = behind - c
            if sizes.narrowest <= n <= sizes.widest and behind < cols:
                count += _is_gap(blocked, level, r, c, n, sizes, gaps[count])
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


def risen(angle: float, length: int) -> Ints32:
    """Rows by which a line at an angle of at most 45 degrees to the rows has risen at each column."""
    return np.asarray(np.floor(np.arange(length) * math.tan(angle) + 0.5), np.int32)


@njit(cache=True, nogil=True)
def gaps_along_lines(blocked: Mask, at: Ints32, rise: Ints32, sizes: GapSizes) -> Ints32:
    """The gaps int32 (n, columns of `GAP`) between blocked cells of one line, by the column behind each.

    Every cell lies on one line: `line` is its row less what a line has risen by at its column.

    Args:
        blocked: bool (rows, cols).
        at: int32 (2, n), column and row of the blocked cells, by column.
        rise: int32 (cols,), see `risen`.
        sizes: In columns, but reach and slack in rows.
    """
    lowest = -max(int(rise[0]), int(rise[-1]))
    lines = blocked.shape[0] + abs(int(rise[-1] - rise[0])) + 1
    # the column of the last blocked cell on each line: no other cell has to be looked at
    last = np.full(lines, -1, np.int32)
    gaps = np.empty((at.shape[1], len(GAP)), np.int32)
    count = 0
    for i in range(at.shape[1]):
        c, line = at[0, i], at[1, i] - rise[at[0, i]]
        before = last[line - lowest]
        last[line - lowest] = c
        n = c - before - 1
        if before < 0 or not sizes.narrowest <= n <= sizes.widest:
            continue
        # most pairs of cells are no ends of walls that run along the line, and do not get any further
        count += _is_gap(blocked, rise, line, before + 1, n, sizes, gaps[count])
    return gaps[:count].copy()


@njit(cache=True, nogil=True)
def _mark(table: Ints32, first: int, cells: Ints32, rise: Ints32, gap: Ints32) -> None:
    """Write the numbers of gaps from `first` on in the table to their cells; of two the narrower counts.

    The first of equal ones stays, so gaps along the rows go before those along the columns. `cells` (n,) are
    the cells of each gap, `rise` (cols,) the rows by which lines rise.
    """
    for k in range(first, first + len(cells)):
        line, begin, n = table[k, GAP.line], table[k, GAP.begin], table[k, GAP.width]
        for c in range(begin, begin + cells[k - first]):
            r = line + rise[c]
            if gap[r, c] == 0 or n < table[gap[r, c], GAP.width]:
                gap[r, c] = k


def _askew_gaps(
    blocked: Mask, at: Ints32, angle: float, resolution: float, config: DoorGapConfig
) -> tuple[Ints32, Ints32, Ints32]:
    """The gaps int32 (n, columns of `GAP`) along lines that rise at an angle.

    A column of such a line is longer than a cell, and of what lies across a line fewer rows are as far.

    Returns:
        The gaps, int32 (n,) the columns of each, and int32 (cols,) the rows by which the lines have risen.
    """
    along = math.cos(angle)
    lengths = config.door_min, config.door_max, ASKEW_RUN, config.widening
    across = config.reach, ASKEW_SLACK
    metres = [*(v * along for v in lengths), *(v / along for v in across), LONGEST_RUN * along]
    sizes = GapSizes(*(cells_at_most(v, resolution, 10**6) for v in metres))
    rise = risen(angle, blocked.shape[1])
    found = gaps_along_lines(blocked, at, rise, sizes)
    cells = found[:, GAP.width].copy()
    for column in (GAP.width, GAP.long, GAP.short):
        found[:, column] = np.rint(found[:, column] / along)
    return found, cells, rise


def find_door_gaps(
    blocked: Mask, resolution: float, config: DoorGapConfig, askew: Floats = NO_ANGLES
) -> DoorGaps:
    """Gaps along rows and columns, and along further directions, that may part rooms.

    Args:
        blocked: bool (rows, cols), the obstacles.
        resolution: Metres a cell.
        config: What counts.
        askew: float64 (k,), directions of other walls, in radians from the column axis towards rising rows,
            in (-pi/2, pi/2].
    """
    along_rows, along_cols = list_gaps(blocked, resolution, config)
    gap: Ints32 = np.zeros(blocked.shape, np.int32)
    rows, cols = blocked.shape
    parts = [
        (along_rows, along_rows[:, GAP.width], risen(0.0, cols), gap),
        (along_cols, along_cols[:, GAP.width], risen(0.0, rows), gap.T),
    ]
    # a line at more than 45 degrees to the rows is one at less to the columns
    flat = np.abs(askew) <= math.pi / 4
    steep = np.copysign(math.pi / 2, askew) - askew
    for seen, angles, target in ((blocked, askew[flat], gap), (blocked.T, steep[~flat], gap.T)):
        if len(angles):
            mask, by_column = np.ascontiguousarray(seen), np.ascontiguousarray(seen.T)
            at = np.stack(np.divmod(true_cells(by_column), len(mask))).astype(np.int32)
            parts += [
                (*_askew_gaps(mask, at, angle, resolution, config), target) for angle in angles.tolist()
            ]
    table = np.concatenate((np.zeros((1, len(GAP)), np.int32), *(part[0] for part in parts)))
    first = 1
    for found, cells, rise, target in parts:
        _mark(table, first, np.ascontiguousarray(cells), rise, target)
        first += len(found)
    return DoorGaps(gap, table, len(askew) > 0)
