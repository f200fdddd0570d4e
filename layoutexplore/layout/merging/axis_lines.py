"""Lines along the rows and columns of a grid whose walls run that way: wall in line, over the whole map.

ROSE keeps what agrees with the long walls of a map: inside a ridge of its spectrum, an occupied cell scores
what lies in line with it along the ridge's wall direction. Where walls run along rows and columns, that is a
running sum over the rows or the columns. Cells that score enough are walls, and walls in line make a line.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Cells, Floats, Ints, Ints32, Mask, Words
from layoutexplore.grids.bitsets import count_bits, set_bits, true_cells
from layoutexplore.layout.alignment import surfaces
from layoutexplore.layout.limits import cells_at_most


@dataclass(frozen=True, kw_only=True)
class AxisLineConfig:
    """How lines are found; lengths in metres.

    Attributes:
        wall_length: What lies in line with a cell within half of this on either side supports it (ROSE).
        level: Least score of a wall, as a share of the best (ROSE2), on a map whose surfaces are nearly all
            in line ...
        level_max: ... and on one of much clutter, as ROSE2 raises it with the density of segments.
        in_line: Shares of the surfaces that are walls at the lowest level, of a map of much clutter and of
            one of little.
        support: And the least wall in line with a wall's cell.
        run: And around a wall's cell, over so long ...
        run_share: ... this share is wall.
        slack: A wall may step aside by this much.
        line_distance: Two lines are at least so far apart.
        line_length: Least wall on a line.
    """

    wall_length: float = 8.0
    level: float = 0.18
    level_max: float = 0.4
    in_line: tuple[float, float] = (0.6, 0.8)
    support: float = 1.25
    run: float = 0.8
    run_share: float = 0.75
    slack: float = 0.1
    line_distance: float = 1.0
    line_length: float = 1.0


class AxisLines(NamedTuple):
    """Lines along the rows, or along the columns, of a grid.

    Attributes:
        offsets: int64 (k,), the row of each line, or its column, rising.
        sums: int32 (k, length + 1), covered cells of each line before each of its cells.
    """

    offsets: Ints
    sums: Ints32


@njit(cache=True, nogil=True)
def _scores(
    rows: Ints, cols: Ints, thick: Words, length: int, half: int, near: int, near_least: float
) -> Ints:
    """The wall in line with each occupied cell, 0 next to too little; `thick` are bits, `length` a row."""
    score = np.zeros(len(rows), np.int64)
    for n in range(len(rows)):
        r, c = rows[n], cols[n]
        if count_bits(thick, r, length, c - near, c + near + 1) >= near_least:
            score[n] = count_bits(thick, r, length, c - half, c + half + 1)
    return score


def _walls(scores: Sequence[Ints], count: int, resolution: float, config: AxisLineConfig) -> list[Mask]:
    """Which cells are walls along the rows, and which along the columns; `count` are on surfaces."""
    least, best = config.support / resolution, [int(score.max(initial=0)) for score in scores]

    def above(level: float) -> list[Mask]:
        return [score >= max(level * top, least) for score, top in zip(scores, best, strict=True)]

    share = np.count_nonzero(np.logical_or(*above(config.level))) / max(count, 1)
    return above(float(np.interp(share, config.in_line, (config.level_max, config.level))))


@njit(cache=True, nogil=True)
def _offsets(profile: Floats, slack: int, reach: int, least: float) -> Ints:
    """Rows of the lines, the row with most wall within `slack` first, none within `reach` of another."""
    # where sums are equal the row with more wall itself, then the first: lines lie on walls, not beside them
    n = len(profile)
    left = profile.copy()
    heap = [(0.0, 0.0, 0) for _ in range(0)]
    for r in range(n):
        total = _around(left, r, slack)
        if left[r] > 0 and total > least:
            heap.append((-total, -left[r], r))
    heapq.heapify(heap)
    out = np.empty(len(heap), np.int64)
    count = 0
    while len(heap) > 0:
        before, _, best = heapq.heappop(heap)
        if left[best] <= 0:
            continue
        # what a line has taken makes sums smaller, never larger: a row is entered again with what it has now
        total = _around(left, best, slack)
        if total != -before:
            if total > least:
                heapq.heappush(heap, (-total, -left[best], best))
            continue
        out[count] = best
        count += 1
        for k in range(max(best - reach, 0), min(best + reach + 1, n)):
            left[k] = 0.0
    return out[:count].copy()


@njit(cache=True, nogil=True)
def _around(values: Floats, r: int, slack: int) -> float:
    """The sum of the values at most `slack` from the one at r."""
    total = 0.0
    for k in range(max(r - slack, 0), min(r + slack + 1, len(values))):
        total += values[k]
    return total


@njit(cache=True, nogil=True)
def _coverage(rows: Ints, cols: Ints, length: int, offsets: Ints, reach: int, joint: int) -> Ints32:
    """int32 (lines, length + 1): covered cells of each line before each column, gaps up to 2 `joint` too."""
    covered = np.zeros((len(offsets), length), np.bool_)
    for n in range(len(rows)):
        r, c = rows[n], cols[n]
        # the line of a cell is the nearer of the two beside it, the lower where both are as near
        k = np.searchsorted(offsets, r)
        best = -1
        for j in range(max(k - 1, 0), min(k + 1, len(offsets))):
            if abs(offsets[j] - r) <= reach and (best < 0 or abs(offsets[j] - r) < abs(offsets[best] - r)):
                best = j
        if best >= 0:
            for d in range(max(c - joint, 0), min(c + joint + 1, length)):
                covered[best, d] = True
    # sums before a column, so that what a stretch has is a difference
    sums = np.zeros((len(offsets), length + 1), np.int32)
    for k in range(len(offsets)):
        for c in range(length):
            sums[k, c + 1] = sums[k, c] + covered[k, c]
    return sums


def _lines(
    rows: Ints, cols: Ints, shape: tuple[int, int], resolution: float, config: AxisLineConfig
) -> AxisLines:
    """The lines along the rows.

    Args:
        rows: int64 (n,), of the cells of walls along the rows.
        cols: int64 (n,), of the same cells.
        shape: Rows and columns of the grid.
        resolution: Metres a cell.
        config: The options.
    """
    slack, reach, joint = (
        cells_at_most(length, resolution, shape[0] + shape[1])
        for length in (config.slack, config.line_distance / 2, config.slack / 2)
    )
    profile = np.bincount(rows, minlength=shape[0]).astype(np.float64)
    offsets = np.sort(_offsets(profile, slack, reach, config.line_length / resolution))
    return AxisLines(offsets, _coverage(rows, cols, shape[1], offsets, reach, joint))


def find_lines(
    cells: Cells, wall: Mask, resolution: float, config: AxisLineConfig
) -> tuple[AxisLines, AxisLines]:
    """The lines along the rows of a grid and those along its columns.

    Args:
        cells: int8 (rows, cols), trinary.
        wall: bool (rows, cols), the occupied cells that may be wall.
        resolution: Metres a cell.
        config: The options.
    """
    rows, cols = cells.shape
    surface = surfaces(cells)
    at = true_cells(surface & wall)
    along_rows, along_cols = set_bits(at, rows, cols, cells_at_most(config.slack, resolution, rows + cols))
    row, col = np.divmod(at, cols)
    half, near = (max(round(length / resolution / 2), 1) for length in (config.wall_length, config.run))
    enough = config.run_share * (2 * near + 1)
    scores = [
        _scores(row, col, along_rows, cols, half, near, enough),
        _scores(col, row, along_cols, rows, half, near, enough),
    ]
    lying, standing = _walls(scores, int(np.count_nonzero(surface)), resolution, config)
    return (
        _lines(row[lying], col[lying], (rows, cols), resolution, config),
        _lines(col[standing], row[standing], (cols, rows), resolution, config),
    )
