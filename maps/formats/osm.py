"""OpenStreetMap XML of buildings: simple indoor tagging, and area graphs (osmAG), one floor at a time.

Simple indoor tagging: a room is a closed way, or a multipolygon, with `indoor` = room, corridor or area, a
door a node with `door` on the outline that two ways share. Corridors and areas have no walls of their own:
where two of them meet without a door it is open. Ways with `indoor` = wall are walls. osmAG: a room is a way
with `osmAG:areaType` = room, corridor, stairs or elevator, a door a way of two nodes with `osmAG:type` =
passage that tells its two areas by their ids or names. Walls have no thickness.
"""

from __future__ import annotations

import math
import os
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import shapely
from shapely import LineString, Polygon

from layoutexplore.errors import MapError, checks_arguments, shortened
from layoutexplore.files.markup import read_xml
from layoutexplore.grids.arrays import Floats
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.formats.geographic import LocalFrame
from layoutexplore.maps.formats.levels import choose_level, numbers_of
from layoutexplore.maps.formats.polygons import Dropped, room_parts
from layoutexplore.maps.shared_walls import (
    DOOR_WIDTH,
    WALL_THICKNESS,
    Opening,
    open_borders,
    plan_from_outlines,
)
from layoutexplore.maps.sizes import check_count, check_outlines, check_overlaps

INDOOR_ROOMS = ("room", "corridor", "area")
WITHOUT_WALLS = ("corridor", "area")
AREA_ROOMS = ("room", "corridor", "stairs", "elevator")


@dataclass(frozen=True)
class _Element:
    """A node, way or multipolygon with its tags; a node is its own only place, holes lie in an outline."""

    key: str
    tags: dict[str, str]
    nodes: tuple[str, ...]
    holes: tuple[tuple[str, ...], ...] = ()

    @cached_property
    def levels(self) -> frozenset[str]:
        return numbers_of(self.tags.get("level", "")) | numbers_of(self.tags.get("repeat_on", ""))

    @property
    def is_room(self) -> bool:
        if "osmAG:type" in self.tags:
            return self.tags.get("osmAG:areaType") in AREA_ROOMS
        return self.tags.get("indoor") in INDOOR_ROOMS

    @property
    def has_walls(self) -> bool:
        return "osmAG:type" in self.tags or self.tags.get("indoor") not in WITHOUT_WALLS

    @property
    def label(self) -> str:
        kind = self.tags.get("osmAG:areaType") or self.tags.get("indoor", "")
        return self.tags.get("room") or (kind if kind in ("corridor", "stairs", "elevator") else "")


@dataclass(frozen=True)
class _Building:
    """What a file holds: places of nodes by id (longitude, latitude), tagged nodes, and ways."""

    places: dict[str, tuple[float, float]]
    nodes: tuple[_Element, ...]
    ways: tuple[_Element, ...]

    def points(self, element: _Element) -> Floats:
        return self.points_of(element.nodes)

    def points_of(self, keys: Iterable[str]) -> Floats:
        return np.array([self.places[key] for key in keys if key in self.places]).reshape(-1, 2)


@dataclass(frozen=True)
class _Rooms:
    """The rooms of a floor by number, and those of each way: several where its outline falls apart."""

    outlines: dict[int, Polygon]
    of_ways: list[tuple[_Element, list[int]]]

    def nearest(self, numbers: list[int], x: float, y: float) -> int:
        """That of some rooms whose outline is nearest to a place in metres; 0 of none."""
        if len(numbers) < 2:
            return numbers[0] if numbers else 0
        place = shapely.Point(x, y)
        return min(numbers, key=lambda number: self.outlines[number].exterior.distance(place))


@checks_arguments
def osm_levels(path: str | os.PathLike[str]) -> list[str]:
    """The floors that have rooms, from below."""
    path = Path(path)
    return _levels(_read(path), path)


@checks_arguments
def load_osm(path: str | os.PathLike[str], level: str = "") -> FloorPlan:
    """Read one floor.

    Args:
        path: The file.
        level: Which floor; may be empty where there is only one.

    Raises:
        MapError: The file is broken or larger than the limits, or there is no such floor.

    Warns:
        MapWarning: Rooms or doors were left out or mended.
    """
    path = Path(path)
    building = _read(path)
    levels, unplaced = _levels(building, path), sum(way.is_room and not way.levels for way in building.ways)
    if not levels:
        lack = f"none of its {unplaced} rooms has a level in numbers (tag level=0)"
        raise MapError(
            f"{path}: no floor in this file: {lack if unplaced else 'it has no rooms (tag indoor=room)'}"
        )
    name = choose_level(path, level, levels)
    dropped = Dropped(f"{path}#{name}")
    for _ in range(unplaced):
        dropped.add("rooms without a level are left out")
    ways = [way for way in building.ways if way.is_room and name in way.levels]
    check_count(dropped.path, "rooms", len(ways))
    points_of_all = np.vstack([building.points(way) for way in ways])
    if not len(points_of_all):
        raise MapError(f"{dropped.path}: no node of this floor's rooms is in the file")
    frame = LocalFrame.around(points_of_all)
    rooms = _Rooms({}, [])
    for way in ways:
        points = frame.to_metres(building.points(way))
        if len(points) < 4 or not np.array_equal(points[0], points[-1]):
            dropped.add("rooms whose outline is not closed are left out")
            continue
        holes = [frame.to_metres(building.points_of(hole)) for hole in way.holes]
        numbers: list[int] = []
        for outline in room_parts(Polygon(points, [hole for hole in holes if len(hole) > 3]), dropped):
            numbers.append(len(rooms.outlines) + 1)
            rooms.outlines[numbers[-1]] = outline
        rooms.of_ways.append((way, numbers))
    openings = [*_doors(building, name, rooms, frame, path), *_passages(building, name, rooms, frame, path)]
    walls = _walls(building, name, frame)
    bare = [number for way, numbers in rooms.of_ways if not way.has_walls for number in numbers]
    openings += open_between(dropped.path, rooms.outlines, bare, openings, walls)
    dropped.warn()
    return plan_from_outlines(
        rooms.outlines,
        {number: way.label for way, numbers in rooms.of_ways for number in numbers},
        openings,
        walls=walls,
        name=f"{path.stem}-{name}",
        building=path.stem,
        metadata={"format": "OpenStreetMap", "level": name},
        may_be_faces=True,
    )


def _read(path: Path) -> _Building:
    """The nodes and ways of a file."""
    root = read_xml(path)
    if root.tag != "osm":
        raise MapError(f"{path}: must be OpenStreetMap XML (<osm>), got {shortened(root.tag)}")
    for kind in ("node", "way", "relation"):
        for element in [each for each in root.findall(kind) if each.get("action") == "delete"]:
            root.remove(element)  # JOSM saves with it what is deleted and not uploaded yet
    places, nodes = dict[str, tuple[float, float]](), list[_Element]()
    for node in root.iter("node"):
        key = node.get("id", "")
        places[key] = _degrees(node, key, path)
        if tags := _tags(node):
            nodes.append(_Element(key, tags, (key,)))
    ways = [_Element(way.get("id", ""), _tags(way), _line(way, places, path)) for way in root.iter("way")]
    areas = list(_multipolygons(root, {way.key: way.nodes for way in ways}, places, path))
    return _Building(places, tuple(nodes), _on_one_floor([*ways, *areas]))


def _degrees(element: ElementTree.Element, key: str, path: Path) -> tuple[float, float]:
    """The longitude and latitude of a node."""
    try:
        place = float(element.get("lon", "")), float(element.get("lat", ""))
    except ValueError:
        place = math.nan, math.nan
    if not all(abs(degrees) <= 360 for degrees in place):
        raise MapError(f"{path}: node {shortened(key)} has no usable lon and lat")
    return place


def _line(
    element: ElementTree.Element, places: dict[str, tuple[float, float]], path: Path
) -> tuple[str, ...]:
    """The nodes of a way; Overpass writes their places here where it was asked for geometry (`out geom`)."""
    keys = []
    for nd in element.findall("nd"):
        keys.append(nd.get("ref") or f"{nd.get('lon')} {nd.get('lat')}")
        if nd.get("lon") is not None and keys[-1] not in places:
            places[keys[-1]] = _degrees(nd, keys[-1], path)
    return tuple(keys)


def _on_one_floor(ways: list[_Element]) -> tuple[_Element, ...]:
    """The ways; the rooms of an area graph that says nothing of levels are on floor 0."""
    rooms = [way for way in ways if way.is_room]
    if any("osmAG:type" not in way.tags or "level" in way.tags for way in rooms):
        return tuple(ways)
    return tuple(replace(way, tags={**way.tags, "level": "0"}) if way.is_room else way for way in ways)


def _multipolygons(
    root: ElementTree.Element,
    ways: Mapping[str, tuple[str, ...]],
    places: dict[str, tuple[float, float]],
    path: Path,
) -> Iterator[_Element]:
    """The outlines of rooms that are multipolygons, each with the holes of its relation.

    Raises:
        MapError: Their corners are more than the limit; a few bytes name a way of thousands once more.
    """
    corners = 0
    for relation in root.iter("relation"):
        tags = _tags(relation)
        if tags.get("type") != "multipolygon" or not _Element("", tags, ()).is_room:
            continue
        lines: dict[bool, list[tuple[str, ...]]] = {False: [], True: []}
        for member in relation.findall("member"):
            line = ways.get(member.get("ref", "")) or _line(member, places, path)
            lines[member.get("role") == "inner"].append(line)
            corners += len(line)
            check_count(str(path), "corners of multipolygons", corners, "vertices")
        outer, inner = (_joined(lines[is_hole]) for is_hole in (False, True))
        # Every outline is cut by every hole.
        corners += (len(outer) - 1) * sum(map(len, inner)) if inner else 0
        check_count(str(path), "corners of multipolygons", corners, "vertices")
        for part, ring in enumerate(outer or [()]):  # without any line, it is told as one that is not closed
            yield _Element(f"relation/{relation.get('id', '')}/{part}", tags, ring, tuple(inner))


def _joined(lines: list[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Lines of nodes put together where they meet, until they are closed or nothing fits any more."""
    left = {number: line for number, line in enumerate(lines) if len(line) > 1}
    ends: dict[str, list[int]] = {}
    for number, line in left.items():
        ends.setdefault(line[0], []).append(number)
        ends.setdefault(line[-1], []).append(number)
    for numbers in ends.values():
        numbers.reverse()  # the first of the file is the last of the list
    rings = []
    for first in list(left):
        ring = list(left.pop(first, ()))
        while ring and ring[0] != ring[-1]:
            # Numbers are taken from the list as well as from what is left: thousands may end at one node.
            here = ends[ring[-1]]
            while here and here[-1] not in left:
                here.pop()
            if not here:
                break
            line = left.pop(here.pop())
            ring += line[1:] if line[0] == ring[-1] else line[-2::-1]
        if ring:
            rings.append(tuple(ring))
    return rings


def _tags(element: ElementTree.Element) -> dict[str, str]:
    return {tag.get("k", ""): tag.get("v", "") for tag in element.findall("tag")}


def _levels(building: _Building, path: Path) -> list[str]:
    """Names of the floors that have rooms, from below.

    Raises:
        MapError: They are more than the limit of rooms: a few bytes name two hundred.
    """
    found: set[str] = set()
    for way in building.ways:
        if way.is_room and len(way.nodes) > 3:
            found |= way.levels
            check_count(str(path), "floors", len(found))
    return sorted(found, key=float)


def _doors(
    building: _Building, level: str, rooms: _Rooms, frame: LocalFrame, path: Path
) -> Iterator[Opening]:
    """Nodes that are doors, on the outlines of this floor's rooms; `MapError` where they are too many."""
    users: dict[str, list[list[int]]] = {}
    for way, numbers in rooms.of_ways:
        for key in set(way.nodes) if numbers else ():
            users.setdefault(key, []).append(numbers)
    doors = []
    for node in building.nodes:
        if not {"door", "entrance"} & set(node.tags) or (node.levels and level not in node.levels):
            continue
        sides = users.get(node.key, [])
        if sides or node.levels:  # else somewhere else in the file
            doors.append((node, sides))
    check_count(str(path), "doors", len(doors))
    for node, sides in doors:
        x, y = frame.to_metres(building.points(node))[0].tolist()
        found = [rooms.nearest(side, x, y) for side in sides]
        pair = (found[0], found[1]) if len(found) == 2 else None
        yield Opening((x, y), _width(node.tags), pair)


def _width(tags: dict[str, str]) -> float:
    """The width that a door is tagged with, in metres; 0.9 m without a usable one."""
    try:
        width = float((tags.get("door:width") or tags.get("width") or "").removesuffix("m"))
    except ValueError:
        return DOOR_WIDTH
    return width if 0.3 < width < 20.0 else DOOR_WIDTH


def _passages(
    building: _Building, level: str, rooms: _Rooms, frame: LocalFrame, path: Path
) -> Iterator[Opening]:
    """Ways that are passages of an area graph, between areas of this floor or out of one; errors as above."""
    numbers: dict[str, list[int]] = {}
    for way, found in rooms.of_ways:
        numbers.setdefault(way.tags.get("name", ""), []).extend(found)
    # JOSM gives new ids when it saves: what it has edited names areas by their names.
    numbers |= {way.key: found for way, found in rooms.of_ways}
    passages = []
    for way in building.ways:
        if way.tags.get("osmAG:type") != "passage" or (way.levels and level not in way.levels):
            continue
        sides = [numbers.get(way.tags.get(f"osmAG:{end}") or "?", []) for end in ("from", "to")]
        if any(sides):  # else stairs to another floor, or a passage of the ground outside
            passages.append((way, sides))
    check_count(str(path), "passages", len(passages))
    for way, sides in passages:
        points = frame.to_metres(building.points(way))
        line = LineString(points) if len(points) > 1 else None
        if line is not None and line.length > 0:
            middle = line.interpolate(0.5, normalized=True)
            one, other = sorted(rooms.nearest(side, middle.x, middle.y) for side in sides)
            yield Opening((middle.x, middle.y), float(line.length), (one, other))


def _walls(building: _Building, level: str, frame: LocalFrame) -> list[LineString]:
    """Ways of this floor that are walls."""
    walls = [way for way in building.ways if way.tags.get("indoor") == "wall" and level in way.levels]
    lines = [frame.to_metres(building.points(way)) for way in walls]
    return [LineString(line) for line in lines if len(line) > 1]


@checks_arguments
def open_between(
    where: str,
    outlines: Mapping[int, Polygon],
    bare: Sequence[int],
    doors: Sequence[Opening],
    walls: Sequence[LineString] = (),
) -> list[Opening]:
    """Openings as wide as the borders of rooms without walls of their own, where neither door nor wall is.

    Args:
        where: The file, for messages.
        outlines: Room id -> outline in metres.
        bare: Ids of the rooms without walls: corridors and areas.
        doors: Those that there are; where two rooms have one, the rest of their border is wall.
        walls: Lines in the middle of walls.

    Raises:
        MapError: The outlines are more or cross more often than the limits, or the openings are too many.
    """
    check_outlines(where, [*outlines.values(), *walls], shared=True)
    check_overlaps(where, list(outlines.values()))
    ordered = sorted(bare, key=lambda number: outlines[number].area)  # what lies in another comes first
    places = shapely.STRtree([shapely.Point(door.place) for door in doors])
    solid = shapely.union_all([line.buffer(WALL_THICKNESS / 2) for line in walls])
    shut: dict[tuple[int, int], bool] = {}
    found = []
    for opening in open_borders({number: outlines[number] for number in ordered}, solid):
        pair = opening.rooms or (0, 0)
        if pair not in shut:
            near = (set(places.query(outlines[side], "dwithin", WALL_THICKNESS).tolist()) for side in pair)
            shut[pair] = bool(set.intersection(*near))
        if not shut[pair]:
            found.append(opening)
            check_count(where, "doors and open borders", len(doors) + len(found))
    return found
