"""How measured ranges change the evidence for each cell of a grid, in log odds, and with it the cell itself.

Rays are walked as `layoutexplore.grids.rays.ray_frame` describes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.arrays import Bytes, Cells, Floats, Ints, Ints32
from layoutexplore.grids.rays import ray_frame, steps
from layoutexplore.sensing.scan_kernels import Changes, FieldOfView, new_counters, set_cell, to_changes

_ENDED = 65536
"""What a beam that ends in a cell counts in `EvidenceGrid.beams`: more than beams go into one cell."""

_END_TOLERANCE = 1e-3
"""By so much of a cell a beam is prolonged: a range rounded to float32 must not end before the wall."""


class EvidenceGrid(NamedTuple):
    """A grid and the evidence of each cell, (rows, cols).

    Attributes:
        cells: int8, the trinary grid.
        log_odds: int16, in hundredths.
        touched: uint8, the stamp of the last scan that has updated the cell.
        beams: int32, of the cells that a beam of the last scan ended in: 65536 for each of those, and 1 for
            each that went into the cell.
    """

    cells: Cells
    log_odds: NDArray[np.int16]
    touched: Bytes
    beams: Ints32


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


@njit(cache=True, nogil=True)
def _apply_thresholds(cells: Cells, index: np.uint64, weight: int, rule: LogOddsRule, counters: Ints) -> None:
    """Let a cell follow its evidence; between the thresholds it stays what it was."""
    row, col = np.int64(index) // cells.shape[1], np.int64(index) % cells.shape[1]
    if weight >= rule.occupied_above:
        if cells[row, col] != 100:
            set_cell(cells, row, col, 100, counters)
    elif weight <= rule.free_below and cells[row, col] != 0:
        set_cell(cells, row, col, 0, counters)


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
        ranges: float64 (beams,), inf where nothing was met, NaN where the beam failed.
        rule: How evidence counts.
    """
    cells, unit_x, unit_y, range_max = grid.cells, view.unit_x, view.unit_y, view.range_max
    cos, sin = math.cos(heading), math.sin(heading)
    rows, cols = cells.shape
    counters = new_counters(cells)
    if not (0.0 <= x < cols and 0.0 <= y < rows):
        return to_changes(counters)
    flat = EvidenceGrid(cells, grid.log_odds.ravel(), grid.touched.ravel(), grid.beams.ravel())
    # The cells that beams end in come first: they are judged last, when all beams into them are counted.
    ended = np.empty(unit_x.size, np.int64)
    count = 0
    for i in range(unit_x.size):
        length = ranges[i] + _END_TOLERANCE
        if math.isnan(length) or length > range_max + 2.0 * _END_TOLERANCE:
            continue
        end_x = x + length * (unit_x[i] * cos - unit_y[i] * sin)
        end_y = y + length * (unit_x[i] * sin + unit_y[i] * cos)
        if 0.0 <= end_x < cols and 0.0 <= end_y < rows:
            index = np.uint64(int(end_y) * cols + int(end_x))
            if flat.touched[index] != stamp + 1:
                flat.touched[index] = stamp + 1
                flat.beams[index] = 0
                ended[count] = index
                count += 1
            flat.beams[index] += _ENDED
    for i in range(unit_x.size):
        if math.isnan(ranges[i]):
            continue
        dx = unit_x[i] * cos - unit_y[i] * sin
        dy = unit_x[i] * sin + unit_y[i] * cos
        length = min(ranges[i] + _END_TOLERANCE, range_max)
        _update_crossed(flat, stamp, (x, y, dx, dy), length, rule, counters)
    for i in range(count):
        _update_ended(flat, np.uint64(ended[i]), rule, counters)
    return to_changes(counters)


@njit(cache=True, nogil=True)
def _update_ended(grid: EvidenceGrid, index: np.uint64, rule: LogOddsRule, counters: Ints) -> None:
    """Count a hit in a cell where enough of the beams into it ended, else a miss; the grid is flat."""
    beams, weights = grid.beams[index], grid.log_odds
    hits, into = beams // _ENDED, max(beams % _ENDED, 1)
    if 100 * hits >= rule.hit_share * into:
        weight = min(weights[index] + rule.hit, rule.most)
    else:
        weight = max(weights[index] - rule.miss, rule.least)
    weights[index] = weight
    _apply_thresholds(grid.cells, index, weight, rule, counters)


@njit(cache=True, nogil=True)
def _update_crossed(
    grid: EvidenceGrid,
    stamp: np.uint8,
    ray: tuple[float, float, float, float],
    length: float,
    rule: LogOddsRule,
    counters: Ints,
) -> None:
    """Count a miss in every cell without a stamp that a ray (x, y, dx, dy) of some length crosses.

    Where beams of this scan have ended, which the next stamp marks, the ray is only counted.

    The evidence and the stamps of the grid are flat here: raveled once a scan, not once a ray.
    """
    (x, y, dx, dy), (cells, weights, mark, beams) = ray, grid
    rows, cols = cells.shape
    along, across, slope, per_along, per_across, x_leads = ray_frame(x, y, dx, dy)
    step_along, step_across = steps(dx, dy, x_leads, cols)
    # The ray stays in the grid as long as it has met fewer borders than there are cells ahead of it.
    ahead_x = cols - int(x) if dx >= 0.0 else int(x) + 1
    ahead_y = rows - int(y) if dy >= 0.0 else int(y) + 1
    cells_along, cells_across = (ahead_x, ahead_y) if x_leads else (ahead_y, ahead_x)
    # `turned`: the border across before border k along is crossed, that one itself not yet.
    index, j, k, turned = np.uint64(int(y) * cols + int(x)), 0, 0, False
    while True:
        if mark[index] == stamp + 1:
            beams[index] += 1
        elif mark[index] != stamp:
            mark[index] = stamp
            weight = max(weights[index] - rule.miss, rule.least)
            if weight != weights[index]:
                weights[index] = weight
                _apply_thresholds(cells, index, weight, rule, counters)
        if not turned:
            k += 1
            n = int(across + slope * (k - along))
            turned = n != j
            if turned:
                if n >= cells_across or (n - across) * per_across > length:
                    break
                j = n
                index += step_across
                continue
        if k >= cells_along or (k - along) * per_along > length:
            break
        index += step_along
        turned = False
