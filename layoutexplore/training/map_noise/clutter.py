"""What stands in rooms and doors and is in no floor plan: desks, chairs, leaves half open, jambs, glass."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from layoutexplore.grids.arrays import Bytes, Floats, Ints32, Mask
from layoutexplore.grids.grid import in_cells
from layoutexplore.grids.morphology import with_neighbours
from layoutexplore.maps.floorplan import Door, FloorPlan
from layoutexplore.maps.raster import PlanRaster

DESKED = 12.0
"""Rooms from this area on may have rows of desks [m2]."""


def draw_desks(
    canvas: Bytes, rooms: Ints32, share: float, resolution: float, rng: np.random.Generator
) -> None:
    """Rows of desks on four legs with chairs, or of solid ones, in some of the large rooms.

    Args:
        canvas: uint8 (rows, cols), takes ones.
        rooms: int32 (rows, cols), room of each cell, 0 for none.
        share: Of the large rooms that have desks.
        resolution: Metres a cell.
        rng: Source of randomness.
    """
    areas = np.bincount(rooms.ravel()) * resolution**2
    for room in np.flatnonzero(areas >= DESKED):
        if room == 0 or rng.random() >= share:
            continue
        cells = np.argwhere(rooms == room)
        (row0, col0), (row1, col1) = cells.min(0), cells.max(0)
        length, depth = (in_cells(float(rng.uniform(*ends)), resolution) for ends in ((1.0, 1.8), (0.6, 0.9)))
        aisle, solid = in_cells(float(rng.uniform(0.7, 1.6)), resolution), rng.random() < 0.25
        border = in_cells(float(rng.uniform(0.1, 0.9)), resolution)
        drawn = np.zeros_like(canvas)
        for row in range(int(row0) + border, int(row1) - depth, depth + aisle):
            for col in range(int(col0) + border, int(col1) - length, length + in_cells(0.1, resolution)):
                if rng.random() < 0.85:
                    _draw_desk(drawn, (row, col), (depth, length), solid, rng)
        canvas[(drawn > 0) & (rooms == room)] = 1


def _draw_desk(
    canvas: Bytes, at: tuple[int, int], size: tuple[int, int], solid: bool, rng: np.random.Generator
) -> None:
    (row, col), (depth, length) = at, size
    if solid:
        canvas[row : row + depth, col : col + length] = 1
        return
    for r, c in ((row, col), (row, col + length), (row + depth, col), (row + depth, col + length)):
        canvas[r : r + 1, c : c + 1 + int(rng.integers(2))] = 1
    middle = col + length // 2 + int(rng.integers(-2, 3))
    for r, c in ((row + depth + 1, middle), (row + depth + 4, middle + 3), (row + depth + 4, middle - 3)):
        canvas[r : r + 1, c : c + 1] = 1


def draw_leaves(
    canvas: Bytes,
    plan: FloorPlan,
    raster: PlanRaster,
    *,
    leaves: float,
    recesses: float,
    rng: np.random.Generator,
) -> None:
    """Door leaves that stand half open, and jambs that make recesses of doors.

    Args:
        canvas: uint8 (rows, cols), takes ones.
        plan: Tells of the doors.
        raster: Of the plan, tells where cells lie.
        leaves: Share of the doors with a leaf.
        recesses: Share with a recess 0.2 to 0.6 m deep.
        rng: Source of randomness.
    """
    for door in plan.doors:
        if not (door.is_open and 0.4 < door.width < 2.5):
            continue
        start, end = _ends(door, raster)
        along = end - start
        across = (
            np.array([-along[1], along[0]]) * (1 if rng.random() < 0.5 else -1) / max(np.hypot(*along), 1)
        )
        if rng.random() < leaves:
            hinge, turn = (start, along) if rng.random() < 0.5 else (end, -along)
            angle = float(rng.uniform(0.6, 1.9))
            tip = hinge + np.cos(angle) * turn + np.sin(angle) * np.hypot(*along) * across
            _line(canvas, [hinge, tip])
        if rng.random() < recesses:
            deep = across * float(rng.uniform(0.3, 0.7)) / raster.resolution
            for jamb in (start, end):
                _line(canvas, [jamb, jamb + deep])


def _ends(door: Door, raster: PlanRaster) -> tuple[Floats, Floats]:
    """The ends of an opening (x, y) in cells."""
    corner = np.array([raster.origin.x, raster.origin.y])
    start, end = (np.array(point, np.float64) for point in (door.start, door.end))
    return (start - corner) / raster.resolution, (end - corner) / raster.resolution


def _line(canvas: Bytes, points: Sequence[Floats]) -> None:
    (x0, y0), (x1, y1) = np.rint(points).astype(int).tolist()
    cv2.line(canvas, (x0, y0), (x1, y1), 1, 1)


def glass_of(walls: Mask, outside: Mask, rate: float, resolution: float, rng: np.random.Generator) -> Mask:
    """Strips of the walls towards the outside, and a few inside, that beams may pass: bool (rows, cols).

    Args:
        walls: bool (rows, cols).
        outside: bool (rows, cols), space that belongs to no building.
        rate: Strips for ten metres of wall towards the outside.
        resolution: Metres a cell.
        rng: Source of randomness.
    """
    reach = in_cells(0.3, resolution)
    places = np.argwhere(walls & with_neighbours(outside, reach))
    strips = np.zeros(walls.shape, np.uint8)
    metres = len(places) * resolution / (reach + 0.5)
    for row, col in (
        places[rng.integers(len(places), size=rng.poisson(rate * metres / 10))] if len(places) else ()
    ):
        half = in_cells(float(rng.uniform(0.3, 1.3)), resolution)
        cv2.circle(strips, (int(col), int(row)), half, 1, cv2.FILLED)
    return walls & (strips > 0)
