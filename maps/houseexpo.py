"""HouseExpo plans as JSON: a closed contour of free space in metres, for some with rooms and doors beside it.

`verts` is the contour; the walls inside the house are slits of it. The boxes of `room_category` overlap: they
name the rooms but do not bound them. Where a file ID.label_data.json, ID.output_record_points.json or
ID.output_segmentation_data.json lies beside ID.json, its `areas` are the rooms and its `door` entries the
doors. Without one, the whole contour is a single room.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import shapely
from shapely import LineString, Point, Polygon

from layoutexplore.errors import MapError
from layoutexplore.grids.polygons import polygons_of
from layoutexplore.maps.floorplan import Door, FloorPlan, Room
from layoutexplore.maps.json_plan import read_json

OUTER_WALL = 0.2
"""Metres of wall that are drawn around the contour."""

SIDECARS = ("label_data", "output_record_points", "output_segmentation_data")
_SMOOTHING = 0.03


def load_houseexpo(path: Path) -> FloorPlan:
    """Read one plan, from its own file or from one of the files beside it.

    Raises:
        MapError: Not JSON, no contour, or a contour that is not a polygon of finite points.
    """
    stem = path.stem
    for part in SIDECARS:
        stem = stem.removesuffix(f".{part}")
    main = path.with_name(f"{stem}.json")
    data = _read(main if main.is_file() else path)
    contour = _polygon(data.get("verts"), f"{main if main.is_file() else path}: verts")
    boxes = _label_boxes(data.get("room_category"))
    extra = next(
        (_read(side) for part in SIDECARS if (side := main.with_name(f"{stem}.{part}.json")).is_file()), {}
    )
    rooms = _rooms(extra.get("areas") or [], contour, boxes, main)
    doors = _doors(extra.get("door") or [], rooms, main)
    return FloorPlan(
        name=stem,
        rooms=rooms,
        doors=doors,
        walls=contour.buffer(OUTER_WALL, join_style="mitre").difference(contour),
        passages=contour.difference(shapely.union_all([room.polygon for room in rooms])),
        metadata={
            "format": "HouseExpo",
            "labels": json.dumps({name: [list(b.bounds) for b in of] for name, of in boxes.items()}),
        },
    )


def _read(path: Path) -> dict[str, Any]:
    data = read_json(path)
    if not isinstance(data, dict):
        raise MapError(f"{path}: a HouseExpo plan is a JSON object with 'verts', got a {type(data).__name__}")
    return data


def _polygon(points: Any, where: str) -> Polygon:
    try:
        pairs = [(float(x), float(y)) for x, y in points]
    except (TypeError, ValueError):
        raise MapError(f"{where}: must be a list of [x, y] in metres") from None
    if len(pairs) < 3 or not all(math.isfinite(v) for pair in pairs for v in pair):
        raise MapError(f"{where}: needs at least 3 finite points")
    parts = polygons_of(Polygon(pairs).buffer(0))
    if not parts:
        raise MapError(f"{where}: the contour has no area")
    return max(parts, key=lambda part: part.area)


def _label_boxes(categories: Any) -> dict[str, list[Polygon]]:
    """Label -> boxes; entries that are no boxes are left out, they only name rooms."""
    found: dict[str, list[Polygon]] = {}
    for name, boxes in categories.items() if isinstance(categories, dict) else ():
        usable = [shapely.box(*box) for box in boxes if len(box) == 4 and all(math.isfinite(v) for v in box)]
        if usable:
            found[str(name).replace("_", " ").lower()] = usable
    return found


def _rooms(
    areas: list[Any], contour: Polygon, boxes: dict[str, list[Polygon]], path: Path
) -> tuple[Room, ...]:
    """The areas cut to the contour, or the contour itself; each with the label whose box fits it best."""
    shapes = [_polygon(area, f"{path}: area {k}").simplify(_SMOOTHING) for k, area in enumerate(areas)]
    cut: list[Polygon] = []
    for shape in shapes:
        rest = shape.intersection(contour).difference(shapely.union_all(cut))
        cut.extend(sorted(polygons_of(rest), key=lambda part: -part.area)[:1])
    if not cut:
        return (Room(id=1, polygon=contour, label=_label(contour, boxes)),)
    return tuple(
        Room(id=k, polygon=shape, label=_label(shape, boxes)) for k, shape in enumerate(cut, start=1)
    )


def _label(shape: Polygon, boxes: dict[str, list[Polygon]]) -> str:
    fits = {
        name: max(shape.intersection(b).area / shape.union(b).area for b in of) for name, of in boxes.items()
    }
    best = max(fits, key=lambda name: fits[name], default="")
    return best if best and fits[best] >= 0.5 else ""


def _doors(entries: list[Any], rooms: tuple[Room, ...], path: Path) -> tuple[Door, ...]:
    """Doors between the two rooms nearest to each segment's middle."""
    doors = []
    for number, entry in enumerate(entries):
        try:
            (x0, y0), (x1, y1) = ((float(x), float(y)) for x, y in entry)
        except (TypeError, ValueError):
            raise MapError(f"{path}: door {number} must be two points [x, y], got {entry!r}") from None
        middle: Point = LineString([(x0, y0), (x1, y1)]).interpolate(0.5, normalized=True)
        near = sorted(rooms, key=lambda room: room.polygon.distance(middle))[:2]
        ids = sorted(room.id for room in near if room.polygon.distance(middle) < 0.5)
        doors.append(Door(start=(x0, y0), end=(x1, y1), rooms=((0, 0, *ids)[-2], (0, 0, *ids)[-1])))
    return tuple(doors)
