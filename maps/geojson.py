"""Our own format: a floor plan as a GeoJSON FeatureCollection that people can read and edit.

The members `format`, `version`, `name`, `building`, `units` and `metadata` describe the plan. Each feature's
property `kind` says what it is: "room" (Polygon; id, label), "door" (LineString of two points; rooms, open),
"walls", "furniture" and "passages" (Polygon or MultiPolygon, at most one of each). Coordinates are metres, x
right and y up. The geometry of a plan survives a round trip bit by bit; a plan that was born as an image is
written with the exact outlines of its cells.

The file that `layoutexplore layout` writes is such a plan, too; its faces and lines are passed over. Programs
that save every polygon as a MultiPolygon do no harm.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry import mapping
from shapely.geometry.base import BaseGeometry

from layoutexplore.errors import MapError, cause, checks_arguments, shortened
from layoutexplore.files import is_there, read_json, write_atomically
from layoutexplore.files.reading import shown_path
from layoutexplore.grids.polygons import polygons_of, shape_of
from layoutexplore.maps.floorplan import Door, FloorPlan, Room
from layoutexplore.maps.sizes import MOST_METRES, check_count, check_outlines
from layoutexplore.options import check_kind

SUFFIXES = (".geojson", ".json")
FORMAT, VERSION = "layoutexplore floor plan", 1
SOLIDS = ("walls", "furniture", "passages")
LAYOUT_KINDS = ("face", "line", "wall")
"""What the file of a layout holds besides the parts of a floor plan."""
_POLYGONS = ("Polygon", "MultiPolygon")
_LONGEST_NAME = 1000
_OTHERS = " (a file of another program: name its columns, as in --column room=NAME)"


def save_plan(plan: FloorPlan, path: str | os.PathLike[str]) -> None:
    """Write a plan, one feature a line: polygons and doors, not the raster of a plan born as an image.

    Raises:
        MapError: The file cannot be written.
    """
    check_kind("plan", plan, FloorPlan)
    check_kind("path", path, str, os.PathLike)
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
    text = f'{opening},\n  "features": [\n{lines}\n  ]\n}}\n'
    try:
        data = text.encode()
    except UnicodeEncodeError as error:
        raise MapError(f"{shown_path(Path(path))}: a name in the plan is no text: {cause(error)}") from error
    write_atomically(Path(path), data)


def _feature(geometry: BaseGeometry, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": mapping(geometry)}


@checks_arguments
def load_geojson(path: str | os.PathLike[str], data: Any = None) -> FloorPlan:
    """Read a plan.

    Args:
        path: The file.
        data: What it holds, where that is known already.

    Raises:
        MapError: The file is not a plan of this format; the message names the feature that is wrong.
    """
    path = Path(path)
    data = read_json(path) if data is None else data
    features = data.get("features") if isinstance(data, dict) else None
    if not isinstance(features, list) or data.get("type") != "FeatureCollection":
        raise MapError(f"{path}: must be a GeoJSON FeatureCollection")
    if data.get("units", "m") != "m":
        raise MapError(f"{path}: units must be 'm', got {shortened(data['units'])}")
    check_count(str(path), "features", len(features))
    rooms: list[Room] = []
    doors: list[Door] = []
    solids: dict[str, BaseGeometry] = {}
    for number, feature in enumerate(features):
        try:
            _read_feature(feature, f"{path}: feature {number}", rooms, doors, solids)
        except MapError as error:
            if _is_marked(data):
                raise
            raise MapError(f"{error}{_OTHERS}") from error
    metadata = data.get("metadata", {})
    if not isinstance(metadata, dict):
        raise MapError(f"{path}: metadata must be an object of strings")
    check_outlines(str(path), [*(room.polygon for room in rooms), *solids.values()])
    try:
        return FloorPlan(
            name=_text(data, "name", str(path)) or path.stem,
            building=_text(data, "building", str(path)),
            rooms=tuple(rooms),
            doors=tuple(doors),
            metadata={str(key): _short(value) for key, value in metadata.items()},
            **solids,
        )
    except MapError as error:
        raise MapError(f"{path}: {error}") from error


@checks_arguments
def is_saved_plan(path: str | os.PathLike[str]) -> bool:
    """Whether a file is one that `save_plan` has written, perhaps corrected since."""
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES or not is_there(path) or path.is_dir():
        return False
    try:
        data = read_json(path)
    except MapError:
        return False
    return isinstance(data, dict) and data.get("format") == FORMAT


def is_own_format(data: Any) -> bool:
    """Whether a FeatureCollection is a plan of this format or a layout, and not of another program.

    Programs that save a plan of ours drop what is no feature; rooms still have ids, and doors their rooms.
    """
    if not isinstance(data, dict) or not isinstance(features := data.get("features"), list):
        return True  # `load_geojson` says what is wrong with it
    if _is_marked(data) or not features:
        return True
    found = [f.get("properties") for f in features if isinstance(f, dict)]
    return any(isinstance(p, dict) and _is_own_part(p) for p in found)


def _is_marked(data: dict[str, Any]) -> bool:
    """Whether a file says itself that it is a plan of ours or a layout."""
    return str(data.get("format", "")).startswith("layoutexplore") or isinstance(data.get("layout"), dict)


def _is_own_part(properties: dict[str, Any]) -> bool:
    """Whether a feature is a room, a door or passages as this format has them."""
    kind, number = properties.get("kind"), properties.get("id")
    is_number = isinstance(number, (int, float)) and not isinstance(number, bool)
    is_door = kind == "door" and isinstance(properties.get("rooms"), list)
    return (kind == "room" and is_number) or is_door or kind == "passages"


def _text(data: dict[str, Any], key: str, where: str) -> str:
    """A name, which may be a number; empty where there is none."""
    value = data.get(key) or ""
    if not isinstance(value, (str, int, float)) or len(str(value)) > _LONGEST_NAME:
        raise MapError(
            f"{where}: {key} must be a text of at most {_LONGEST_NAME} characters, got {shortened(value)}"
        )
    return str(value)


def _short(value: Any) -> str:
    return value if isinstance(value, str) else shortened(value)


def _read_feature(
    feature: Any, where: str, rooms: list[Room], doors: list[Door], solids: dict[str, BaseGeometry]
) -> None:
    """Add a feature to the part of the plan that its kind names."""
    properties = feature.get("properties") if isinstance(feature, dict) else None
    if not isinstance(properties, dict):
        raise MapError(f"{where}: must be a Feature with properties")
    kind = properties.get("kind")
    if not isinstance(kind, str):
        raise MapError(f"{where}: kind must be a text, got {shortened(kind)}")
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
    elif kind not in LAYOUT_KINDS:
        raise MapError(f"{where}: kind must be one of room, door, {', '.join(SOLIDS)}; got {shortened(kind)}")


def _label(properties: dict[str, Any], where: str) -> str:
    label = properties.get("label", "")
    if not isinstance(label, str):
        raise MapError(f"{where} (room): label must be a string, got {shortened(label)}")
    return label


def _door(feature: dict[str, Any], properties: dict[str, Any], where: str) -> Door:
    line = _geometry(feature, where, ("LineString",))
    if len(line.coords) != 2:
        raise MapError(f"{where}: must be a line of two points, has {len(line.coords)}")
    rooms = properties.get("rooms", [0, 0])
    if not isinstance(rooms, list) or len(rooms) != 2:
        raise MapError(f"{where}: rooms must be two room ids, got {shortened(rooms)}")
    is_open = properties.get("open", True)
    if not isinstance(is_open, bool):
        raise MapError(f"{where}: open must be true or false, got {shortened(is_open)}")
    start, end = line.coords
    pair = _whole(rooms[0], f"{where}: rooms"), _whole(rooms[1], f"{where}: rooms")
    return Door(start=start, end=end, rooms=pair, is_open=is_open)


def _whole(value: Any, where: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**31:
        raise MapError(f"{where} must be a whole number below 2**31, got {shortened(value)}")
    return value


def _single(data: Any, kinds: tuple[str, ...]) -> Any:
    """A geometry; where it is the only part of a multi-geometry, the part."""
    if not isinstance(data, dict):
        return data
    parts = data.get("coordinates")
    name = str(data.get("type")).removeprefix("Multi")
    if name not in kinds or name == data.get("type") or not isinstance(parts, list) or len(parts) != 1:
        return data
    return {"type": name, "coordinates": parts[0]}


def _geometry(feature: dict[str, Any], where: str, kinds: tuple[str, ...]) -> Any:
    """The feature's geometry, checked to be finite, valid and of one of the kinds."""
    data = _single(feature.get("geometry"), kinds)
    kind = data.get("type") if isinstance(data, dict) else None
    if not isinstance(kind, str) or kind not in kinds:
        raise MapError(f"{where}: geometry must be a {' or '.join(kinds)}, got {shortened(kind)}")
    try:
        with np.errstate(invalid="ignore"):  # shapely warns about NaN; it is reported below
            geometry = shape_of(data)
    except Exception as error:  # shapely's own, and those of coordinates that are no lists of numbers
        raise MapError(f"{where}: broken coordinates: {shortened(str(error))}") from error
    if geometry.is_empty:
        raise MapError(f"{where}: the geometry is empty")
    if geometry.has_z or not (np.abs(shapely.get_coordinates(geometry)) <= MOST_METRES).all():
        raise MapError(f"{where}: coordinates must be pairs of finite numbers")
    if not geometry.is_valid:
        raise MapError(f"{where}: {shapely.is_valid_reason(geometry)}")
    return geometry
