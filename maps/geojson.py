"""Our own format: a floor plan as a GeoJSON FeatureCollection that people can read and edit.

The members `format`, `version`, `name`, `building`, `units` and `metadata` describe the plan. Each feature's
property `kind` says what it is: "room" (Polygon; id, label), "door" (LineString of two points; rooms, open),
"walls", "furniture" and "passages" (Polygon or MultiPolygon, at most one of each). Coordinates are metres, x
right and y up. The geometry of a plan survives a round trip bit by bit; a plan that was born as an image is
written with the exact outlines of its cells.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry import mapping, shape
from shapely.geometry.base import BaseGeometry

from layoutexplore.errors import MapError
from layoutexplore.files import write_atomically
from layoutexplore.grids.polygons import polygons_of
from layoutexplore.maps.floorplan import Door, FloorPlan, Room
from layoutexplore.maps.json_plan import read_json

FORMAT, VERSION = "layoutexplore floor plan", 1
SOLIDS = ("walls", "furniture", "passages")
_POLYGONS = ("Polygon", "MultiPolygon")


def save_plan(plan: FloorPlan, path: str | Path) -> None:
    """Write a plan, one feature a line.

    Raises:
        MapError: The file cannot be written.
    """
    features = [_feature(room.polygon, kind="room", id=room.id, label=room.label) for room in plan.rooms]
    for door in plan.doors:
        line = shapely.LineString([door.start, door.end])
        features.append(_feature(line, kind="door", rooms=list(door.rooms), open=door.is_open))
    for kind in SOLIDS:
        polygons = polygons_of(getattr(plan, kind))
        if polygons:
            features.append(
                _feature(polygons[0] if len(polygons) == 1 else shapely.MultiPolygon(polygons), kind=kind)
            )
    head = {
        "type": "FeatureCollection",
        "format": FORMAT,
        "version": VERSION,
        "name": plan.name,
        "building": plan.building,
        "units": "m",
        "metadata": dict(plan.metadata),
    }
    lines = ",\n".join("    " + json.dumps(feature, ensure_ascii=False) for feature in features)
    opening = json.dumps(head, ensure_ascii=False, indent=2).removesuffix("\n}")
    write_atomically(Path(path), f'{opening},\n  "features": [\n{lines}\n  ]\n}}\n'.encode())


def _feature(geometry: BaseGeometry, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": mapping(geometry)}


def load_geojson(path: Path) -> FloorPlan:
    """Read a plan.

    Raises:
        MapError: The file is not a plan of this format; the message names the feature that is wrong.
    """
    data = read_json(path)
    features = data.get("features") if isinstance(data, dict) else None
    if not isinstance(features, list) or data.get("type") != "FeatureCollection":
        raise MapError(f"{path}: must be a GeoJSON FeatureCollection")
    if data.get("units", "m") != "m":
        raise MapError(f"{path}: units must be 'm', got {data['units']!r}")
    rooms: list[Room] = []
    doors: list[Door] = []
    solids: dict[str, BaseGeometry] = {}
    for number, feature in enumerate(features):
        _read_feature(feature, f"{path}: feature {number}", rooms, doors, solids)
    metadata = data.get("metadata", {})
    if not isinstance(metadata, dict):
        raise MapError(f"{path}: metadata must be an object of strings")
    try:
        return FloorPlan(
            name=str(data.get("name") or path.stem),
            building=str(data.get("building") or ""),
            rooms=tuple(rooms),
            doors=tuple(doors),
            metadata={str(key): str(value) for key, value in metadata.items()},
            **solids,
        )
    except MapError as error:
        raise MapError(f"{path}: {error}") from error


def _read_feature(
    feature: Any, where: str, rooms: list[Room], doors: list[Door], solids: dict[str, BaseGeometry]
) -> None:
    """Add a feature to the part of the plan that its kind names."""
    properties = feature.get("properties") if isinstance(feature, dict) else None
    if not isinstance(properties, dict):
        raise MapError(f"{where}: must be a Feature with properties")
    kind = properties.get("kind")
    if kind == "room":
        geometry = _geometry(feature, f"{where} (room)", ("Polygon",))
        rooms.append(
            Room(
                id=_whole(properties.get("id"), f"{where} (room): id"),
                polygon=geometry,
                label=_label(properties, where),
            )
        )
    elif kind == "door":
        doors.append(_door(feature, properties, f"{where} (door)"))
    elif kind in SOLIDS:
        if kind in solids:
            raise MapError(f"{where}: there is more than one feature of kind {kind!r}")
        solids[kind] = _geometry(feature, f"{where} ({kind})", _POLYGONS)
    else:
        raise MapError(f"{where}: kind must be one of room, door, {', '.join(SOLIDS)}; got {kind!r}")


def _label(properties: dict[str, Any], where: str) -> str:
    label = properties.get("label", "")
    if not isinstance(label, str):
        raise MapError(f"{where} (room): label must be a string, got {label!r}")
    return label


def _door(feature: dict[str, Any], properties: dict[str, Any], where: str) -> Door:
    line = _geometry(feature, where, ("LineString",))
    if len(line.coords) != 2:
        raise MapError(f"{where}: must be a line of two points, has {len(line.coords)}")
    rooms = properties.get("rooms", [0, 0])
    if not isinstance(rooms, list) or len(rooms) != 2:
        raise MapError(f"{where}: rooms must be two room ids, got {rooms!r}")
    is_open = properties.get("open", True)
    if not isinstance(is_open, bool):
        raise MapError(f"{where}: open must be true or false, got {is_open!r}")
    start, end = line.coords
    pair = _whole(rooms[0], f"{where}: rooms"), _whole(rooms[1], f"{where}: rooms")
    return Door(start=start, end=end, rooms=pair, is_open=is_open)


def _whole(value: Any, where: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise MapError(f"{where} must be a whole number, got {value!r}")
    return value


def _geometry(feature: dict[str, Any], where: str, kinds: tuple[str, ...]) -> Any:
    """The feature's geometry, checked to be finite, valid and of one of the kinds."""
    data = feature.get("geometry")
    kind = data.get("type") if isinstance(data, dict) else None
    if kind not in kinds:
        raise MapError(f"{where}: geometry must be a {' or '.join(kinds)}, got {kind!r}")
    try:
        with np.errstate(invalid="ignore"):  # shapely warns about NaN; it is reported below
            geometry = shape(data)
    except (
        TypeError,
        ValueError,
        KeyError,
        IndexError,
        AttributeError,
        shapely.errors.ShapelyError,
    ) as error:
        raise MapError(f"{where}: broken coordinates: {error}") from error
    if geometry.is_empty:
        raise MapError(f"{where}: the geometry is empty")
    if geometry.has_z or not all(math.isfinite(value) for value in shapely.get_coordinates(geometry).ravel()):
        raise MapError(f"{where}: coordinates must be pairs of finite numbers")
    if not geometry.is_valid:
        raise MapError(f"{where}: {shapely.is_valid_reason(geometry)}")
    return geometry
