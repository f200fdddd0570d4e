"""IMDF (Indoor Mapping Data Format) folders: one floor of a building, by its level.

`level.geojson` lists the floors, `unit.geojson` holds the rooms and `opening.geojson` the doors, joined by
`level_id`. Neighbouring units share their outlines; a door is a line along the wall, as long as it is wide.
"""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path
from typing import Any

import shapely
from shapely import Polygon

from layoutexplore.errors import MapError, checks_arguments
from layoutexplore.files import read_json
from layoutexplore.files.reading import is_file
from layoutexplore.files.schema import Anything, Items, Number, Record, Schema, TableOf
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.formats.geographic import LocalFrame
from layoutexplore.maps.formats.levels import choose_level
from layoutexplore.maps.formats.polygons import Dropped, geometry_of, room_parts
from layoutexplore.maps.shared_walls import Opening, plan_from_outlines
from layoutexplore.maps.sizes import check_count

NO_ROOM = ("column", "opentobelow", "structure", "void")
CORRIDORS = ("walkway", "walkway.island")

_LONGEST_NAME = 100
_FEATURES = Record({"features": Items(Record({"properties": TableOf(Anything())}))})
_FLOOR = Record({}, {"ordinal": Number(low=-1e6, high=1e6), "building_ids": Items(Anything())})
_FLOORS = Record({"features": Items(Record({"properties": _FLOOR}))})
"""What a file must hold, and the one of the floors."""


@checks_arguments
def is_imdf(path: str | os.PathLike[str]) -> bool:
    """Whether a folder is one of IMDF."""
    path = Path(path)
    return all(is_file(path / f"{part}.geojson") for part in ("level", "unit"))


@checks_arguments
def imdf_levels(path: str | os.PathLike[str]) -> list[str]:
    """The floors with units, by building and height: "BUILDING/FLOOR" where there are several buildings."""
    return list(_levels(Path(path)))


@checks_arguments
def load_imdf(path: str | os.PathLike[str], level: str = "") -> FloorPlan:
    """Read one floor.

    Args:
        path: The folder.
        level: Which floor; may be empty where there is only one.

    Raises:
        MapError: A file is missing or broken, there is no such floor, or it has no unit.

    Warns:
        MapWarning: Units or openings were left out or mended.
    """
    path = Path(path)
    levels = _levels(path)
    if not levels:
        raise MapError(f"{path}: no floor in this folder: none of its units has the level_id of a level")
    name = choose_level(path, level, list(levels))
    dropped = Dropped(f"{path}#{name}")
    units = _features(path / "unit.geojson", levels[name])
    doors = _features(path / "opening.geojson", levels[name]) if (path / "opening.geojson").is_file() else []
    check_count(dropped.path, "units", len(units))
    check_count(dropped.path, "openings", len(doors))
    shapes = [geometry_of(feature) for feature in units]
    points = shapely.get_coordinates(shapely.GeometryCollection(shapes))
    if not len(points):
        raise MapError(f"{path}#{name}: this floor has no unit")
    frame = LocalFrame.around(points)
    outlines: dict[int, Polygon] = {}
    labels: dict[int, str] = {}
    for feature, shape in zip(units, shapes, strict=True):
        category = str(feature["properties"].get("category") or "")[:_LONGEST_NAME]
        if category in NO_ROOM:
            continue
        for outline in room_parts(frame.project(shape), dropped):
            number = len(outlines) + 1
            outlines[number] = outline
            labels[number] = "corridor" if category in CORRIDORS else category
    openings = []
    for feature in doors:
        line = frame.project(geometry_of(feature))
        if line.geom_type != "LineString" or line.length == 0:
            dropped.add("openings that are no line are left out")
            continue
        middle = line.interpolate(0.5, normalized=True)
        openings.append(Opening((middle.x, middle.y), float(line.length)))
    dropped.warn()
    home = f"{path.resolve().name}-{name}"
    return plan_from_outlines(
        outlines,
        labels,
        openings,
        name=home.replace("/", "-"),
        building=home.rpartition("/")[0] or path.resolve().name,
        metadata={"format": "IMDF", "level": name},
    )


def _levels(path: Path) -> dict[str, str]:
    """Id of the level of each floor's name, buildings in the order of their ids, floors from below."""
    found = []
    # Grounds outside and roofs are levels, too, as a rule without a unit.
    used = {str(unit["properties"].get("level_id")) for unit in _features(path / "unit.geojson")}
    for feature in _features(path / "level.geojson", schema=_FLOORS):
        properties = feature["properties"]
        key = str(feature["id"] if feature.get("id") is not None else properties.get("id"))  # as a GIS has it
        if key not in used:
            continue
        names = properties.get("short_name") or properties.get("name") or {}
        name = next(iter(names.values()), None) if isinstance(names, dict) else names
        home = str(next(iter(properties.get("building_ids") or [""])))[:8]
        ordinal = float(properties.get("ordinal") or 0)
        found.append((home, ordinal, str(name or "")[:_LONGEST_NAME], key))
    several = len({home for home, *_ in found}) > 1
    levels = {}
    for home, ordinal, name, key in sorted(found):
        floor = name or f"{ordinal:g}"
        levels[f"{home}/{floor}" if several else floor] = key
    if len(levels) < len(found):  # floors of one name are told apart by their height, and by a number
        levels, times = {}, Counter[str]()
        for home, ordinal, _, key in sorted(found):
            floor = f"{home}/{ordinal:g}" if several else f"{ordinal:g}"
            times[floor] += 1
            levels[floor if times[floor] == 1 else f"{floor} ({times[floor]})"] = key
    return levels


def _features(path: Path, level: str | None = None, schema: Schema = _FEATURES) -> list[dict[str, Any]]:
    """The features of a file, of one level or all.

    Raises:
        MapError: It is missing, or no FeatureCollection.
    """
    features: list[dict[str, Any]] = read_json(path, schema)["features"]
    check_count(str(path), "features", len(features), "vertices")
    return [f for f in features if level is None or str(f["properties"].get("level_id")) == level]
