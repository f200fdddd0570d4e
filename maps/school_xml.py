"""School buildings as XML: room polygons in image pixels with y down, doors as points on the walls.

The format is that of the floor plan set of "Predicting the layout of partially observed rooms from grid maps"
(Luperto, Arcerito, Amigoni): a scale, `space` elements with labels and a `bounding_polygon`, and `portals`
that name a line segment and the two spaces it joins. The segments of portals have no length and the walls no
thickness, so walls are drawn 0.2 m thick along the outlines of the rooms and opened by 0.9 m at every portal.
The outlines of neighbouring rooms do not always coincide: an opening cuts through whatever lies between its
two rooms.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import shapely
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from layoutexplore.errors import MapError
from layoutexplore.grids.arrays import Floats
from layoutexplore.grids.polygons import Point, polygons_of
from layoutexplore.maps.buildings import building_of
from layoutexplore.maps.floorplan import Door, FloorPlan, Room

WALL_THICKNESS = 0.2
DOOR_WIDTH = 0.9
CLOSED_GAP = 0.6
"""Metres; slits between rooms up to this width are solid wall."""

_METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "inch": 0.0254, "in": 0.0254, "ft": 0.3048}


def load_school_xml(path: Path) -> FloorPlan:
    """Read one school floor.

    Raises:
        MapError: Not XML, no scale, or no space with a polygon.
    """
    try:
        root = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, UnicodeDecodeError) as error:
        raise MapError(f"{path}: not readable as XML: {error}") from error
    scale = _scale(root, path)
    outlines, labels = _outlines(root, scale, path)
    ids = {key: number for number, key in enumerate(outlines, start=1)}
    polygons = {ids[key]: polygon for key, polygon in outlines.items()}
    walls = _walls(list(polygons.values()))
    rooms, scraps = _floors(polygons, walls, {ids[key]: label for key, label in labels.items()})
    doors = tuple(
        _place_door(polygons[a], polygons[b], point, (a, b))
        for (a, b), point in _portals(root, scale, polygons, ids)
    )
    plan = FloorPlan(name=path.stem, rooms=rooms, doors=doors)
    return FloorPlan(
        name=path.stem,
        building=building_of(path.stem, "school") or path.stem,
        rooms=rooms,
        doors=doors,
        walls=walls.difference(shapely.union_all([plan.opening(door) for door in doors])),
        passages=scraps,
        metadata={
            "format": "school XML",
            "building_type": (root.findtext("building_type/main_type") or "").lower(),
        },
    )


def _scale(root: ElementTree.Element, path: Path) -> float:
    """Metres a pixel."""
    texts = [root.findtext(f"scale/{name}/value") for name in ("represented_distance", "real_distance")]
    unit = (root.findtext("scale/real_distance/um") or "cm").strip().lower()
    try:
        pixels, real = (float(text or "") for text in texts)
    except ValueError:
        raise MapError(
            f"{path}: no usable <scale>: represented_distance and real_distance need a number each"
        ) from None
    if not (math.isfinite(pixels) and math.isfinite(real) and pixels > 0 and real > 0 and unit in _METRES):
        raise MapError(f"{path}: the scale {real:g} {unit} = {pixels:g} pixels makes no sense")
    return real * _METRES[unit] / pixels


def _outlines(
    root: ElementTree.Element, scale: float, path: Path
) -> tuple[dict[str, Polygon], dict[str, str]]:
    """Outline in metres (y up) and label of every space, by its id in the file."""
    outlines, labels = {}, {}
    for number, space in enumerate(root.iter("space"), start=1):
        key = space.get("id") or f"space {number}"
        points = [_point(node, scale, path) for node in space.iterfind("bounding_polygon/point")]
        if len(points) < 3:
            raise MapError(f"{path}: space {key}: the bounding_polygon needs 3 points, has {len(points)}")
        parts = polygons_of(Polygon(points).buffer(0))
        if not parts:
            raise MapError(f"{path}: space {key}: the bounding_polygon has no area")
        outlines[key] = Polygon(max(parts, key=lambda part: part.area).exterior)
        labels[key] = (space.findtext("labels/label") or "").strip().lower()
    if not outlines:
        raise MapError(f"{path}: no <space> with a bounding_polygon: not a floor plan of the school format")
    return outlines, labels


def _point(node: ElementTree.Element, scale: float, path: Path) -> Point:
    try:
        x, y = float(node.get("x", "")), float(node.get("y", ""))
    except ValueError:
        x = y = math.nan
    if not (math.isfinite(x) and math.isfinite(y)):
        raise MapError(f"{path}: a point has unusable coordinates x={node.get('x')!r} y={node.get('y')!r}")
    return x * scale, -y * scale


def _walls(outlines: list[Polygon]) -> BaseGeometry:
    """Walls along all outlines, and what fills the slits between neighbouring rooms."""
    lines = shapely.union_all([outline.exterior for outline in outlines])
    rooms = shapely.union_all(outlines)
    half = CLOSED_GAP / 2
    slits = rooms.buffer(half, join_style="mitre").buffer(-half, join_style="mitre").difference(rooms)
    return shapely.union_all(
        [lines.buffer(WALL_THICKNESS / 2, cap_style="square", join_style="mitre", mitre_limit=2.0), slits]
    )


def _floors(
    outlines: dict[int, Polygon], walls: BaseGeometry, labels: dict[int, str]
) -> tuple[tuple[Room, ...], BaseGeometry]:
    """Rooms up to the faces of their walls, and the scraps of floor that a wall cuts off."""
    rooms, scraps = [], []
    for number, outline in outlines.items():
        parts = sorted(polygons_of(outline.difference(walls)), key=lambda part: -part.area) or [outline]
        rooms.append(Room(id=number, polygon=parts[0], label=labels[number]))
        scraps.extend(parts[1:])
    return tuple(rooms), shapely.union_all(scraps)


def _portals(
    root: ElementTree.Element, scale: float, outlines: dict[int, Polygon], ids: dict[str, int]
) -> list[tuple[tuple[int, int], Point]]:
    """The two rooms and the place of every portal, each once (the file lists it in both rooms)."""
    segments = {line.get("id"): line.find("point") for line in root.iter("linesegment") if line.get("id")}
    found: dict[tuple[int, int], list[Point]] = {}
    lost: list[tuple[int, int]] = []
    for portal in root.iter("portal"):
        names = [node.text or "" for node in portal.iterfind("target/id")]
        if len(names) != 2 or names[0] == names[1] or not all(name in ids for name in names):
            continue
        a, b = sorted(ids[name] for name in names)
        node = segments.get(portal.findtext("linesegment"))
        if node is None:
            lost.append((a, b))
            continue
        x, y = float(node.get("x", "nan")) * scale, -float(node.get("y", "nan")) * scale
        places = found.setdefault((a, b), [])
        if all(math.dist(place, (x, y)) > DOOR_WIDTH / 2 for place in places):
            places.append((x, y))
    for pair in lost:
        # The segment that the portal names is not in the file: open where the rooms are nearest.
        if pair not in found:
            nearest = shapely.shortest_line(outlines[pair[0]].exterior, outlines[pair[1]].exterior)
            centre = nearest.centroid
            found[pair] = [(centre.x, centre.y)]
    return [(pair, place) for pair, places in found.items() for place in places]


def _place_door(a: Polygon, b: Polygon, place: Point, rooms: tuple[int, int]) -> Door:
    """A door through the wall near a portal's point, moved along the wall until it joins the two rooms.

    Portals often lie at the corner of a room, where an opening would run along a wall instead of through it.
    """
    shifts = np.array(sorted(np.arange(-30, 31) * 0.05, key=abs))
    found: list[tuple[float, Floats, Floats]] = []
    for outline, other in ((a, b), (b, a)):
        foot, along = _wall_at(outline, place)
        gap = _gap(other, foot, np.array([-along[1], along[0]]))
        middles = foot + shifts[:, None] * along + 0.5 * gap
        scores = _misses(a, b, middles, along, 0.5 * float(np.hypot(*gap))) + 0.1 * np.abs(shifts)
        best = int(scores.argmin())
        found.append((float(scores[best]), middles[best], along))
    _, middle, along = min(found, key=lambda candidate: round(candidate[0], 6))
    start, end = (middle + sign * 0.5 * DOOR_WIDTH * along for sign in (-1.0, 1.0))
    return Door(start=(float(start[0]), float(start[1])), end=(float(end[0]), float(end[1])), rooms=rooms)


def _wall_at(outline: Polygon, place: Point) -> tuple[Floats, Floats]:
    """The point of an outline nearest to a place, and the direction of the longest edge near it."""
    points = shapely.get_coordinates(outline.exterior)
    edges = shapely.linestrings(np.stack([points[:-1], points[1:]], axis=1))
    near = shapely.distance(edges, shapely.Point(place))
    lengths = np.where(near <= near.min() + 0.05, shapely.length(edges), 0.0)
    edge: LineString = edges[int(lengths.argmax())]
    (x0, y0), (x1, y1) = edge.coords
    along = np.array([x1 - x0, y1 - y0]) / edge.length
    foot = edge.interpolate(edge.project(shapely.Point(place)))
    return np.array([foot.x, foot.y]), along


def _gap(other: Polygon, foot: Floats, across: Floats) -> Floats:
    """The way from the wall of one room straight to the other room, zero where they touch or overlap."""
    point = shapely.Point(*foot)
    if other.distance(point) < 1e-6:
        return np.zeros(2)
    nearest = shapely.shortest_line(point, other).coords[1]
    way = np.asarray(nearest) - foot
    return np.asarray(across * float(way @ across), np.float64)


def _misses(a: Polygon, b: Polygon, middles: Floats, along: Floats, half_gap: float) -> Floats:
    """For each middle (n, 2) of an opening: how many of three places across it do not join the two rooms."""
    steps = np.array([-0.45, 0.0, 0.45])[:, None] * DOOR_WIDTH * along
    through_wall = (half_gap + WALL_THICKNESS / 2 + 0.25) * np.array([-along[1], along[0]])
    sides = (
        middles[:, None, None] + steps + np.stack([-through_wall, through_wall])[:, None]
    )  # (n, 2 sides, 3 places, xy)
    in_a, in_b = (shapely.contains_xy(room, sides[..., 0], sides[..., 1]) for room in (a, b))
    through = (in_a[:, 0] & in_b[:, 1]) | (in_b[:, 0] & in_a[:, 1])
    return np.asarray(np.count_nonzero(~through, axis=1), np.float64)
