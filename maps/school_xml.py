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
import os
import warnings
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import shapely
from shapely import Polygon

from layoutexplore.errors import MapError, MapWarning, shortened
from layoutexplore.files.markup import read_xml
from layoutexplore.grids.polygons import Point, polygons_of
from layoutexplore.maps.buildings import building_of
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.formats.polygons import LEAST_ROOM, Dropped
from layoutexplore.maps.shared_walls import (
    DOOR_WIDTH,
    floors_between,
    place_door,
    walls_along,
    with_cut_doors,
)
from layoutexplore.maps.sizes import MOST_METRES, check_count, check_outlines, check_plan, check_work

_LONGEST_LABEL = 100

_METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "inch": 0.0254, "in": 0.0254, "ft": 0.3048}


def load_school_xml(path: str | os.PathLike[str]) -> FloorPlan:
    """Read one school floor.

    Raises:
        MapError: Not XML, no scale, or no space with a polygon.
    """
    path = Path(path)
    root = read_xml(path)
    scale = _scale(root, path)
    outlines, labels = read_spaces(root, scale, path)
    ids = {key: number for number, key in enumerate(outlines, start=1)}
    polygons = {ids[key]: polygon for key, polygon in outlines.items()}
    portals = _portals(root, scale, polygons, ids, path)
    walls = walls_along(list(polygons.values()), path.stem)
    rooms, scraps = floors_between(polygons, walls, {ids[key]: label for key, label in labels.items()})
    doors = tuple(place_door(polygons[a], polygons[b], point, (a, b)) for (a, b), point in portals)
    kind = (root.findtext("building_type/main_type") or "").lower()
    return with_cut_doors(
        FloorPlan(
            name=path.stem,
            building=building_of(path.stem, "school") or path.stem,
            rooms=rooms,
            doors=doors,
            walls=walls,
            passages=scraps,
            metadata={"format": "school XML", "building_type": kind},
        )
    )


def _scale(root: ElementTree.Element, path: Path) -> float:
    """Metres a pixel."""
    unit = (root.findtext("scale/real_distance/um") or "cm").strip().lower()
    found = []
    for name in ("represented_distance", "real_distance"):
        text = root.findtext(f"scale/{name}/value")
        value = _number(text)
        if value is None:
            told = "is missing" if text is None else f"is no finite number: {shortened(text)}"
            raise MapError(f"{path}: no usable <scale>: the value of {name} {told}")
        found.append(value)
    pixels, real = found
    scale = real * _METRES.get(unit, math.nan) / pixels if pixels > 0 else math.nan
    if not 0 < scale <= MOST_METRES:
        raise MapError(f"{path}: the scale {real:g} {shortened(unit)} = {pixels:g} pixels makes no sense")
    return scale


def read_spaces(
    root: ElementTree.Element, scale: float, path: Path
) -> tuple[dict[str, Polygon], dict[str, str]]:
    """Outline in metres (y up) and label of every space, by its id in the file."""
    points: dict[str, list[Point]] = {}
    labels, empty = {}, 0
    for number, space in enumerate(root.iter("space"), start=1):
        key = space.get("id") or ""
        key = f"space {number}" if not key or key in points else key  # of one id, both are rooms
        ring = [
            _point(node, scale, f"{path}: space {shortened(key)}, point {k} of its bounding_polygon")
            for k, node in enumerate(space.iterfind("bounding_polygon/point"), start=1)
        ]
        if not ring:
            empty += 1
            continue
        if len(ring) < 3:
            raise MapError(
                f"{path}: space {shortened(key)}: bounding_polygon needs 3 points, has {len(ring)}"
            )
        points[key] = ring
        labels[key] = (space.findtext("labels/label") or "").strip().lower()[:_LONGEST_LABEL]
    if not points:
        raise MapError(f"{path}: no <space> with a bounding_polygon: not a floor plan of the school format")
    if empty:
        warnings.warn(
            f"{path}: {empty} of {empty + len(points)} spaces have no bounding_polygon and are left out",
            MapWarning,
            stacklevel=4,
        )
    return _outlines(points, path), labels


def _outlines(points: dict[str, list[Point]], path: Path) -> dict[str, Polygon]:
    """The outline of each space, counted before any is cut."""
    check_count(str(path), "spaces", len(points))
    check_outlines(str(path), points.values())
    outlines, dropped = {}, Dropped(path)
    for key, ring in points.items():
        drawn = Polygon(ring)
        parts = polygons_of(drawn.buffer(0))
        if not parts:
            raise MapError(f"{path}: space {shortened(key)}: the bounding_polygon has no area")
        outlines[key] = Polygon(max(parts, key=lambda part: part.area).exterior)
        if not drawn.is_valid and shapely.make_valid(drawn).area > outlines[key].area + LEAST_ROOM:
            dropped.add("spaces cross themselves, and parts of them are left out")
    dropped.warn()
    return outlines


def _number(text: str | None) -> float | None:
    """A finite number; None of what is none."""
    try:
        value = float(text or "")
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _point(node: ElementTree.Element, scale: float, where: str) -> Point:
    """A point in metres, y up.

    Args:
        node: Has x and y in pixels.
        scale: Metres a pixel.
        where: The file and the element, for messages.
    """
    found = []
    for name in "xy":
        text = node.get(name)
        value = _number(text)
        if value is None:
            told = f"has no {name}" if text is None else f"{name}={shortened(text)} is no finite number"
            raise MapError(f"{where}: unusable coordinates: {told}")
        if abs(value * scale) > MOST_METRES:
            raise MapError(
                f"{where}: unusable coordinates: {name}={shortened(text)} is {value * scale:.3g} m from the "
                f"origin, and {MOST_METRES:g} m is the most"
            )
        found.append(value * scale)
    return found[0], -found[1]


def _portals(
    root: ElementTree.Element, scale: float, outlines: dict[int, Polygon], ids: dict[str, int], path: Path
) -> list[tuple[tuple[int, int], Point]]:
    """The two rooms and the place of every portal, each once (the file lists it in both rooms)."""
    segments = {line.get("id"): line.find("point") for line in root.iter("linesegment") if line.get("id")}
    found: dict[tuple[int, int], list[Point]] = {}
    lost: list[tuple[int, int]] = []
    kept = 0
    for portal in root.iter("portal"):
        names = [node.text or "" for node in portal.iterfind("target/id")]
        if len(names) != 2 or names[0] == names[1] or not all(name in ids for name in names):
            continue
        a, b = sorted(ids[name] for name in names)
        segment = portal.findtext("linesegment")
        node = segments.get(segment)
        if node is None:
            lost.append((a, b))
            continue
        x, y = _point(node, scale, f"{path}: linesegment {shortened(segment)}, its first point")
        places = found.setdefault((a, b), [])
        if all(math.dist(place, (x, y)) > DOOR_WIDTH / 2 for place in places):
            places.append((x, y))
            kept += 1  # counted here: each is compared with all before it
            check_count(str(path), "doors", kept)
    pairs = [*(pair for pair, points in found.items() for _ in points), *lost]
    check_plan(str(path), list(outlines), pairs)
    corners = sum(shapely.get_num_coordinates([outlines[a], outlines[b]]).sum() for a, b in pairs)
    check_work(str(path), "doors and rooms", 50.0 * corners)
    for pair in lost:
        # The segment that the portal names is not in the file: open where the rooms are nearest.
        if pair not in found:
            nearest = shapely.shortest_line(outlines[pair[0]].exterior, outlines[pair[1]].exterior)
            centre = nearest.centroid
            found[pair] = [(centre.x, centre.y)]
    return [(pair, place) for pair, places in found.items() for place in places]
