"""A robot's grid map without what the building is not: specks, slivers of rays, holes of single cells."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Cells, Mask
from layoutexplore.grids.boxes import known_box
from layoutexplore.grids.components import join_runs
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, in_cells
from layoutexplore.grids.morphology import grow, opened_by_box
from layoutexplore.grids.runs import find_runs

SPECK_AREA = 0.03
"""Square metres; obstacles up to this area that touch nothing else are noise (a chair's leg is one, too)."""

HOLE_AREA = 0.5
"""Square metres; the unknown inside of a room up to this area is floor that no beam happened to cross."""

HOLLOW = 0.5
"""Share of a hole's surroundings that is occupied; beyond, it is a hollow of a wall."""

RAY_WIDTH = 0.3
"""Metres; free space that is nowhere wider than this is the trace of single beams."""


def without_noise(grid: OccupancyGrid) -> OccupancyGrid:
    """The grid without specks, small holes of the unknown and slivers of rays.

    Args:
        grid: Any occupancy grid; cells between free and occupied count as unknown.

    Example:
        >>> cells = np.full((60, 60), -1, np.int8)
        >>> cells[10:50, 10:50] = 0
        >>> cells[30, 30], cells[20, 50:] = 100, 0  # a speck, and one beam through a window
        >>> clean = without_noise(OccupancyGrid(cells, 0.05))
        >>> int(clean.cells[30, 30]), int(clean.cells[20, 58])
        (0, -1)
    """
    # What is unknown all around is no small hole: a strip of it as wide as a hole is long shows that.
    margin = math.ceil(math.sqrt(HOLE_AREA) / grid.resolution) + 1
    row0, row1, col0, col1 = known_box(grid.cells, margin)
    if min(grid.shape) <= margin:
        (row0, row1), (col0, col1) = ((0, size) for size in grid.shape)
    cells = np.full(grid.shape, UNKNOWN, np.int8)
    if row0 < row1:
        part = np.ascontiguousarray(grid.cells[row0:row1, col0:col1])
        cells[row0:row1, col0:col1] = _without_noise(part, grid.resolution)
    return OccupancyGrid(cells, grid.resolution, grid.origin)


def _without_noise(cells: Cells, resolution: float) -> Cells:
    """The cells int8 (rows, cols) of a grid without noise."""
    cell, occupied, seen = resolution**2, cells == OCCUPIED, cells == FREE
    specks = _small(occupied, SPECK_AREA / cell, 1)
    # Of a speck in the unknown nothing more is known; in a room it is floor.
    free = seen | _touching(specks, seen, 0.0)
    occupied &= ~specks
    holes = _small(~(free | occupied), HOLE_AREA / cell, 0)
    free |= holes & ~_touching(holes, occupied, HOLLOW)
    free = _without_rays(free, resolution)
    return np.where(occupied, np.int8(OCCUPIED), np.where(free, np.int8(FREE), np.int8(UNKNOWN)))


@njit(cache=True, nogil=True)
def _small(mask: Mask, most: float, aside: int) -> Mask:
    """The parts of a mask of at most so many cells; `aside`: as in `join_runs`."""
    small, bits = np.zeros(mask.shape, np.bool_), mask.view(np.uint8)
    runs = find_runs(bits, np.uint8(0))
    number = join_runs(runs, bits, aside)
    sizes = np.zeros(len(runs), np.int64)
    for k in range(len(runs)):
        sizes[number[k]] += runs[k, 2] - runs[k, 1]
    for k in range(len(runs)):
        if sizes[number[k]] <= most:
            small[runs[k, 0], runs[k, 1] : runs[k, 2]] = True
    return small


@njit(cache=True, nogil=True)
def _touching(parts: Mask, other: Mask, least: float) -> Mask:
    """The parts of a mask for which a share above `least` of the cells around belongs to the other mask."""
    chosen, bits = np.zeros(parts.shape, np.bool_), parts.view(np.uint8)
    runs = find_runs(bits, np.uint8(0))
    number = join_runs(runs, bits, 0)
    total, shared = np.zeros(len(runs), np.int64), np.zeros(len(runs), np.int64)
    # A cell between two parts counts for both, for each of them once: the last that it has counted for.
    counted = np.zeros(parts.shape, np.int32)
    for k in np.argsort(number, kind="mergesort"):
        (row, first, last), n = runs[k], number[k]
        for r in range(max(row - 1, 0), min(row + 2, parts.shape[0])):
            for c in range(max(first - 1, 0), min(last + 1, parts.shape[1])):
                if not parts[r, c] and counted[r, c] != n + 1:
                    counted[r, c] = n + 1
                    total[n] += 1
                    shared[n] += other[r, c]
    for k in range(len(runs)):
        if shared[number[k]] > least * max(total[number[k]], 1):
            chosen[runs[k, 0], runs[k, 1] : runs[k, 2]] = True
    return chosen


def _without_rays(free: Mask, resolution: float) -> Mask:
    """The free space without its slivers; the corners of what is wide stay."""
    width = in_cells(RAY_WIDTH, resolution)
    wide = opened_by_box(free, width, width)
    if not wide.any():
        return free
    return grow(wide, free, RAY_WIDTH / resolution)
