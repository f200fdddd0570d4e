"""A robot's grid map without what the building is not: specks, slivers of rays, holes of single cells."""

from __future__ import annotations

import cv2
import numpy as np

from layoutexplore.grids.arrays import Mask
from layoutexplore.grids.components import label_components
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, in_cells
from layoutexplore.grids.morphology import grow, opened_by_box, with_neighbours

SPECK_AREA = 0.03
"""Square metres; obstacles up to this area that touch nothing else are noise (a chair's leg is one, too)."""

HOLE_AREA = 0.5
"""Square metres; the unknown inside of a room up to this area is floor that no beam happened to cross."""

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
    cell = grid.resolution**2
    occupied = grid.occupied
    specks = _small(occupied, SPECK_AREA / cell, connectivity=8)
    # Of a speck in the unknown nothing more is known; in a room it is floor.
    free = grid.free | (specks & _beside(specks, grid.free))
    occupied &= ~specks
    holes = _small(~free & ~occupied, HOLE_AREA / cell, connectivity=4)
    free |= holes & ~_beside_mass(holes, occupied)
    free = _without_rays(free, grid.resolution)
    cells = np.where(occupied, OCCUPIED, np.where(free, FREE, UNKNOWN)).astype(np.int8)
    return OccupancyGrid(cells, grid.resolution, grid.origin)


def _small(mask: Mask, cells: float, *, connectivity: int) -> Mask:
    """The parts of a mask of at most so many cells."""
    _, parts, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=connectivity)
    small = stats[:, cv2.CC_STAT_AREA] <= cells
    small[0] = False
    return np.asarray(small[parts], np.bool_)


def _beside(parts: Mask, other: Mask) -> Mask:
    """The parts of a mask that touch another mask."""
    return _touching(parts, other, least=0.0)


def _beside_mass(parts: Mask, other: Mask) -> Mask:
    """The parts of a mask more than half of whose surroundings is another mask: hollows of walls."""
    return _touching(parts, other, least=0.5)


def _touching(parts: Mask, other: Mask, *, least: float) -> Mask:
    """The parts for which a share above `least` of the cells around belongs to the other mask."""
    labels, count = label_components(parts)
    rows, cols = np.nonzero(with_neighbours(parts) & ~parts)
    wide = np.pad(labels, 1)
    beside = np.sort([wide[rows + r, cols + c] for r in range(3) for c in range(3)], axis=0)
    # A cell between two parts counts for both, for each of them once.
    once = np.diff(beside, axis=0, prepend=0) > 0
    total = np.bincount(beside[once], minlength=count + 1)
    shared = np.bincount(beside[once & other[rows, cols]], minlength=count + 1)
    chosen = shared > least * np.maximum(total, 1)
    chosen[0] = False
    return np.asarray(chosen[labels], np.bool_)


def _without_rays(free: Mask, resolution: float) -> Mask:
    """The free space without its slivers; the corners of what is wide stay."""
    width = in_cells(RAY_WIDTH, resolution)
    wide = opened_by_box(free, width, width)
    if not wide.any():
        return free
    return grow(wide, free, RAY_WIDTH / resolution)
