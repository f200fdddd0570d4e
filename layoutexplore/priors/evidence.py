"""What a robot has seen, as points to be matched with a plan: walls, and floor away from walls."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Cells, Floats, Floats32, Mask
from layoutexplore.grids.boxes import known_box
from layoutexplore.grids.grid import FREE, OCCUPIED, OccupancyGrid, in_cells

WALL_SPACING, FLOOR_SPACING = 0.3, 0.5
"""Metres between points of walls, and of floor."""

CLEARANCE = 0.4
"""Metres of floor points from seen walls: nearer ones say little when a plan is a little off."""

SMOOTHING = 4.0
"""Degrees: two standard deviations of the smoothing of directions, and how near their mean is taken."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """Points of a partial map, in world metres.

    Attributes:
        walls: float64 (n, 2).
        floor: float64 (m, 2), seen floor at least `CLEARANCE` from seen walls.
        area: Square metres of seen floor.
    """

    walls: Floats
    floor: Floats
    area: float

    @property
    def centre(self) -> Floats:
        """float64 (2,): the middle of the walls' points, of the floor's without any."""
        points = self.walls if len(self.walls) else self.floor
        return np.asarray(points.mean(axis=0) if len(points) else np.zeros(2))


def seen_points(grid: OccupancyGrid) -> Evidence:
    """The points of a grid; empty where nothing is known."""
    row0, row1, col0, col1 = known_box(grid.cells)
    if row1 <= row0 or col1 <= col0:
        return Evidence(np.zeros((0, 2)), np.zeros((0, 2)), 0.0)
    cells = np.ascontiguousarray(grid.cells[row0:row1, col0:col1])
    metres = cv2.distanceTransform((cells != OCCUPIED).astype(np.uint8), cv2.DIST_L2, 3) * grid.resolution
    if not (cells == OCCUPIED).any():
        metres[:] = 2 * CLEARANCE
    wall_step, floor_step = (in_cells(spacing, grid.resolution) for spacing in (WALL_SPACING, FLOOR_SPACING))
    walls, floor, free = _points(cells, metres.astype(np.float32), wall_step, floor_step, CLEARANCE)
    walls, floor = (grid.cells_to_world(places + np.array([row0, col0])) for places in (walls, floor))
    return Evidence(walls, floor, free * grid.resolution**2)


@njit(cache=True, nogil=True)
def _points(
    cells: Cells, distance: Floats32, wall_step: int, floor_step: int, clearance: float
) -> tuple[Floats, Floats, int]:
    """Wall cells beside floor and floor cells, one of each a square; number of free cells."""
    rows, cols = cells.shape
    walls, floor = np.empty((rows * cols, 2), np.float64), np.empty((rows * cols, 2), np.float64)
    taken = np.zeros((rows // wall_step + 1, cols // wall_step + 1), np.bool_)
    covered = np.zeros((rows // floor_step + 1, cols // floor_step + 1), np.bool_)
    count, open_count, free = 0, 0, 0
    for r in range(rows):
        for c in range(cols):
            value = cells[r, c]
            if value == FREE:
                free += 1
                # the first cell of a square that is far enough from walls stands for it
                if distance[r, c] >= clearance and not covered[r // floor_step, c // floor_step]:
                    covered[r // floor_step, c // floor_step] = True
                    floor[open_count] = r, c
                    open_count += 1
            elif value == OCCUPIED and not taken[r // wall_step, c // wall_step]:
                beside = False
                for i in range(max(r - 1, 0), min(r + 2, rows)):
                    for j in range(max(c - 1, 0), min(c + 2, cols)):
                        beside |= cells[i, j] == FREE
                if beside:
                    taken[r // wall_step, c // wall_step] = True
                    walls[count] = r, c
                    count += 1
    return walls[:count].copy(), floor[:open_count].copy(), free


def wall_direction(free: Mask) -> float:
    """The direction of most walls, in radians 0..pi/2 counter-clockwise from the columns' axis.

    Args:
        free: bool (rows, cols), floor; row 0 has the lowest y.

    Example:
        >>> wall_direction(np.pad(np.ones((30, 50), np.bool_), 5))
        0.0
    """
    smooth = cv2.GaussianBlur(free.astype(np.float32), (0, 0), 1.5)
    gx, gy = cv2.Sobel(smooth, cv2.CV_32F, 1, 0), cv2.Sobel(smooth, cv2.CV_32F, 0, 1)
    weight = np.hypot(gx, gy)
    strong = weight > 0.5 * weight.max(initial=1e-9)
    if not strong.any():
        return 0.0
    quarter = np.degrees(np.arctan2(gy[strong], gx[strong])) % 90.0
    counts = np.bincount(np.rint(2 * quarter).astype(int) % 180, weights=weight[strong], minlength=180)
    degrees = 0.5 * np.arange(-90, 90)
    kernel = np.exp(-0.5 * (degrees / (0.5 * SMOOTHING)) ** 2)
    smoothed = np.real(np.fft.ifft(np.fft.fft(counts) * np.fft.fft(np.fft.ifftshift(kernel))))
    best = 0.5 * float(smoothed.argmax())
    # The mean of what lies near the best direction, seen from there.
    apart = (quarter - best + 45.0) % 90.0 - 45.0
    near = np.abs(apart) < SMOOTHING
    fine = best + float(np.average(apart[near], weights=weight[strong][near])) if near.any() else best
    return math.radians(round(fine, 3) % 90.0)
