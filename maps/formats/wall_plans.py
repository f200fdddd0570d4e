"""Floor plans from walls: rooms are what walls and doors leave of the floor."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence

import numpy as np
import shapely
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from layoutexplore.errors import MapError, MapWarning, checks_arguments
from layoutexplore.grids.polygons import Point, polygons_of
from layoutexplore.maps.floorplan import Door, FloorPlan, Room
from layoutexplore.maps.shared_walls import with_cut_doors
from layoutexplore.maps.sizes import check_outlines, check_plan

LEAST_ROOM = 1.0
"""Square metres; smaller pieces of floor are passages and hollows."""

DOOR_DEPTH = 0.15
"""Metres on either side of a door's line that it fills, so that it parts its rooms."""

PROBES = (0.2, 0.3, 0.45, 0.6)
"""Metres from a door's line at which its rooms are looked for."""


@checks_arguments
def plan_from_walls(
    floor: BaseGeometry,
    walls: BaseGeometry,
    doors: Sequence[LineString],
    *,
    name: str,
    building: str = "",
    places: Sequence[tuple[str, Polygon]] = (),
    metadata: Mapping[str, str] | None = None,
    where: str = "",
) -> FloorPlan:
    """A floor plan of the pieces that walls and doors cut a floor into.

    Args:
        floor: The area inside of the building.
        walls: Solid, with a thickness.
        doors: A line along the wall for each, as long as the door is wide.
        name: The plan's name.
        building: The building's name.
        places: Labels of rooms, each with an area that lies in the room.
        metadata: Where it comes from.
        where: What it is read from, for messages; its name when empty.

    Raises:
        MapError: No piece is large enough for a room, or there are more doors, corners or crossings than the
            limits.

    Warns:
        MapWarning: Doors that join no two rooms are left out.

    Example:
        >>> floor = shapely.box(0, 0, 8.2, 3)
        >>> wall = shapely.box(4, 0, 4.2, 1).union(shapely.box(4, 2, 4.2, 3))
        >>> plan = plan_from_walls(floor, wall, [LineString([(4.1, 1), (4.1, 2)])], name="pair")
        >>> len(plan.rooms), plan.doors[0].rooms
        (2, (1, 2))
    """
    where = where or name
    check_plan(where, [area for _, area in places], doors)
    check_outlines(where, [floor, walls, *doors])
    leaves = [door.buffer(DOOR_DEPTH, cap_style="square") for door in doors]
    pieces = polygons_of(shapely.make_valid(floor.difference(walls).difference(shapely.union_all(leaves))))
    rooms = [piece for piece in pieces if piece.area >= LEAST_ROOM]
    if not rooms:
        raise MapError(f"{where}: the walls leave no piece of {LEAST_ROOM:g} m2 for a room")
    tree = shapely.STRtree(rooms)
    joined = [_sides(tree, door) for door in doors]
    # The places of doors that are left out are floor like that around them.
    gaps = [leaf for leaf, (a, b) in zip(leaves, joined, strict=True) if a == b]
    if gaps:
        warnings.warn(
            f"{where}: {len(gaps)} of {len(doors)} doors join no two rooms and are left out",
            MapWarning,
            stacklevel=2,
        )
    loose = shapely.union_all([*(p for p in pieces if p.area < LEAST_ROOM), *gaps]).difference(walls)
    areas = shapely.STRtree([area for _, area in places])
    found = tuple(
        Room(id=k, polygon=room, label=_label(room, [places[i] for i in np.sort(areas.query(room))]))
        for k, room in enumerate(rooms, start=1)
    )
    return with_cut_doors(
        FloorPlan(
            name=name,
            building=building,
            rooms=found,
            doors=tuple(_door(line, (a, b)) for line, (a, b) in zip(doors, joined, strict=True) if a != b),
            walls=walls,
            passages=shapely.union_all(polygons_of(loose)),
            metadata=metadata or {},
        )
    )


def _sides(rooms: shapely.STRtree, door: LineString) -> tuple[int, int]:
    """Ids of the rooms on both sides of a door, the smaller first; 0 is none."""
    (x0, y0), (x1, y1) = door.coords[0], door.coords[-1]
    normal = np.array([y0 - y1, x1 - x0]) / max(door.length, 1e-9)
    middle = np.array([(x0 + x1) / 2, (y0 + y1) / 2])
    sides = []
    for sign in (-1.0, 1.0):
        probes = shapely.points([middle + sign * step * normal for step in PROBES])
        which, hit = rooms.query(probes, predicate="within")
        sides.append(int(hit[int(which.argmin())]) + 1 if len(hit) else 0)
    return min(sides), max(sides)


def _door(line: LineString, rooms: tuple[int, int]) -> Door:
    start, end = (_point(corner) for corner in (line.coords[0], line.coords[-1]))
    return Door(start=start, end=end, rooms=rooms)


def _point(corner: tuple[float, ...]) -> Point:
    return float(corner[0]), float(corner[1])


def _label(room: Polygon, places: Sequence[tuple[str, Polygon]]) -> str:
    """The label of the area that covers most of a room, and half of itself at least."""
    covered = [(room.intersection(area).area, label, area.area) for label, area in places]
    shares = [(share, label) for share, label, whole in covered if share > 0.5 * whole]
    return max(shares, default=(0.0, ""))[1]
