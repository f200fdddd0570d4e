"""Floor plans from rooms that share their outlines: walls of a thickness, and doors cut through them.

Many formats draw rooms as polygons that meet in a line, with a point or a segment for a door. Walls are drawn
0.2 m thick along all outlines. The outlines of neighbouring rooms do not always coincide: slits between them
are wall, and an opening cuts through whatever lies between its two rooms.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from numba import njit
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from layoutexplore.errors import MapError, MapWarning
from layoutexplore.grids.arrays import Floats
from layoutexplore.grids.polygons import NearbyPolygons, Point, polygons_of
from layoutexplore.maps.floorplan import Door, FloorPlan, Room
from layoutexplore.maps.sizes import (
    check_crowding,
    check_outlines,
    check_overlaps,
    check_plan,
    check_work,
    squared_distance,
)

WALL_THICKNESS = 0.2
DOOR_WIDTH = 0.9
CLOSED_GAP = 0.6
"""Metres; slits between rooms up to this width are solid wall."""

WALL_REACH = 0.75
"""Metres from the outline of a room within which a door is one of it."""

MOST_OF_HALF = 0.45
"""Of the width of a door, on either side of its middle: so much at least lies between its two rooms."""

LEAST_WALL = 0.06
"""Metres; rooms whose outlines lie farther apart than this leave room for their walls."""

_LEAST_PASSAGE = 0.6
_TOUCH = 0.02


class Opening(NamedTuple):
    """A door as a file tells of it: where, how wide, and the rooms that it joins if the file says so."""

    place: Point
    width: float = DOOR_WIDTH
    rooms: tuple[int, int] | None = None


def plan_from_outlines(
    outlines: Mapping[int, Polygon],
    labels: Mapping[int, str],
    openings: Sequence[Opening],
    *,
    name: str,
    building: str = "",
    metadata: Mapping[str, str] | None = None,
    walls: Sequence[LineString] = (),
    may_be_faces: bool = False,
) -> FloorPlan:
    """A floor plan of rooms that share their outlines.

    Args:
        outlines: Room id -> valid outline in metres, in the middle of its walls.
        labels: Room id -> label.
        openings: Doors; without rooms, they join the two nearest, or the only one and the outside.
        name: The plan's name.
        building: The building's name.
        metadata: Where it comes from.
        walls: Further lines in the middle of walls.
        may_be_faces: Outlines of rooms that lie as far apart as walls are thick are the faces of the walls.

    Raises:
        MapError: There is no room, or there are more rooms, doors, corners or crossings than the limits.

    Warns:
        MapWarning: Doors that lie on no wall are left out, or rooms of which others leave nothing but walls.

    Example:
        >>> rooms = {1: shapely.box(0, 0, 4, 3), 2: shapely.box(4, 0, 8, 3)}
        >>> plan = plan_from_outlines(rooms, {1: "office"}, [Opening((4.0, 1.5))], name="pair")
        >>> plan.doors[0].rooms, round(plan.doors[0].width, 3)
        ((1, 2), 0.9)
    """
    if not outlines:
        raise MapError(f"{name}: there is no room on this floor")
    shapes = list(outlines.values())
    check_plan(name, shapes, openings)
    check_outlines(name, [*shapes, *walls], shared=True)
    check_overlaps(name, shapes)
    outlines = _without_sums(outlines, name)
    shapes = list(outlines.values())
    # Distances are measured in C, ten of them a microsecond.
    check_work(name, "doors and rooms", 0.1 * len(openings) * shapely.get_num_coordinates(shapes).sum())
    doorways = sum(opening.width for opening in openings) if may_be_faces else None
    solid = walls_along(shapes, name, walls, doorways=doorways)
    rooms, scraps = floors_between(dict(outlines), solid, {k: labels.get(k, "") for k in outlines})
    rings = shapely.STRtree([rings_of(outline) for outline in shapes])
    shapely.prepare([*rings.geometries, *shapes])
    placed = [_place(outlines, rings, opening) for opening in openings]
    doors = tuple(door for door in placed if door is not None)
    if lost := len(placed) - len(doors):
        warnings.warn(
            f"{name}: {lost} of {len(placed)} doors lie on no wall and are left out", MapWarning, stacklevel=2
        )
    return with_cut_doors(
        FloorPlan(
            name=name,
            building=building,
            rooms=rooms,
            doors=doors,
            walls=solid,
            passages=scraps,
            metadata=metadata or {},
        )
    )


def _without_sums(outlines: Mapping[int, Polygon], name: str) -> dict[int, Polygon]:
    """The outlines without those of buildings and floors, of which rooms inside leave nothing but walls."""
    shapes = np.array(list(outlines.values()), object)
    tree, areas = shapely.STRtree(shapes), shapely.area(shapes)
    kept = {}
    for (number, outline), area in zip(outlines.items(), areas.tolist(), strict=True):
        inside = np.sort(tree.query(outline, "intersects"))
        inside = inside[areas[inside] < area]
        left: BaseGeometry = outline
        if areas[inside].sum() > 0.5 * area:
            left = outline.difference(shapely.union_all(shapes[inside])).buffer(-CLOSED_GAP / 2)
        if not left.is_empty:
            kept[number] = outline
    if lost := len(outlines) - len(kept):
        warnings.warn(
            f"{name}: {lost} of {len(outlines)} rooms are the sum of others and are left out",
            MapWarning,
            stacklevel=3,
        )
    return kept or dict(outlines)


def with_cut_doors(plan: FloorPlan) -> FloorPlan:
    """The plan with its doors cut through its walls."""
    cut = shapely.union_all([plan.opening(door) for door in plan.doors])
    return replace(plan, walls=plan.walls.difference(cut))


def _place(outlines: Mapping[int, Polygon], rings: shapely.STRtree, opening: Opening) -> Door | None:
    """The door in the wall of its rooms, whose prepared borders are `rings`; None where no wall is near."""
    place = shapely.Point(opening.place)
    (x, y), far = opening.place, 2.0 * WALL_REACH
    close = np.sort(rings.query(shapely.box(x - far, y - far, x + far, y + far)))
    away = shapely.length(shapely.shortest_line(rings.geometries[close], place))  # `distance` has no index
    if away.min(initial=np.inf) > WALL_REACH:
        return None
    distances = dict(zip(np.array(list(outlines))[close].tolist(), away.tolist(), strict=True))
    rooms = opening.rooms
    # Files name rooms now and then that are nowhere near.
    if rooms is None or any(room and distances.get(room, np.inf) > far for room in rooms):
        rooms = _sides(outlines, distances, opening)
    a, b = sorted(rooms)
    if a == 0:
        foot, along = _wall_at(outlines[b], opening.place)
        start, end = (foot + sign * 0.5 * opening.width * along for sign in (-1.0, 1.0))
        return Door(start=_point_of(start), end=_point_of(end), rooms=(0, b))
    return place_door(outlines[a], outlines[b], opening.place, (a, b), opening.width)


def _sides(
    outlines: Mapping[int, Polygon], distances: Mapping[int, float], opening: Opening
) -> tuple[int, int]:
    """The room whose border is nearest, and the one across the wall from it; 0 where the outside is there.

    A door at a corner, where it cannot be as wide as it is, may be one of the room behind the corner as well.
    """
    first, *others = sorted(distances, key=lambda room: distances[room])
    foot, along = _wall_at(outlines[first], opening.place)
    through = (CLOSED_GAP + WALL_THICKNESS / 2) * np.array([-along[1], along[0]])
    line = LineString([foot - through, foot + through])
    across = [room for room in others if outlines[room].intersects(line)]
    most = distances[first] + min(MOST_OF_HALF * opening.width, CLOSED_GAP)
    at_corner = [room for room in others if distances[room] <= most]
    return first, next(iter(across or at_corner), 0)


def _point_of(values: Floats) -> Point:
    return float(values[0]), float(values[1])


def rings_of(outline: Polygon) -> BaseGeometry:
    """The border of a room: its outer ring, and those of what it runs round.

    Example:
        >>> corridor = shapely.box(0, 0, 9, 9) - shapely.box(2, 2, 7, 7)
        >>> rings_of(corridor).distance(shapely.Point(2, 4)), rings_of(corridor).length
        (0.0, 56.0)
    """
    if not outline.interiors:
        return outline.exterior
    return shapely.MultiLineString([outline.exterior, *outline.interiors])


def walls_along(
    outlines: list[Polygon], name: str, further: Sequence[LineString] = (), *, doorways: float | None = None
) -> BaseGeometry:
    """Walls along all outlines of the plan of a name and further lines, and the slits between its rooms.

    Args:
        outlines: Of the rooms.
        name: Of the plan.
        further: Lines in the middle of walls.
        doorways: Given where outlines may be faces: metres along which rooms may touch in their doors. Where
            most of the outlines lie apart, walls are around the rooms instead, and along what they share.

    Raises:
        MapError: The outlines lie so close to each other that walls of this thickness are a single tangle.
    """
    lines = shapely.union_all([*map(rings_of, outlines), *further])
    rooms = shapely.union_all(outlines)
    check_crowding(name, [lines], WALL_THICKNESS)
    check_crowding(name, [rooms], CLOSED_GAP)
    half = CLOSED_GAP / 2
    slits = rooms.buffer(half, join_style="mitre").buffer(-half, join_style="mitre").difference(rooms)
    beside = slits
    if doorways is not None and _are_apart(outlines, slits, doorways):
        around = rooms.buffer(WALL_THICKNESS, join_style="mitre", mitre_limit=2.0)
        beside = around.union(slits).difference(rooms)
        inside = rooms.buffer(_TOUCH).buffer(-2 * _TOUCH)
        lines = shapely.union_all([lines.intersection(inside), *further])
    drawn = lines.buffer(WALL_THICKNESS / 2, cap_style="square", join_style="mitre", mitre_limit=2.0)
    return shapely.union_all([drawn, beside])


def _are_apart(outlines: list[Polygon], slits: BaseGeometry, doorways: float) -> bool:
    """Whether rooms leave room for their walls: they have slits as thick as walls, and share few borders.

    Those of area graphs meet in their doors, so many metres in all.
    """
    if slits.length == 0.0 or 2.0 * slits.area / slits.length < LEAST_WALL:  # of a long strip its width
        return False
    rings = [rings_of(outline) for outline in outlines]
    whole = float(shapely.length(rings).sum())
    shared = whole - shapely.union_all(rings).length - doorways
    return bool(slits.length > 0.2 * whole and shared < 0.05 * whole)


def floors_between(
    outlines: dict[int, Polygon], walls: BaseGeometry, labels: dict[int, str]
) -> tuple[tuple[Room, ...], BaseGeometry]:
    """Rooms up to the faces of their walls, and the scraps of floor that a wall cuts off.

    Of a room around others, what lies inside of those is theirs, however large it is.
    """
    rooms, scraps = [], []
    near, shapes = NearbyPolygons(walls), np.array(list(outlines.values()), object)
    tree = shapely.STRtree(shapes)
    for number, outline in outlines.items():
        found = polygons_of(outline.difference(near.around(outline)))
        inside = np.sort(tree.query(outline, "contains")).tolist() if len(found) > 1 else list[int]()
        others = shapely.union_all([shapes[k] for k in inside if shapes[k].area < outline.area])
        parts = sorted(found, key=lambda part: (-part.difference(others).area, -part.area)) or [outline]
        rooms.append(Room(id=number, polygon=parts[0], label=labels[number]))
        scraps.extend(parts[1:])
    # Rooms around each other are cut into the same scraps over and over.
    different = {shapely.to_wkb(shapely.normalize(scrap)): scrap for scrap in scraps}
    return tuple(rooms), shapely.union_all(list(different.values()))


def open_borders(rooms: Mapping[int, Polygon], solid: BaseGeometry) -> Iterator[Opening]:
    """Openings where two rooms touch, or one begins inside of a later one, and no wall is.

    Args:
        rooms: Room id -> outline.
        solid: Walls that are there.

    Example:
        >>> rooms = {1: shapely.box(0, 0, 4, 3), 2: shapely.box(4, 0, 8, 3)}
        >>> [(opening.place, round(opening.width, 3)) for opening in open_borders(rooms, Polygon())]
        [((4.0, 1.5), 2.8)]
    """
    numbers, shapes = list(rooms), np.array(list(rooms.values()), object)
    wide = [shape.buffer(2 * _TOUCH) for shape in shapes]
    one, other = shapely.STRtree(shapes).query(shapes, "dwithin", _TOUCH)
    for i, j in zip(one.tolist(), other.tolist(), strict=True):
        if i >= j:
            continue
        border = shapes[i].exterior.intersection(wide[j]).difference(solid)
        for line in _straight(border):
            if line.length >= _LEAST_PASSAGE + WALL_THICKNESS:
                middle = line.interpolate(0.5, normalized=True)
                yield Opening((middle.x, middle.y), line.length - WALL_THICKNESS, (numbers[i], numbers[j]))


def _straight(lines: BaseGeometry) -> Iterator[LineString]:
    """The straight pieces of lines."""
    merged = shapely.line_merge(lines).simplify(_TOUCH)
    for part in shapely.get_parts(merged):
        if part.geom_type == "LineString":
            for a, b in pairwise(np.asarray(part.coords)):
                yield LineString([a, b])


def place_door(
    a: Polygon, b: Polygon, place: Point, rooms: tuple[int, int], width: float = DOOR_WIDTH
) -> Door:
    """A door through the wall near a portal's point, moved along the wall until it joins the two rooms.

    Portals often lie at the corner of a room, where an opening would run along a wall instead of through it.
    """
    shifts = np.array(sorted(np.arange(-30, 31) * 0.05, key=abs))
    found: list[tuple[float, Floats, Floats]] = []
    for outline, other in ((a, b), (b, a)):
        foot, along = _wall_at(outline, place)
        gap = _gap(other, foot, np.array([-along[1], along[0]]))
        middles, half = foot + shifts[:, None] * along + 0.5 * gap, 0.5 * float(np.hypot(*gap))
        if not _misses((a, b), middles[:1], along, half, width).any():  # where it is drawn: no better place
            found.append((0.0, middles[0], along))
            break
        scores = _misses((a, b), middles, along, half, width) + 0.1 * np.abs(shifts)
        best = int(scores.argmin())
        found.append((float(scores[best]), middles[best], along))
    _, middle, along = min(found, key=lambda candidate: round(candidate[0], 6))
    start, end = (middle + sign * 0.5 * width * along for sign in (-1.0, 1.0))
    return Door(start=_point_of(start), end=_point_of(end), rooms=rooms)


def _wall_at(outline: Polygon, place: Point) -> tuple[Floats, Floats]:
    """The point of an outline nearest to a place, and the direction of the longest edge near it."""
    # What lies between the last point of a ring and the first of the next is no edge.
    points, ring = shapely.get_coordinates(shapely.get_parts(rings_of(outline)), return_index=True)
    away = np.where(np.diff(ring) == 0, distances_to_edges(points, *place), np.inf)
    # Of thousands of edges only those are made into shapes that may be among the nearest.
    close = np.flatnonzero(away <= away.min() + 0.1)
    ends = np.stack([points[close], points[close + 1]], axis=1)
    edges = shapely.linestrings(ends)
    near = shapely.distance(edges, shapely.Point(place))
    lengths = np.where(near <= near.min() + 0.05, shapely.length(edges), 0.0)
    edge: LineString = edges[int(lengths.argmax())]
    (x0, y0), (x1, y1) = edge.coords
    along = np.array([x1 - x0, y1 - y0]) / edge.length
    foot = edge.interpolate(edge.project(shapely.Point(place)))
    return np.array([foot.x, foot.y]), along


@njit(cache=True, nogil=True)
def distances_to_edges(points: Floats, x: float, y: float) -> Floats:
    """The distance of a place from each segment between points float64 (n + 1, xy), to a rounding error."""
    found = np.empty(len(points) - 1, np.float64)
    for k in range(len(found)):
        found[k] = math.sqrt(squared_distance(x, y, points[k], points[k + 1]))
    return found


def _gap(other: Polygon, foot: Floats, across: Floats) -> Floats:
    """The way from the wall of one room straight to the other room, zero where they touch or overlap."""
    point = shapely.Point(*foot)
    if other.distance(point) < 1e-6:
        return np.zeros(2)
    nearest = shapely.shortest_line(point, other).coords[1]
    way = np.asarray(nearest) - foot
    return np.asarray(across * float(way @ across), np.float64)


def _misses(
    rooms: tuple[Polygon, Polygon], middles: Floats, along: Floats, half_gap: float, width: float
) -> Floats:
    """For each middle (n, 2) of an opening: how many of three places across it do not join the two rooms."""
    steps = np.array([-MOST_OF_HALF, 0.0, MOST_OF_HALF])[:, None] * width * along
    through_wall = (half_gap + WALL_THICKNESS / 2 + 0.25) * np.array([-along[1], along[0]])
    sides = (
        middles[:, None, None] + steps + np.stack([-through_wall, through_wall])[:, None]
    )  # (n, 2 sides, 3 places, xy)
    shapely.prepare(rooms)  # once: each of the places would be compared with all corners
    in_a, in_b = (shapely.contains_xy(room, sides[..., 0], sides[..., 1]) for room in rooms)
    through = (in_a[:, 0] & in_b[:, 1]) | (in_b[:, 0] & in_a[:, 1])
    return np.asarray(np.count_nonzero(~through, axis=1), np.float64)
