"""How a scan changes the cells of a grid: the kernels behind `layoutexplore.sensing.mapper`.

`cast_and_mark` casts exact rays in the true world and marks the robot's grid in the same pass. `weigh` takes
measured ranges as evidence. Both walk rays as `layoutexplore.grids.rays.trace` describes and keep a tally
of what they change.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.rays import steps, trace

Changes = tuple[int, int, int, int, int, int, int, int]
"""New cells, new occupied, change of the number of free and of occupied cells, and the box (row0, row1, col0, col1)."""

_NEW, _NEW_OCCUPIED, _FREE_CHANGE, _OCCUPIED_CHANGE, _ROW_LOW, _ROW_HIGH, _COL_LOW, _COL_HIGH = range(8)
_END_TOLERANCE = 1e-3
"""Cells by which a beam is prolonged to find the cell it ends in: a range rounded to float32 must not end before the wall."""


@njit(cache=True, nogil=True)
def _new_tally(cells: NDArray[np.int8]) -> NDArray[np.int64]:
    return np.array([0, 0, 0, 0, cells.shape[0], -1, cells.shape[1], -1])


@njit(cache=True, nogil=True)
def _changes(tally: NDArray[np.int64]) -> Changes:
    if tally[_ROW_HIGH] < 0:
        return 0, 0, 0, 0, 0, 0, 0, 0
    box = tally[_ROW_LOW], tally[_ROW_HIGH] + 1, tally[_COL_LOW], tally[_COL_HIGH] + 1
    return (
        tally[_NEW],
        tally[_NEW_OCCUPIED],
        tally[_FREE_CHANGE],
        tally[_OCCUPIED_CHANGE],
        box[0],
        box[1],
        box[2],
        box[3],
    )


@njit(cache=True, nogil=True)
def _enclose(tally: NDArray[np.int64], row: int, col: int) -> None:
    """Stretch the tally's box to a cell."""
    tally[_ROW_LOW], tally[_ROW_HIGH] = min(tally[_ROW_LOW], row), max(tally[_ROW_HIGH], row)
    tally[_COL_LOW], tally[_COL_HIGH] = min(tally[_COL_LOW], col), max(tally[_COL_HIGH], col)


@njit(cache=True, nogil=True)
def _set(cells: NDArray[np.int8], row: int, col: int, value: int, tally: NDArray[np.int64]) -> None:
    """Give a cell another value, 0 or 100."""
    old = cells[row, col]
    cells[row, col] = value
    tally[_NEW] += old < 0
    tally[_NEW_OCCUPIED] += value == 100
    tally[_FREE_CHANGE] += np.int64(value == 0) - np.int64(old == 0)
    tally[_OCCUPIED_CHANGE] += np.int64(value == 100) - np.int64(old == 100)
    _enclose(tally, row, col)


@njit(cache=True, nogil=True)
def _free_stretch(cells: NDArray[np.int8], row: int, col0: int, col1: int, tally: NDArray[np.int64]) -> None:
    """Make the unknown cells of a stretch of a row free."""
    stretch = cells[row, col0:col1]
    unknown = 0
    for c in range(stretch.size):
        unknown += stretch[c] < 0
    if unknown == 0:
        return
    low, high = stretch.size, 0
    for c in range(stretch.size):
        if stretch[c] < 0:
            stretch[c] = 0
            low, high = min(low, c), c
    tally[_NEW] += unknown
    tally[_FREE_CHANGE] += unknown
    _enclose(tally, row, col0 + low)
    _enclose(tally, row, col0 + high)


@njit(cache=True, nogil=True)
def _free_square(
    cells: NDArray[np.int8],
    x: float,
    y: float,
    reach: int,
    half: bool,
    ahead_x: float,
    ahead_y: float,
    tally: NDArray[np.int64],
) -> None:
    """Free the square of cells within `reach` of (x, y); with `half`, those wholly in front as (ahead_x, ahead_y) points."""
    row, col = int(y), int(x)
    for r in range(row - reach, row + reach + 1):
        col0, col1 = col - reach, col + reach + 1
        if half:
            # A cell is wholly in front where ahead . (centre - position) is at least half its width seen
            # along ahead.
            least = 0.5 * (abs(ahead_x) + abs(ahead_y)) - 1e-9 - ahead_y * (r + 0.5 - y)
            if abs(ahead_x) < 1e-12:
                if least > 0.0:
                    continue
            elif ahead_x > 0.0:
                col0 = max(col0, math.ceil(min(max(least / ahead_x + x - 0.5, col0 - 1.0), col1 + 1.0)))
            else:
                col1 = min(col1, math.floor(max(min(least / ahead_x + x - 0.5, col1 + 1.0), col0 - 2.0)) + 1)
        if col1 > col0:
            _free_stretch(cells, r, col0, col1, tally)


@njit(cache=True, nogil=True)
def _hit(cells: NDArray[np.int8], true_index: np.uint64, tally: NDArray[np.int64]) -> None:
    """Make a cell, given by its index in the padded world, occupied; the border around the world is no cell."""
    rows, cols = cells.shape
    row, col = np.int64(true_index) // (cols + 2) - 1, np.int64(true_index) % (cols + 2) - 1
    if 0 <= row < rows and 0 <= col < cols and cells[row, col] != 100:
        _set(cells, row, col, 100, tally)


@njit(cache=True, nogil=True)
def cast_and_mark(
    clearance: NDArray[np.uint8],
    cells: NDArray[np.int8],
    x: float,
    y: float,
    cos: float,
    sin: float,
    unit_x: NDArray[np.float64],
    unit_y: NDArray[np.float64],
    range_max: float,
    dense: int,
    half: bool,
    ahead_x: float,
    ahead_y: float,
) -> Changes:
    """Cast rays in the world: cells crossed become free unless they are occupied, the cell that is hit occupied.

    Args:
        clearance: uint8 (rows + 2, cols + 2), `Lidar.padded_clearance`.
        cells: int8 (rows, cols), changed in place.
        x: Position in cells; likewise y.
        y: See x.
        cos: Cosine of the heading by which the beams are turned; likewise sin.
        sin: See cos.
        unit_x: float64 (beams,), the beams' directions relative to the heading; likewise unit_y.
        unit_y: See unit_x.
        range_max: In cells.
        dense: The rays leave no cell in sight out within this many cells of the robot. The open square around
            it, up to that size, is marked as a whole, exactly as the rays would mark it, and the rays start
            at its border.
        half: The rays cover the half plane ahead, not all around; the first and the last of them run along
            its edge.
        ahead_x: Direction of the middle of the field of view; likewise ahead_y.
        ahead_y: See ahead_x.
    """
    rows, cols = cells.shape
    tally = _new_tally(cells)
    if not (0.0 <= x < cols and 0.0 <= y < rows):
        return _changes(tally)
    true_start = np.uint64((int(y) + 1) * (cols + 2) + int(x) + 1)
    open_cells = int(clearance[int(y) + 1, int(x) + 1])
    if open_cells == 0:
        _hit(cells, true_start, tally)
        return _changes(tally)
    _free_stretch(cells, int(y), int(x), int(x) + 1, tally)
    reach = min(open_cells - 1, dense, int((range_max - 2.0) / math.sqrt(2.0)))
    # From a point on the border of a cell a ray may touch cells that lie beside the half plane.
    on_border = x == math.floor(x) or y == math.floor(y)
    if reach >= 2 and not (half and on_border):
        _free_square(cells, x, y, reach, half, ahead_x, ahead_y, tally)
    else:
        reach = 0
    _cast_rays(clearance, cells, (x, y, cos, sin), (unit_x, unit_y), range_max, reach, half, tally)
    return _changes(tally)


@njit(cache=True, nogil=True)
def _count_free(tally: NDArray[np.int64], count: int, first: int, last: int, cols: int) -> None:
    """Count cells of a ray that became free, the first and the last of which are given by their index."""
    tally[_NEW] += count
    tally[_FREE_CHANGE] += count
    _enclose(tally, first // cols, first % cols)
    _enclose(tally, last // cols, last % cols)


@njit(cache=True, nogil=True)
def _cast_rays(
    clearance: NDArray[np.uint8],
    cells: NDArray[np.int8],
    pose: tuple[float, float, float, float],
    beams: tuple[NDArray[np.float64], NDArray[np.float64]],
    range_max: float,
    reach: int,
    half: bool,
    tally: NDArray[np.int64],
) -> None:
    """Cast the rays from `reach` cells on (those along the edge of the half plane from 0 on); pose is (x, y, cos, sin)."""
    (x, y, cos, sin), (unit_x, unit_y) = pose, beams
    world, grid = clearance.ravel(), cells.ravel()
    cols, world_cols, size = cells.shape[1], clearance.shape[1], np.uint64(cells.size)
    start, true_start = np.uint64(int(y) * cols + int(x)), np.uint64((int(y) + 1) * world_cols + int(x) + 1)
    for i in range(unit_x.size):
        dx, dy = unit_x[i] * cos - unit_y[i] * sin, unit_x[i] * sin + unit_y[i] * cos
        along, across, slope, per_along, per_across, x_leads = trace(x, y, dx, dy)
        step_along, step_across = steps(dx, dy, x_leads, cols)
        true_along, true_across = steps(dx, dy, x_leads, world_cols)
        k = 0 if half and (i == 0 or i == unit_x.size - 1) else reach
        j = int(across + slope * (k - along)) if k > 0 else 0
        index = start + np.uint64(k) * step_along + np.uint64(j) * step_across
        true_index = true_start + np.uint64(k) * true_along + np.uint64(j) * true_across
        fresh, first, last, is_hit = 0, size, size, False
        columns = int(range_max / per_along + along)
        while k < columns:
            # On to the next border along: the cell across, which may be the same, and the one behind that
            # border.
            k += 1
            n = int(across + slope * (k - along))
            j, turn = n, np.uint64(n - j)
            beside, true_beside = index + turn * step_across, true_index + turn * true_across
            index, true_index = beside + step_along, true_beside + true_along
            if (world[true_beside] == 0) | (world[true_index] == 0):
                is_hit = True
                if world[true_beside] == 0:
                    index, true_index = beside, true_beside
                elif grid[beside] < 0:
                    grid[beside] = 0
                    fresh, first, last = fresh + 1, (beside if fresh == 0 else first), beside
                break
            if (grid[beside] | grid[index]) < 0:
                if grid[beside] < 0:
                    grid[beside] = 0
                    fresh, first, last = fresh + 1, (beside if fresh == 0 else first), beside
                if grid[index] < 0:
                    grid[index] = 0
                    fresh, first, last = fresh + 1, (index if fresh == 0 else first), index
        # The range may end before the next border along, but behind one across.
        n = int(across + slope * (k + 1 - along))
        if not is_hit and n != j and (n - across) * per_across <= range_max:
            index, true_index = index + step_across, true_index + true_across
            is_hit = world[true_index] == 0
            if not is_hit and grid[index] < 0:
                grid[index] = 0
                fresh, first, last = fresh + 1, (index if fresh == 0 else first), index
        if is_hit and (index >= size or grid[index] != 100):
            _hit(cells, true_index, tally)
        if fresh > 0:
            _count_free(tally, fresh, int(np.int64(first)), int(np.int64(last)), cols)


@njit(cache=True, nogil=True)
def _judge(
    cells: NDArray[np.int8],
    index: np.uint64,
    weight: int,
    limits: NDArray[np.int64],
    tally: NDArray[np.int64],
) -> None:
    """Let a cell follow its evidence; limits are (least, most, free at or below, occupied at or above)."""
    row, col = np.int64(index) // cells.shape[1], np.int64(index) % cells.shape[1]
    if weight >= limits[3]:
        if cells[row, col] != 100:
            _set(cells, row, col, 100, tally)
    elif weight <= limits[2] and cells[row, col] != 0:
        _set(cells, row, col, 0, tally)


@njit(cache=True, nogil=True)
def weigh(
    cells: NDArray[np.int8],
    evidence: NDArray[np.int16],
    touched: NDArray[np.uint8],
    stamp: np.uint8,
    x: float,
    y: float,
    cos: float,
    sin: float,
    unit_x: NDArray[np.float64],
    unit_y: NDArray[np.float64],
    ranges: NDArray[np.float64],
    range_max: float,
    hit: int,
    miss: int,
    limits: NDArray[np.int64],
) -> Changes:
    """Weigh one scan of ranges in cells: the cells that beams end in, then, where none does, the cells they cross.

    `touched` holds the `stamp` of this scan where a cell has been weighed. From outside of the grid nothing
    is weighed.
    """
    rows, cols = cells.shape
    tally = _new_tally(cells)
    if not (0.0 <= x < cols and 0.0 <= y < rows):
        return _changes(tally)
    mark, weights = touched.ravel(), evidence.ravel()
    for i in range(unit_x.size):
        length = ranges[i] + _END_TOLERANCE
        if math.isnan(length) or length > range_max + 2.0 * _END_TOLERANCE:
            continue
        end_x = x + length * (unit_x[i] * cos - unit_y[i] * sin)
        end_y = y + length * (unit_x[i] * sin + unit_y[i] * cos)
        if 0.0 <= end_x < cols and 0.0 <= end_y < rows:
            index = np.uint64(int(end_y) * cols + int(end_x))
            if mark[index] != stamp:
                mark[index] = stamp
                weight = min(weights[index] + hit, limits[1])
                weights[index] = weight
                _judge(cells, index, weight, limits, tally)
    for i in range(unit_x.size):
        if math.isnan(ranges[i]):
            continue
        dx = unit_x[i] * cos - unit_y[i] * sin
        dy = unit_x[i] * sin + unit_y[i] * cos
        length = min(ranges[i] + _END_TOLERANCE, range_max)
        _weigh_crossed(cells, weights, mark, stamp, x, y, dx, dy, length, miss, limits, tally)
    return _changes(tally)


@njit(cache=True, nogil=True)
def _weigh_crossed(
    cells: NDArray[np.int8],
    weights: NDArray[np.int16],
    mark: NDArray[np.uint8],
    stamp: np.uint8,
    x: float,
    y: float,
    dx: float,
    dy: float,
    length: float,
    miss: int,
    limits: NDArray[np.int64],
    tally: NDArray[np.int64],
) -> None:
    """Take a miss as evidence in every cell that a ray from (x, y) crosses on its way of `length` and that bears no stamp."""
    rows, cols = cells.shape
    along, across, slope, per_along, per_across, x_leads = trace(x, y, dx, dy)
    step_along, step_across = steps(dx, dy, x_leads, cols)
    # The ray stays in the grid as long as it has met fewer borders than there are cells ahead of it.
    ahead_x, ahead_y = (
        (cols - int(x) if dx >= 0.0 else int(x) + 1),
        (rows - int(y) if dy >= 0.0 else int(y) + 1),
    )
    cells_along, cells_across = (ahead_x, ahead_y) if x_leads else (ahead_y, ahead_x)
    index, j, k, turned = np.uint64(int(y) * cols + int(x)), 0, 0, False
    while True:
        if mark[index] != stamp:
            mark[index] = stamp
            weight = max(weights[index] - miss, limits[0])
            if weight != weights[index]:
                weights[index] = weight
                _judge(cells, index, weight, limits, tally)
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
