"""How measured ranges change the evidence for each cell of a grid, in log odds, and with it the cell itself.

Rays are walked as `layoutexplore.grids.rays.ray_frame` describes. Near the robot many rays cross the same
cell, which counts once a scan: there only every second, fourth, eighth ... of them is walked (`_starts`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.arrays import Bytes, Cells, Floats, Ints, Ints32
from layoutexplore.grids.grid import FREE, OCCUPIED
from layoutexplore.grids.rays import ray_frame
from layoutexplore.sensing.scan_kernels import Changes, FieldOfView, new_counters, set_cell, to_changes

_END_TOLERANCE = 1e-3
"""By so much of a cell a beam is prolonged: a range rounded to float32 must not end before the wall."""

_SPARSEST = 16
"""Every so many beams one is walked from the robot on."""


class EvidenceGrid(NamedTuple):
    """A grid and the evidence of each cell, (rows, cols).

    Attributes:
        cells: int8, the trinary grid.
        log_odds: int16, in hundredths.
        touched: uint8, the stamp of the last scan that has updated the cell.
        hits: int32, how many beams of the last scan ended in the cell, where any did.
    """

    cells: Cells
    log_odds: NDArray[np.int16]
    touched: Bytes
    hits: Ints32


class LogOddsRule(NamedTuple):
    """A `MapperConfig` in hundredths: what a hit adds, a miss takes off, the clamp, and both thresholds.

    `hit_share` is the percentage of the beams into a cell that have to end there for a hit.
    """

    hit: int
    miss: int
    least: int
    most: int
    free_below: int
    occupied_above: int
    hit_share: int


class _Beams(NamedTuple):
    """The beams of a scan from (x, y), in cells.

    Attributes:
        x: Where they start; likewise y.
        y: See x.
        dx: float64 (beams,), their direction in the grid; likewise dy.
        dy: See dx.
        length: float64 (beams,), how far they are walked; -1 where a beam failed.
    """

    x: float
    y: float
    dx: Floats
    dy: Floats
    length: Floats


@njit(cache=True, nogil=True)
def update_log_odds(
    grid: EvidenceGrid,
    stamp: np.uint8,
    x: float,
    y: float,
    heading: float,
    view: FieldOfView,
    ranges: Floats,
    rule: LogOddsRule,
) -> Changes:
    """Update the log odds by one scan of ranges in cells; from outside of the grid nothing is updated.

    Args:
        grid: Changed in place.
        stamp: It and the next differ from all that `grid.touched` holds.
        x: Where the robot believes it stands, in cells; likewise y.
        y: See x.
        heading: In radians.
        view: What its lidar sees.
        ranges: float64 (beams,), inf where nothing was met, NaN or negative where the beam failed.
        rule: How evidence counts.
    """
    rows, cols = grid.cells.shape
    counters = new_counters(grid.cells)
    if not (0.0 <= x < cols and 0.0 <= y < rows):
        return to_changes(counters)
    # Raveled once a scan, not once a ray.
    flat = EvidenceGrid(grid.cells, grid.log_odds.ravel(), grid.touched.ravel(), grid.hits.ravel())
    cos, sin = math.cos(heading), math.sin(heading)
    dx, dy = view.unit_x * cos - view.unit_y * sin, view.unit_x * sin + view.unit_y * cos
    beams = _Beams(x, y, dx, dy, np.empty(dx.size))
    # The cells that beams end in come first: no other beam is to count as a miss there.
    ended, by = np.empty(dx.size, np.int64), np.empty(dx.size, np.int64)
    count = 0
    for i in range(dx.size):
        length = ranges[i] + _END_TOLERANCE
        beams.length[i] = min(length, view.range_max) if ranges[i] >= 0.0 else -1.0
        if not (ranges[i] >= 0.0 and length <= view.range_max + 2.0 * _END_TOLERANCE):
            continue
        end_x, end_y = x + length * dx[i], y + length * dy[i]
        if 0.0 <= end_x < cols and 0.0 <= end_y < rows:
            index = np.uint64(int(end_y) * cols + int(end_x))
            if flat.touched[index] != stamp + 1:
                flat.touched[index], flat.hits[index] = stamp + 1, 0
                ended[count], by[count] = index, i
                count += 1
            flat.hits[index] += 1
    # A ray from the very border of a cell may touch others at that point alone, which no angle tells.
    on_border = x == math.floor(x) or y == math.floor(y)
    crossed, total = _crossed_cells(beams, np.inf if on_border else view.increment, rows, cols)
    _count_misses(flat, crossed[:total], stamp, rule, counters)
    _judge_ended(flat, ended[:count], by, beams, view.increment, rule, counters)
    return to_changes(counters)


@njit(cache=True, nogil=True)
def _starts(length: Floats, increment: float) -> Floats:
    """Up to these distances, other beams cross all cells that a beam crosses: there it is not walked.

    With s the greatest power of two that divides i, beam i lies between i - s and i + s, which are walked
    from nearer on. A cell whose centre is r away is seen under an angle above 1 / r, so that one of them
    crosses it where 1 / r > 2 s increments, if it is long enough to get there.
    """
    starts = np.zeros(length.size)
    stride = 1
    while stride < _SPARSEST:
        # From where a beam leaves a cell, its centre is half a diagonal away, any other point a whole one.
        seen = 1.0 / (2.1 * stride * increment) - 0.71
        for i in range(stride, length.size - stride, 2 * stride):
            shorter = min(length[i - stride], length[i + stride])
            starts[i] = max(min(seen, shorter - 1.42), 0.0)
        stride *= 2
    return starts


@njit(cache=True, nogil=True)
def _judge_ended(
    grid: EvidenceGrid,
    ended: Ints,
    by: Ints,
    beams: _Beams,
    increment: float,
    rule: LogOddsRule,
    counters: Ints,
) -> None:
    """Count a hit in a cell where enough of the beams into it, of which `by` is one, ended, else a miss."""
    weights, cells, cols = grid.log_odds, grid.cells.ravel(), grid.cells.shape[1]
    for n in range(ended.size):
        index = np.uint64(ended[n])
        row, col, percents = ended[n] // cols, ended[n] % cols, 100 * grid.hits[index]
        # Often as many beams as could cross it, by the angle that it is seen under, are few enough.
        right, up = abs(col + 0.5 - beams.x), abs(row + 0.5 - beams.y)
        distance = math.hypot(right, up)
        is_near, is_hit = distance <= 1.0, False
        if not is_near:
            # One more than intervals fit in, and the last beam, which may point where the first does.
            most = (right + up) / (distance * (distance - 0.71) * increment) + 2.0
            is_hit = percents >= rule.hit_share * most
        if not is_hit:
            is_hit = percents >= rule.hit_share * max(_count_into(beams, by[n], row, col, is_near), 1)
        if is_hit:
            weight = min(weights[index] + rule.hit, rule.most)
        else:
            weight = max(weights[index] - rule.miss, rule.least)
        weights[index] = weight
        # Between the thresholds a cell stays what it was.
        if weight >= rule.occupied_above and cells[index] != OCCUPIED:
            set_cell(grid.cells, row, col, OCCUPIED, counters)
        elif weight <= rule.free_below and cells[index] != FREE:
            set_cell(grid.cells, row, col, FREE, counters)


@njit(cache=True, nogil=True)
def _count_into(beams: _Beams, i: int, row: int, col: int, is_near: bool) -> int:
    """How many beams go into a cell that beam i ends in: neighbours, the last beam's the first.

    Those into a cell that the robot stands in or, `is_near`, at the border of, may lie anywhere.
    """
    size, count, done = beams.length.size, 0, 0
    for side in (1, -1):
        n, beside = (i, 0) if side == 1 else ((i - 1) % size, 0)
        # Two in a row that pass the cell by are the end: one alone may by rounding, at a corner.
        while done < size and (is_near or beside < 2):
            passes, enters = _goes_into(beams, n, row, col)
            beside = 0 if passes else beside + 1
            count += enters
            n = (n + side) % size
            done += 1
    return count


@njit(cache=True, nogil=True)
def _goes_into(beams: _Beams, i: int, row: int, col: int) -> tuple[bool, bool]:
    """Whether a beam, if long enough, crosses a cell as `_crossed_cells` walks, and whether it is."""
    x, y, dx, dy, length = beams.x, beams.y, beams.dx[i], beams.dy[i], beams.length[i]
    right, up = col + 0.5 - x, row + 0.5 - y
    if abs(dx * up - dy * right) > 0.5 * (abs(dx) + abs(dy)) + 1e-6:
        return False, False
    along, across, slope, per_along, per_across, x_leads = ray_frame(x, y, dx, dy)
    ahead_x = col - int(x) if dx >= 0.0 else int(x) - col
    ahead_y = row - int(y) if dy >= 0.0 else int(y) - row
    k, j = (ahead_x, ahead_y) if x_leads else (ahead_y, ahead_x)
    if k < 0 or j < 0:
        return False, False
    # It comes into column k across border k along, and may cross one border across inside.
    first = int(across + slope * (k - along)) if k > 0 else 0
    if j == first:
        return True, length >= 0.0 and (k == 0 or (k - along) * per_along <= length)
    last = int(across + slope * (k + 1 - along))
    return j == last, j == last and length >= 0.0 and (j - across) * per_across <= length


@njit(cache=True, nogil=True)
def _crossed_cells(beams: _Beams, increment: float, rows: int, cols: int) -> tuple[Ints, int]:
    """Indices of all cells that beams cross, some of them several times, at the front, and how many."""
    # Of each beam two cells a column, and three more.
    starts, bound = _starts(beams.length, increment), 0
    for i in range(starts.size):
        bound += 2 * int(max(min(beams.length[i], 1.0 * (rows + cols)) - starts[i], 0.0)) + 7
    crossed, total = np.empty(bound, np.int64), 0
    x, y = beams.x, beams.y
    first = int(y) * cols + int(x)
    for i in range(beams.length.size):
        dx, dy, length = beams.dx[i], beams.dy[i], beams.length[i]
        if length < 0.0:
            continue
        along, across, slope, _, per_across, x_leads = ray_frame(x, y, dx, dy)
        columns_per_length = max(abs(dx), abs(dy))
        step_x, step_y = (1 if dx >= 0.0 else -1), (cols if dy >= 0.0 else -cols)
        step_along, step_across = (step_x, step_y) if x_leads else (step_y, step_x)
        # The ray stays in the grid as long as it has met fewer borders than there are cells ahead of it.
        ahead_x = cols - int(x) if dx >= 0.0 else int(x) + 1
        ahead_y = rows - int(y) if dy >= 0.0 else int(y) + 1
        cells_along, cells_across = (ahead_x, ahead_y) if x_leads else (ahead_y, ahead_x)
        # `k` borders along are crossed and `j` across; of the latter, those before border `k` along.
        k = int(starts[i] * columns_per_length + along) if starts[i] > 0.0 else 0
        j = int(across + slope * (k - along)) if k > 0 else 0
        if k >= cells_along or j >= cells_across:
            continue
        index = first + k * step_along + j * step_across
        crossed[total] = index
        total += 1
        columns = min(int(length * columns_per_length + along), cells_along - 1)
        while k < columns:
            # On to the next border along: by the cell across, which may be the same, into the one behind.
            k += 1
            n = int(across + slope * (k - along))
            if n >= cells_across:
                break
            index += (n - j) * step_across
            crossed[total] = index
            total += n - j
            index += step_along
            crossed[total] = index
            total += 1
            j = n
        # The beam may end before the next border along, but behind one across.
        n = int(across + slope * (k + 1 - along))
        if n != j and n < cells_across and (n - across) * per_across <= length:
            crossed[total] = index + step_across
            total += 1
    return crossed, total


@njit(cache=True, nogil=True)
def _count_misses(
    grid: EvidenceGrid, crossed: Ints, stamp: np.uint8, rule: LogOddsRule, counters: Ints
) -> None:
    """Count a miss in each of the cells that has neither this stamp nor the next; the evidence is flat."""
    weights, touched, cells, cols = grid.log_odds, grid.touched, grid.cells.ravel(), grid.cells.shape[1]
    for n in range(crossed.size):
        index = np.uint64(crossed[n])
        if np.uint8(touched[index] - stamp) <= 1:
            continue
        touched[index] = stamp
        weight = max(weights[index] - rule.miss, rule.least)
        if weight == weights[index]:
            continue
        weights[index] = weight
        if weight <= rule.free_below and cells[index] != FREE:
            set_cell(grid.cells, crossed[n] // cols, crossed[n] % cols, FREE, counters)
