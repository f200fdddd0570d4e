"""Floors, partial maps of them, and prior plans with a known place."""

from __future__ import annotations

import math

import numpy as np
import shapely

from layoutexplore.grids.grid import OCCUPIED, UNKNOWN, OccupancyGrid
from layoutexplore.maps.floorplan import Door, FloorPlan, Room


def office(name: str = "office") -> FloorPlan:
    """Ten rooms of different widths on both sides of a corridor 30 m long, each with a door."""
    rooms = [Room(id=1, polygon=shapely.box(0, 5.0, 30.0, 7.0), label="corridor")]
    doors = []
    for low, widths in ((0.0, (4.0, 7.0, 3.0, 9.0, 6.2)), (7.2, (8.0, 3.4, 5.0, 3.6, 9.2))):
        x = 0.0
        for width in widths:
            number = len(rooms) + 1
            top = 4.8 if low == 0 else 11.0 + 0.4 * (number % 3)
            rooms.append(Room(id=number, polygon=shapely.box(x, low, x + width, top), label="office"))
            wall, middle = (4.9 if low == 0 else 7.1), x + 0.3 * width + 0.4
            doors.append(Door(start=(middle - 0.45, wall), end=(middle + 0.45, wall), rooms=(1, number)))
            x += width + 0.2
    return FloorPlan(name=name, rooms=tuple(rooms), doors=tuple(doors))


def seen_part(plan: FloorPlan, share: float) -> OccupancyGrid:
    """The map of the left part of a plan: cells up to a share of its width are known, the rest is not."""
    raster = plan.rasterize(0.1)
    cells = raster.grid.cells.copy()
    near = np.zeros(cells.shape, np.bool_)
    free = raster.free
    near[1:-1, 1:-1] = free[:-2, 1:-1] | free[2:, 1:-1] | free[1:-1, :-2] | free[1:-1, 2:]
    cells[(cells == OCCUPIED) & ~near] = UNKNOWN
    cells[:, round(share * cells.shape[1]) :] = UNKNOWN
    return OccupancyGrid(cells, raster.resolution, raster.origin)


def door_middles(plan: FloorPlan) -> np.ndarray:
    """float64 (n, 2)."""
    return np.array([np.mean([door.start, door.end], axis=0) for door in plan.doors])


def rotation(degrees: float) -> np.ndarray:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[c, -s], [s, c]])
