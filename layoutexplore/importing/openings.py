"""Where a robot walks from room to room without a door: wide openings, halls, and rooms that touch.

Doors are narrow and join two rooms. What else joins rooms is found on the map: each place where the robot can
be belongs to the room that is nearest along its way, and where the places of two rooms touch it walks over.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
import shapely

from layoutexplore.errors import checks_arguments
from layoutexplore.grids.arrays import Floats32, Ints, Ints32, Mask
from layoutexplore.grids.flood import spread_in_place
from layoutexplore.grids.grid import Cell
from layoutexplore.grids.morphology import depth_inside
from layoutexplore.importing.building import Building
from layoutexplore.maps.floorplan import Door
from layoutexplore.maps.raster import PlanRaster, meetings

SAME_WAY = 1.0
"""Metres; a border this near to an open door of its two rooms is that door."""


class DoorlessWay(NamedTuple):
    """A way between two rooms that is no door.

    Attributes:
        rooms: Their ids, the lower one first.
        cell: (row, col) on the way, where it is widest.
        width: Metres that are free there, twice the way to the nearest wall; at least those of the robot.
    """

    rooms: tuple[int, int]
    cell: Cell
    width: float


@checks_arguments
def find_openings(building: Building, *, radius: float) -> list[DoorlessWay]:
    """The ways between rooms that a robot can take and that are none of the plan's open doors.

    Rooms that a robot can walk between are joined by them and the doors, over other rooms where need be.

    Args:
        building: The building.
        radius: Of the robot, in metres.
    """
    grid = building.grid
    raster = PlanRaster(~grid.free, building.room_ids, grid.resolution, grid.origin)
    walkable = ~raster.blocked(radius)
    nearest = np.where(walkable, building.room_ids, 0).astype(np.int32)
    spread_in_place(nearest, walkable)
    cells, pairs = _borders(nearest)
    if not len(cells):
        return []
    far = depth_inside(grid.free)[cells[:, 0], cells[:, 1]]
    doors: dict[tuple[int, int], list[Door]] = {}
    for door in building.plan.doors:
        if door.is_open:
            doors.setdefault((min(door.rooms), max(door.rooms)), []).append(door)
    found = []
    for members in _stretches_of(cells, pairs, grid.shape):
        first, second = pairs[members[0]].tolist()
        if not _is_door(building, cells[members], doors.get((first, second), [])):
            row, col = cells[members][middle_of_widest(cells[members], far[members], 0.95)].tolist()
            # From the middle of a cell to that of a wall's: half a cell too much on either side.
            width = max(2 * radius, (2 * float(far[members].max()) - 1) * grid.resolution)
            found.append(DoorlessWay((first, second), Cell(row, col), width))
    return found


def _borders(rooms: Ints32) -> tuple[Ints, Ints]:
    """Cells int64 (n, 2) as (row, col) beside a cell of another room, and both rooms int64 (n, 2), rising."""
    cells, pairs = zip(*meetings(rooms), strict=True)
    return np.concatenate(cells), np.concatenate(pairs)


def _stretches_of(cells: Ints, pairs: Ints, shape: tuple[int, int]) -> list[Ints]:
    """Indices of the cells of each connected border of two rooms, by rising rooms."""
    border: Mask = np.zeros(shape, np.bool_)
    border[cells[:, 0], cells[:, 1]] = True
    _, parts = cv2.connectedComponents(border.astype(np.uint8), connectivity=8, ltype=cv2.CV_32S)
    keys = np.column_stack([pairs, parts[cells[:, 0], cells[:, 1]]])
    _, group = np.unique(keys, axis=0, return_inverse=True)
    order = np.argsort(group.ravel(), kind="stable")
    return np.split(order, np.flatnonzero(np.diff(group.ravel()[order])) + 1)


def _is_door(building: Building, cells: Ints, doors: list[Door]) -> bool:
    """Whether one of the doors lies on the border."""
    if not doors:
        return False
    x, y, _ = building.grid.origin  # A plan has no yaw: its axes are the rows and columns of the map.
    points = shapely.points((cells[:, ::-1] + 0.5) * building.grid.resolution + (x, y))
    return any(shapely.dwithin(points, shapely.LineString([d.start, d.end]), SAME_WAY).any() for d in doors)


def middle_of_widest(cells: Ints, far: Floats32, share: float) -> int:
    """Index of the cell nearest to the middle among those with a share of the greatest distance to walls."""
    good = np.flatnonzero(far >= share * far.max())
    away = np.linalg.norm(cells[good] - cells.mean(axis=0), axis=1)
    return int(good[away.argmin()])
