"""GeoJSON of other programs, QGIS above all: polygons are rooms, lines and points are doors.

What a feature is may stand in a property (`kind`); without one, polygons are rooms, and lines of up to 10 m
and points are doors. A door drawn as a line is as wide as the line, one drawn as a polygon as wide as its
longer side, a point 0.9 m. The names of the properties are the user's: `columns` says which mean what. Where
a feature has the tag `indoor` of OpenStreetMap, the tags of all say what they are. Coordinates are metres;
degrees and Web Mercator are projected (`coordinates`).
"""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import shapely
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from layoutexplore.errors import ConfigError, MapError, MapWarning, checks_arguments, counted, shortened
from layoutexplore.files import read_json
from layoutexplore.files.reading import is_file
from layoutexplore.maps.buildings import building_of
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.formats.coordinates import declared_crs, in_metres
from layoutexplore.maps.formats.levels import numbers_of
from layoutexplore.maps.formats.osm import INDOOR_ROOMS, WITHOUT_WALLS, open_between
from layoutexplore.maps.formats.polygons import LEAST_ROOM, Dropped, geometry_of, mended, room_parts
from layoutexplore.maps.formats.wall_plans import plan_from_walls
from layoutexplore.maps.shared_walls import DOOR_WIDTH, WALL_THICKNESS, Opening, plan_from_outlines
from layoutexplore.maps.sizes import check_count, check_crowding, check_outlines

COLUMNS = {
    "room": ("label", "name", "Name", "NAME", "room"),
    "kind": ("kind", "type", "layer"),
    "width": ("width",),
}
"""Properties that are looked at, the first that is there."""

DOOR_KINDS = ("door", "doors", "opening", "portal", "entrance")
WALL_KINDS = ("wall", "walls", "line", "face", "window")
SOLID_KINDS = ("wall", "walls", "window", "inaccessible_space", "column")
FLOOR_KINDS = ("building_outline", "floor_outline", "footprint")
"""With one of these in it, a file draws the walls: rooms are what they leave of the floor."""

_NO_AREAS = ("Point", "MultiPoint", "LineString", "MultiLineString")

NESTED = 0.95
"""Share of a room inside of another, larger one, from which on it is a room in a room."""

LONGEST_DOOR = 10.0
"""Metres; longer lines are no doors."""

_LONGEST_NAME = 1000
_NO_BUILDINGS = (
    *("yes", "no", "true", "false", "apartments", "church", "civic", "college", "commercial", "dormitory"),
    *("hospital", "hotel", "house", "industrial", "kindergarten", "office", "public", "residential"),
    *("retail", "school", "train_station", "transportation", "university", "warehouse"),
)
"""Values of `building` in OpenStreetMap, which say that there is one or of what kind."""


class _Part(NamedTuple):
    """A feature: what it says it is, its properties, and its geometry as it stands in the file."""

    kind: str
    properties: Mapping[str, Any]
    geometry: BaseGeometry


@checks_arguments
def load_foreign_geojson(
    path: str | os.PathLike[str],
    columns: Mapping[str, str] | None = None,
    data: Any = None,
    unit: float | None = None,
) -> FloorPlan:
    """Read rooms and doors of a GeoJSON file that is not of our own format.

    Args:
        path: The file.
        columns: What means what: "room" -> the property with a room's label, "kind" -> the one that says
            what a feature is, "width" -> the one with a door's width, in what the file measures in.
        data: What the file holds, where that is known already.
        unit: Metres of what the file measures in, as `coordinates.in_metres` takes it; 1 when None.

    Raises:
        MapError: It holds no polygon, declares to be in feet while no unit is given, is not in metres or
            degrees, or several floors lie on each other.
        ConfigError: A column that is named is in no feature, or nothing of that name is looked for.

    Warns:
        MapWarning: Coordinates were projected, or that they are metres is a guess; features were left out
            or mended; rooms lie on each other.
    """
    path = Path(path)
    data = read_json(path) if data is None else data
    dropped = Dropped(path)
    names = _names(columns or {}, path)
    features = data.get("features") if isinstance(data, dict) else None
    if not isinstance(features, list):
        raise MapError(f"{path}: must be a GeoJSON FeatureCollection")
    parts = list(_parts(features, names, dropped))
    if not columns and any(part.properties.get("indoor") in INDOOR_ROOMS for part in parts):
        parts = _of_openstreetmap(parts, path, dropped)
    _check_one_floor(parts, path)
    shapes = in_metres([part.geometry for part in parts], path, declared_crs(data), unit)
    parts = [part._replace(geometry=shape) for part, shape in zip(parts, shapes, strict=True)]
    building = _building(data, parts, path)
    metadata = {"format": "GeoJSON of another program"}
    if unit is not None:
        metadata["scale"] = f"{unit:g} m a unit (as given)"
    _check_columns((columns or {}).values(), parts, path)
    if floor := [part.geometry for part in parts if part.kind in FLOOR_KINDS]:
        check_outlines(str(path), floor)
        whole = [polygon for part in floor for polygon in mended(part, dropped)]
        return _from_walls(path, parts, shapely.union_all(whole), dropped, building, metadata)
    return _from_areas(path, parts, names, dropped, unit or 1.0, building, metadata)


def _from_areas(
    path: Path,
    parts: list[_Part],
    names: dict[str, tuple[str, ...]],
    dropped: Dropped,
    unit: float,
    building: str,
    metadata: dict[str, str],
) -> FloorPlan:
    """A plan of rooms as polygons."""
    outlines: dict[int, Polygon] = {}
    labels: dict[int, str] = {}
    openings: list[Opening] = []
    bare: list[int] = []
    check_count(str(path), "areas", sum(_is_room(part) for part in parts))
    for part in parts:
        if part.kind in DOOR_KINDS or (not part.kind and part.geometry.geom_type != "Polygon"):
            openings += _opening(part, names, dropped, unit)
        elif not _is_room(part):
            dropped.add(f"{part.geometry.geom_type} features of kind {shortened(part.kind)} are left out")
        else:
            for outline in room_parts(part.geometry, dropped):
                number = len(outlines) + 1
                labels[number] = str(_first(part.properties, names["room"]) or "")
                outlines[number] = outline
                bare += [number] if part.properties.get("indoor") in WITHOUT_WALLS else []
    dropped.warn()
    if not outlines:
        raise MapError(f"{path}: no polygon that could be a room (--column kind=NAME names the property)")
    openings += open_between(str(path), outlines, bare, openings) if bare else []
    plan = plan_from_outlines(
        outlines, labels, openings, name=path.stem, building=building, metadata=metadata, may_be_faces=True
    )
    _tell_overlaps({room.id: outlines[room.id] for room in plan.rooms}, path)  # numbers are within the limits
    return plan


def _check_columns(columns: Iterable[str], parts: Sequence[_Part], path: Path) -> None:
    """Raise a `ConfigError` where no feature has one of the properties that were named."""
    for name in columns:
        if not any(name in part.properties for part in parts):
            tables = {id(part.properties): part.properties for part in parts}  # parts of a feature share one
            there = ", ".join(sorted({k for table in tables.values() for k in table}))[:1000]
            raise ConfigError(f"{path}: no feature has the property {name!r}; there are: {there}")


@checks_arguments
def has_areas(data: Any) -> bool:
    """Whether any feature of a FeatureCollection is an area, as rooms and outlines are and paths are not."""
    features = data.get("features") if isinstance(data, dict) else None
    listed = features if isinstance(features, list) else []
    shapes = [feature.get("geometry") for feature in listed if isinstance(feature, dict)]
    return any(isinstance(shape, dict) and shape.get("type") not in _NO_AREAS for shape in shapes)


def _building(data: Mapping[str, Any], parts: list[_Part], path: Path) -> str:
    """The building that a file is a floor of: as it says, else as all its rooms say, else by its name."""
    told_by_rooms = [part.properties.get("building") for part in parts if _is_room(part)]
    is_same = bool(told_by_rooms) and all(told == told_by_rooms[0] for told in told_by_rooms)
    for told in (data.get("building"), told_by_rooms[0] if is_same else ""):
        name = str(told) if told and isinstance(told, (str, int, float)) else ""
        if 0 < len(name) <= _LONGEST_NAME and name.lower() not in _NO_BUILDINGS:
            return name
    return building_of(path.stem, "geojson") or path.resolve().parent.name


def _is_room(part: _Part) -> bool:
    return part.geometry.geom_type == "Polygon" and part.kind not in (*DOOR_KINDS, *WALL_KINDS)


def _from_walls(
    path: Path,
    parts: list[_Part],
    floor: BaseGeometry,
    dropped: Dropped,
    building: str,
    metadata: dict[str, str],
) -> FloorPlan:
    """A plan of walls and doors, with a thickness or as lines, inside of an outline of the floor."""
    solid, lines = list[BaseGeometry](), list[LineString]()
    doors, places = list[LineString](), list[tuple[str, Polygon]]()
    for part in parts:
        if part.kind in FLOOR_KINDS:
            continue
        if isinstance(part.geometry, LineString) and part.kind in DOOR_KINDS:
            doors.append(LineString([part.geometry.coords[0], part.geometry.coords[-1]]))
        elif isinstance(part.geometry, LineString) and part.kind in SOLID_KINDS:
            lines.append(part.geometry)
        elif part.geometry.geom_type != "Polygon":
            dropped.add(f"{part.geometry.geom_type} features of kind {shortened(part.kind)} are left out")
        elif part.kind in DOOR_KINDS:
            doors.append(_middle_line(part.geometry))
        elif part.kind in SOLID_KINDS:
            solid += mended(part.geometry, dropped)
        else:
            label = str(_first(part.properties, COLUMNS["room"]) or part.kind)
            places += [(label, area) for area in mended(part.geometry, dropped)]
    dropped.warn()
    check_outlines(str(path), [*solid, *lines])
    check_crowding(str(path), lines, WALL_THICKNESS)
    solid += [line.buffer(WALL_THICKNESS / 2, cap_style="square", join_style="mitre") for line in lines]
    return plan_from_walls(
        floor,
        shapely.union_all(solid),
        [line for line in doors if 0.0 < line.length <= LONGEST_DOOR],
        name=path.stem,
        building=building,
        places=places,
        metadata=metadata,
        where=str(path),
    )


def _middle_line(shape: BaseGeometry) -> LineString:
    """The line along the middle of a longish polygon, from one short side to the other."""
    corners = shapely.get_coordinates(shape.minimum_rotated_rectangle)
    if len(corners) != 5:
        return LineString()
    sides = np.hypot(*np.diff(corners, axis=0).T)
    short = 0 if sides[0] < sides[1] else 1
    middles = (corners[:-1] + corners[1:]) / 2
    return LineString([middles[short], middles[short + 2]])


def _names(columns: Mapping[str, str], path: Path) -> dict[str, tuple[str, ...]]:
    if unknown := sorted(set(columns) - set(COLUMNS)):
        raise ConfigError(f"{path}: columns can be named for {', '.join(COLUMNS)}, not for {unknown[0]!r}")
    return {key: (columns[key],) if key in columns else usual for key, usual in COLUMNS.items()}


def _first(properties: Mapping[str, Any], names: tuple[str, ...]) -> Any:
    """The first property of these names that is there and says something."""
    return next((properties[name] for name in names if properties.get(name) not in (None, "")), None)


def _parts(features: list[Any], names: dict[str, tuple[str, ...]], dropped: Dropped) -> Iterator[_Part]:
    """Every single geometry of the features."""
    for feature in features:
        properties = (feature.get("properties") if isinstance(feature, dict) else None) or {}
        whole = geometry_of(feature)
        if whole.is_empty or not isinstance(properties, dict):
            dropped.add("features without a usable geometry are left out")
            continue
        kind = str(_first(properties, names["kind"]) or "").lower()
        for single in shapely.get_parts(whole):
            yield _Part(kind, properties, single)


def _of_openstreetmap(parts: list[_Part], path: Path, dropped: Dropped) -> list[_Part]:
    """The rooms and doors among features with tags of OpenStreetMap, if all rooms share a floor."""
    found, floors = list[tuple[_Part, frozenset[str]]](), list[frozenset[str]]()
    for part in parts:
        kind = str(part.properties.get("indoor") or "").lower()
        level = numbers_of(str(part.properties.get("level") or ""))
        if kind in INDOOR_ROOMS:
            floors += [level] if level else []
        elif any(isinstance(part.properties.get(tag), str) for tag in ("door", "entrance")):
            kind = "door"
        else:
            dropped.add("features that are no rooms, corridors, areas or doors by their tags are left out")
            continue
        found.append((part._replace(kind=kind), level))
    common = frozenset.intersection(*floors) if floors else frozenset()
    if floors and not common:
        several = ", ".join(sorted(frozenset.union(*floors), key=float)[:20])
        raise MapError(
            f"{path}: its rooms are on several floors (level {several}), which would lie on each other: save "
            "each floor in a file of its own, or all as OpenStreetMap XML (.osm), of which one floor is read"
        )
    return [part for part, level in found if not (level and common) or level & common]


def _check_one_floor(parts: list[_Part], path: Path) -> None:
    """Raise `MapError` where features say that they are on several floors: all would lie on each other."""
    told = [_first(part.properties, ("level_id", "LEVEL_ID")) for part in parts]  # IMDF, ArcGIS Indoors
    floors = {str(level) for level in told if level}
    if len(floors) > 1:
        whole = is_file(path.with_name("level.geojson"))
        advice = f"give the folder {path.parent}" if whole else "give the folder of all files of the building"
        raise MapError(
            f"{path}: its features are on {len(floors)} floors (level_id), which would lie on each other: "
            f"{advice} (IMDF), or save each floor in a file of its own"
        )


def _tell_overlaps(outlines: Mapping[int, Polygon], path: Path) -> None:
    """Warn where rooms lie on each other and none holds the other: that is more than one floor, as a rule."""
    numbers, shapes = list(outlines), np.array(list(outlines.values()), object)
    first, second = shapely.STRtree(shapes).query(shapes, predicate="intersects")
    first, second = first[first < second], second[first < second]
    areas = shapely.area(shapes)
    smaller, larger = np.minimum(areas[first], areas[second]), np.maximum(areas[first], areas[second])
    shared = shapely.area(shapely.intersection(shapes[first], shapes[second]))
    is_inside = (shared > NESTED * smaller) & (smaller < NESTED * larger)
    pairs = np.flatnonzero((shared > LEAST_ROOM) & ~is_inside)
    if len(pairs):
        example = f"rooms {numbers[first[pairs[0]]]} and {numbers[second[pairs[0]]]}"
        warnings.warn(
            f"{path}: {counted(len(pairs), 'pair')} of rooms lie on each other ({example}): if they are of "
            "several floors, save each floor in a file of its own",
            MapWarning,
            stacklevel=3,
        )


def _opening(part: _Part, names: dict[str, tuple[str, ...]], dropped: Dropped, unit: float) -> list[Opening]:
    """The door that a part is, if it can be one; its width stands in the file's unit."""
    shape = part.geometry
    length = {"LineString": shape.length, "Point": DOOR_WIDTH}.get(shape.geom_type)
    if length is None:
        corners = shapely.get_coordinates(shape.minimum_rotated_rectangle)
        length = float(np.hypot(*np.diff(corners, axis=0).T).max(initial=0.0))
    given = _first(part.properties, names["width"])
    try:
        width = float(given) * unit if given else length
    except (TypeError, ValueError):
        width = math.nan
    if not 0.0 < width <= LONGEST_DOOR and given:
        dropped.add("doors have a width that is no number of metres up to 10, and are as wide as drawn")
        width = length
    if not 0.0 < width <= LONGEST_DOOR:
        dropped.add("doors without a usable width are left out")
        return []
    middle = shape.interpolate(0.5, normalized=True) if isinstance(shape, LineString) else shape.centroid
    return [Opening((middle.x, middle.y), width)]
