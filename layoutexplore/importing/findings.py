"""What to correct in a floor plan that was imported: each finding in words, with its place in metres."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np
import shapely

from layoutexplore.errors import checks_arguments, counted
from layoutexplore.grids.arrays import Mask
from layoutexplore.grids.morphology import depth_inside
from layoutexplore.grids.polygons import NearbyPolygons, Point, polygons_of
from layoutexplore.maps.floorplan import Door, FloorPlan

ROBOT_RADIUS = 0.2
"""Metres; what a robot of this radius cannot get to is disconnected."""

TINY_ROOM, LOST_AREA = 1.5, 1.0
"""Square metres; smaller rooms, and larger separate pieces of floor, are found."""

NARROW_DOOR, WIDE_OPENING = 0.5, 3.0
"""Metres; narrower doors are leaks of the map, and openings wider than this tell nothing about its scale."""

THICKEST_WALL = 1.5
"""Metres; a door whose middle is farther from a room that it leads to is not in a wall of it."""

DOOR_WIDTHS = (0.7, 1.4)
"""Metres between which the median door of a building lies (0.8 to 1.2 with something for gaps and grids)."""

OPEN_BORDER = 1.0
"""Metres that two rooms touch along beside their doors; more than this lacks a wall."""

TYPICAL_DOOR, ENOUGH_DOORS = 0.9, 4
"""Metres of a usual door, and how many doors it takes to judge the scale by them."""

TYPICAL_ROOM, LARGEST_ROOM = 20.0, 5000.0
"""Square metres of a usual room, and of what half of the rooms of no building exceed."""

UNITS = {"ft": 0.3048, "cm": 0.01, "mm": 0.001, "in": 0.0254}
"""Metres of units that are taken for metres now and then."""

FINEST, LONGEST_SIDE = 0.05, 4000
"""Metres of a cell of the map on which a plan is checked, and cells of its longest side for large plans."""


@checks_arguments
def resolution_for(plan: FloorPlan) -> float:
    """Metres a cell at which a plan is looked at: 0.05 for buildings, more where metres are no metres."""
    x0, y0, x1, y1 = plan.bounds
    return max(FINEST, max(x1 - x0, y1 - y0) / LONGEST_SIDE)


class Finding(NamedTuple):
    """Something to look at: its kind, a sentence, and where it is (x, y) in metres."""

    kind: str
    text: str
    x: float
    y: float


@checks_arguments
def find_faults(plan: FloorPlan, *, radius: float = ROBOT_RADIUS) -> list[Finding]:
    r"""What looks wrong in a floor plan: its scale first, then walls, floor out of reach, rooms, and doors.

    Args:
        plan: The floor plan.
        radius: Of the robot that has to get everywhere, in metres.

    Example:
        >>> from layoutexplore.maps.tracing import floorplan_from_ascii
        >>> plan = floorplan_from_ascii("#########\n#aaa#bbb#\n#aaa#bbb#\n#########")
        >>> [finding.kind for finding in find_faults(plan)]
        ['out of reach', 'no door', 'no door']
    """
    return [*_scale(plan), *_missing_walls(plan), *_out_of_reach(plan, radius), *_rooms(plan), *_doors(plan)]


def _scale(plan: FloorPlan) -> Iterator[Finding]:
    """Doors are of one width all over the world: they tell whether metres are metres."""
    widths = np.array([door.width for door in plan.doors if door.width <= WIDE_OPENING])
    narrow = len(widths) >= ENOUGH_DOORS and float(np.median(widths)) < DOOR_WIDTHS[0]
    if len(widths) < ENOUGH_DOORS or len(widths) < len(plan.doors) / 2:
        widths = np.array([door.width for door in plan.doors])
    if len(widths) < ENOUGH_DOORS:
        yield from _scale_by_rooms(plan)
        return
    median = float(np.median(widths))
    if narrow or median > DOOR_WIDTHS[1]:
        x0, y0, x1, y1 = plan.bounds
        factor = TYPICAL_DOOR / median
        unit = next((u for u, m in UNITS.items() if 0.8 < factor / m < 1.25), "")
        hint = f" ({_asked(unit)})" if unit else ""
        yield Finding(
            "scale",
            f"the scale is doubtful: half of the {len(widths)} doors are "
            f"{'narrower' if narrow else 'wider'} than {median:.2f} m; with doors of {TYPICAL_DOOR:g} m "
            f"every length would be {factor:.2g} times what it is now{hint}",
            (x0 + x1) / 2,
            (y0 + y1) / 2,
        )


def _scale_by_rooms(plan: FloorPlan) -> Iterator[Finding]:
    """Where there are no doors to tell by: rooms that are larger than halls; doors as wide are left out."""
    median = float(np.median([room.polygon.area for room in plan.rooms])) if plan.rooms else 0.0
    if median > LARGEST_ROOM:
        x0, y0, x1, y1 = plan.bounds
        unit = min(UNITS, key=lambda name: abs(math.log(median * UNITS[name] ** 2 / TYPICAL_ROOM)))
        yield Finding(
            "scale",
            f"the scale is doubtful: half of the rooms have {median:.0f} m2 and more ({_asked(unit)})",
            (x0 + x1) / 2,
            (y0 + y1) / 2,
        )


def _asked(unit: str) -> str:
    """Whether a plan is in a unit, and what to say if it is."""
    return f"is it in {'inches' if unit == 'in' else unit}? --scale-by '1 {unit} = 1 unit'"


def _missing_walls(plan: FloorPlan) -> Iterator[Finding]:
    """Rooms drawn up to each other in a plan that has no walls at all: a robot sees through their borders."""
    if not plan.walls.is_empty or plan.source is not None:
        return
    polygons = [room.polygon for room in plan.rooms]
    pairs = shapely.STRtree(polygons).query(polygons, predicate="intersects").T if polygons else ()
    doors: defaultdict[frozenset[int], float] = defaultdict(float)
    for door in plan.doors:
        doors[frozenset(door.rooms)] += door.width
    open_borders = []
    for a, b in pairs:
        if a < b:
            border = polygons[a].intersection(polygons[b].boundary)
            first, second = plan.rooms[a].id, plan.rooms[b].id
            if border.length - doors[frozenset((first, second))] > OPEN_BORDER:
                open_borders.append((first, second, border.representative_point()))
    if open_borders:
        first, second, place = open_borders[0]
        more = f" (and {counted(len(open_borders) - 1, 'more pair')})" if len(open_borders) > 1 else ""
        yield Finding(
            "no wall",
            f"rooms {first} and {second}{more} touch along more than their doors, and the plan has no walls: "
            "a robot sees and drives through there; leave a gap between rooms, or add walls",
            place.x,
            place.y,
        )


def _out_of_reach(plan: FloorPlan, radius: float) -> Iterator[Finding]:
    resolution = resolution_for(plan)
    raster = plan.rasterize(resolution)
    open_cells = (~raster.blocked(radius)).astype(np.uint8)
    _, parts, boxes, _ = cv2.connectedComponentsWithStats(open_cells, connectivity=4, ltype=cv2.CV_32S)
    sizes = boxes[:, cv2.CC_STAT_AREA] * resolution**2
    sizes[0] = 0.0
    if len(sizes) == 1:
        x0, y0, x1, y1 = plan.bounds
        text = (
            f"a robot {2 * radius:g} m wide fits nowhere: is the scale right, and floor brighter than walls?"
        )
        yield Finding("out of reach", text, (x0 + x1) / 2, (y0 + y1) / 2)
    for part in np.argsort(-sizes)[1:]:
        if sizes[part] < LOST_AREA:
            break
        left, low, width, height = boxes[part, :4].tolist()  # its box alone: there may be thousands of parts
        row, col = _middle(parts[low : low + height, left : left + width] == part)
        x, y = raster.cell_to_world(low + row, left + col)
        yield Finding(
            "out of reach",
            f"{sizes[part]:.0f} m2 cannot be reached from the rest by a robot {2 * radius:g} m wide",
            x,
            y,
        )


def _middle(mask: Mask) -> tuple[int, int]:
    """The cell (row, col) of a mask farthest from everything else."""
    row, col = np.unravel_index(int(depth_inside(mask).argmax()), mask.shape)
    return int(row), int(col)


def _rooms(plan: FloorPlan) -> Iterator[Finding]:
    joined = {room for door in plan.doors for room in door.rooms}
    parted = _parted(plan)
    for room in plan.rooms:
        place: Point = room.polygon.representative_point().coords[0]
        name = f"room {room.id}" + (f" ({room.label})" if room.label else "")
        if room.id not in joined and len(plan.rooms) > 1 and not plan.passages.dwithin(room.polygon, FINEST):
            yield Finding("no door", f"{name} of {room.polygon.area:.1f} m2 has no door", *place)
        if room.polygon.area < TINY_ROOM:
            yield Finding("tiny room", f"{name} has only {room.polygon.area:.1f} m2", *place)
        if room.id in parted:
            told = f"walls part {name}: take them out of the plan's walls, or make a room of each part"
            yield Finding("parted room", told, *parted[room.id])


def _parted(plan: FloorPlan) -> dict[int, Point]:
    """Rooms that walls divide, as where somebody has made one of two but left the wall: where, by id."""
    walls, found = NearbyPolygons(plan.walls), dict[int, Point]()
    for room in plan.rooms:
        near = walls.around(room.polygon)
        parts = polygons_of(room.polygon.difference(near))
        if sum(part.area >= LOST_AREA for part in parts) > 1:
            across = max(polygons_of(room.polygon.intersection(near)), key=lambda part: float(part.area))
            place = across.representative_point()
            found[room.id] = (place.x, place.y)
    return found


def _doors(plan: FloorPlan) -> Iterator[Finding]:
    rooms = {room.id: room.polygon for room in plan.rooms}
    for number, door in enumerate(plan.doors):
        x, y = (door.start[0] + door.end[0]) / 2, (door.start[1] + door.end[1]) / 2
        if door.width < NARROW_DOOR:
            text = f"door {number}, {_sides(door)}, is only {door.width:.2f} m wide: a leak in a wall?"
            yield Finding("narrow door", text, x, y)
        away = max((rooms[room].distance(shapely.Point(x, y)) for room in door.rooms if room), default=0.0)
        if away > THICKEST_WALL:
            text = f"door {number}, {_sides(door)}, lies {away:.1f} m from them: is its line right?"
            yield Finding("lost door", text, x, y)


def _sides(door: Door) -> str:
    names = [f"room {room}" if room else "outside" for room in door.rooms]
    return f"between {names[0]} and {names[1]}"
