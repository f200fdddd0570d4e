"""How a scan changes the cells of a grid: the kernels behind `layoutexplore.sensing.mapper`.

`update_occupancy` casts exact rays in the true world and updates the robot's grid in the same pass. Rays
advance as `layoutexplore.grids.rays.ray_frame` describes; changes are counted meanwhile.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Bytes, Cells, Floats, Ints
from layoutexplore.grids.grid import FREE, OCCUPIED
from layoutexplore.grids.rays import ray_frame, steps

Changes = tuple[int, int, int, int, int, int, int, int]
"""What a scan changed, in this order (a plain tuple, because a kernel makes it in a third of the time):"""

NEW, NEW_OCCUPIED, FREE_CHANGE, OCCUPIED_CHANGE, ROW0, ROW1, COL0, COL1 = range(8)
"""Cells that were unknown, cells that became occupied, change of the number of free and of occupied cells,
and the box around all changed cells, half open; all 0 where nothing changed."""


class FieldOfView(NamedTuple):
    """What a lidar sees.

    Attributes:
        unit_x: float64 (n,), cosine of the beams relative to the heading.
        unit_y: float64 (n,), their sine.
        middle: Angle in radians of the middle of the field of view, relative to the heading.
        increment: Angle in radians between neighbouring beams, which are in order.
        range_max: In cells.
        dense: The rays leave no cell in sight out within this many cells of the robot. The open square around
            it, up to that size, is updated as a whole, exactly as the rays would, and they start at its
            border.
        half: The rays cover the half plane ahead, not all around; the first and the last run along its edge.
    """

    unit_x: Floats
    unit_y: Floats
    middle: float
    increment: float
    range_max: float
    dense: int
    half: bool


@njit(cache=True, nogil=True)
def new_counters(cells: Cells) -> Ints:
    """Counters int64 (8,) as `Changes`; the box is inside out, so that the first cell becomes it."""
    return np.array([0, 0, 0, 0, cells.shape[0], 0, cells.shape[1], 0])


@njit(cache=True, nogil=True)
def to_changes(counters: Ints) -> Changes:
    """What was counted."""
    if counters[ROW1] == 0:
        return 0, 0, 0, 0, 0, 0, 0, 0
    new, new_occupied, free_change, occupied_change = counters[0], counters[1], counters[2], counters[3]
    box = counters[ROW0], counters[ROW1], counters[COL0], counters[COL1]
    return new, new_occupied, free_change, occupied_change, box[0], box[1], box[2], box[3]


@njit(cache=True, nogil=True)
def _enclose(counters: Ints, row: int, col: int) -> None:
    """Extend the box to a cell."""
    counters[ROW0], counters[ROW1] = min(counters[ROW0], row), max(counters[ROW1], row + 1)
    counters[COL0], counters[COL1] = min(counters[COL0], col), max(counters[COL1], col + 1)


@njit(cache=True, nogil=True)
def set_cell(cells: Cells, row: int, col: int, value: int, counters: Ints) -> None:
    """Give a cell another value, 0 or 100."""
    old = cells[row, col]
    cells[row, col] = value
    counters[NEW] += old < 0
    counters[NEW_OCCUPIED] += value == OCCUPIED
    counters[FREE_CHANGE] += np.int64(value == FREE) - np.int64(old == FREE)
    counters[OCCUPIED_CHANGE] += np.int64(value == OCCUPIED) - np.int64(old == OCCUPIED)
    _enclose(counters, row, col)


@njit(cache=True, nogil=True)
def _free_run(cells: Cells, row: int, col0: int, col1: int, counters: Ints) -> None:
    """Make the unknown cells of a run along a row free."""
    run = cells[row, col0:col1]
    unknown = 0
    for c in range(run.size):
        unknown += run[c] < 0
    if unknown == 0:
        return
    low, high = run.size, 0
    for c in range(run.size):
        if run[c] < 0:
            run[c] = FREE
            low, high = min(low, c), c
    counters[NEW] += unknown
    counters[FREE_CHANGE] += unknown
    _enclose(counters, row, col0 + low)
    _enclose(counters, row, col0 + high)


@njit(cache=True, nogil=True)
def _free_square(
    cells: Cells, x: float, y: float, ahead: float, reach: int, half: bool, counters: Ints
) -> None:
    """Free the cells within `reach` of (x, y); with `half`, those wholly in front (`ahead` in radians)."""
    ahead_x, ahead_y = math.cos(ahead), math.sin(ahead)
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
            _free_run(cells, r, col0, col1, counters)


@njit(cache=True, nogil=True)
def _hit(cells: Cells, true_index: np.uint64, counters: Ints) -> None:
    """Make a cell, by its index in the padded world, occupied; the border of the world is no cell."""
    rows, cols = cells.shape
    row, col = np.int64(true_index) // (cols + 2) - 1, np.int64(true_index) % (cols + 2) - 1
    if 0 <= row < rows and 0 <= col < cols and cells[row, col] != OCCUPIED:
        set_cell(cells, row, col, OCCUPIED, counters)


@njit(cache=True, nogil=True)
def update_occupancy(
    clearance: Bytes, cells: Cells, x: float, y: float, heading: float, view: FieldOfView
) -> Changes:
    """Cast rays in the world: cells crossed become free unless occupied, the one that is hit occupied.

    Args:
        clearance: uint8 (rows + 2, cols + 2), `Lidar.padded_clearance`.
        cells: int8 (rows, cols), changed in place.
        x: Where the lidar stands, in cells; from outside of the grid it sees nothing. Likewise y.
        y: See x.
        heading: In radians.
        view: What it sees.
    """
    rows, cols = cells.shape
    counters = new_counters(cells)
    if not (0.0 <= x < cols and 0.0 <= y < rows):
        return to_changes(counters)
    true_start = np.uint64((int(y) + 1) * (cols + 2) + int(x) + 1)
    open_cells = int(clearance[int(y) + 1, int(x) + 1])
    if open_cells == 0:
        _hit(cells, true_start, counters)
        return to_changes(counters)
    _free_run(cells, int(y), int(x), int(x) + 1, counters)
    # The square must be open and in range up to its corners, with two cells to spare for rays that leave it.
    reach = min(open_cells - 1, view.dense, int((view.range_max - 2.0) / math.sqrt(2.0)))
    # From a point on the border of a cell a ray may touch cells that lie beside the half plane.
    on_border = x == math.floor(x) or y == math.floor(y)
    if reach >= 2 and not (view.half and on_border):
        _free_square(cells, x, y, heading + view.middle, reach, view.half, counters)
    else:
        reach = 0
    _cast_rays(clearance, cells, (x, y, heading), view, reach, counters)
    return to_changes(counters)


@njit(cache=True, nogil=True)
def _count_free(counters: Ints, count: int, first: int, last: int, cols: int) -> None:
    """Count cells of a ray that became free, the first and the last of which are given by their index."""
    counters[NEW] += count
    counters[FREE_CHANGE] += count
    _enclose(counters, first // cols, first % cols)
    _enclose(counters, last // cols, last % cols)


@njit(cache=True, nogil=True)
def _cast_rays(
    clearance: Bytes,
    cells: Cells,
    pose: tuple[float, float, float],
    view: FieldOfView,
    reach: int,
    counters: Ints,
) -> None:
    """Cast the rays from `reach` cells on, those along the edge of the half plane from 0 on."""
    (x, y, heading), unit_x, unit_y = pose, view.unit_x, view.unit_y
    cos, sin, range_max, half = math.cos(heading), math.sin(heading), view.range_max, view.half
    world, grid = clearance.ravel(), cells.ravel()
    cols, world_cols, size = cells.shape[1], clearance.shape[1], np.uint64(cells.size)
    start, true_start = np.uint64(int(y) * cols + int(x)), np.uint64((int(y) + 1) * world_cols + int(x) + 1)
    for i in range(unit_x.size):
        dx, dy = unit_x[i] * cos - unit_y[i] * sin, unit_x[i] * sin + unit_y[i] * cos
        along, across, slope, per_along, per_across, x_leads = ray_frame(x, y, dx, dy)
        step_along, step_across = steps(dx, dy, x_leads, cols)
        true_along, true_across = steps(dx, dy, x_leads, world_cols)
        k = 0 if half and (i == 0 or i == unit_x.size - 1) else reach
        j = int(across + slope * (k - along)) if k > 0 else 0
        index = start + np.uint64(k) * step_along + np.uint64(j) * step_across
        true_index = true_start + np.uint64(k) * true_along + np.uint64(j) * true_across
        fresh, first, last, is_hit = 0, size, size, False  # Of the cells that this ray frees.
        columns = int(range_max / per_along + along)
        while k < columns:
            # On to the next border along: by the cell across, which may be the same, into the one behind.
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
                    grid[beside] = FREE
                    fresh, first, last = fresh + 1, (beside if fresh == 0 else first), beside
                break
            if (grid[beside] | grid[index]) < 0:
                if grid[beside] < 0:
                    grid[beside] = FREE
                    fresh, first, last = fresh + 1, (beside if fresh == 0 else first), beside
                if grid[index] < 0:
                    grid[index] = FREE
                    fresh, first, last = fresh + 1, (index if fresh == 0 else first), index
        # The range may end before the next border along, but behind one across.
        n = int(across + slope * (k + 1 - along))
        if not is_hit and n != j and (n - across) * per_across <= range_max:
            index, true_index = index + step_across, true_index + true_across
            is_hit = world[true_index] == 0
            if not is_hit and grid[index] < 0:
                grid[index] = FREE
                fresh, first, last = fresh + 1, (index if fresh == 0 else first), index
        if is_hit and (index >= size or grid[index] != OCCUPIED):
            _hit(cells, true_index, counters)
        if fresh > 0:
            _count_free(counters, fresh, int(np.int64(first)), int(np.int64(last)), cols)
