"""HouseExpo plans as JSON: a closed contour of free space in metres, for some with rooms and doors beside it.

`verts` is the contour; the walls inside the house are slits of it. The boxes of `room_category` overlap: they
name the rooms but do not bound them. Where a file ID.label_data.json, ID.output_record_points.json or
ID.output_segmentation_data.json lies beside ID.json, its `areas` are the rooms and its `door` entries the
doors. Without one, the whole contour is a single room.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import shapely
from shapely import LineString, Point, Polygon

from layoutexplore.errors import MapError, checks_arguments
from layoutexplore.files import read_json
from layoutexplore.files.reading import is_file
from layoutexplore.files.schema import Items, Number, Record, TableOf
from layoutexplore.grids.polygons import polygons_of
from layoutexplore.maps.floorplan import Door, FloorPlan, Room
from layoutexplore.maps.sizes import MOST_METRES, check_crowding, check_outlines, check_plan, check_work

OUTER_WALL = 0.2
"""Metres of wall that are drawn around the contour."""

SIDECARS = ("label_data", "output_record_points", "output_segmentation_data")
_SMOOTHING = 0.03

_COORDINATE = Number(low=-MOST_METRES, high=MOST_METRES)
_POINT = Items(_COORDINATE, 2, 2)
_OUTLINE = Items(_POINT, 3)
_PLAN = Record({"verts": _OUTLINE}, {"room_category": TableOf(Items(Items(_COORDINATE)))})
_BESIDE = Record({}, {"areas": Items(_OUTLINE), "door": Items(Items(_POINT, 2, 2))})
"""What a plan must hold, and a file beside it."""


@checks_arguments
def load_houseexpo(path: str | os.PathLike[str]) -> FloorPlan:
    """Read one plan, from its own file or from one of the files beside it.

    Raises:
        MapError: Not JSON, no contour, or a contour that is not a polygon of finite points.
    """
    path = Path(path)
    if not path.name:
        raise MapError(f"{path}: is a folder: name one of the floor plans inside it")
    main, *sides = with_sidecars(path)
    source = main if is_file(main) else path
    data = read_json(source, _PLAN)
    beside = next((side for side in sides if is_file(side)), None)
    extra = read_json(beside, _BESIDE) if beside else {}
    areas, doors = extra.get("areas", []), extra.get("door", [])
    boxes = _label_boxes(data.get("room_category", {}))
    _check_sizes(str(source), data["verts"], areas, doors, boxes)
    contour = _polygon(data["verts"], f"{source}: verts")
    check_crowding(f"{source}: verts", [contour], 2 * OUTER_WALL)
    rooms = _rooms(areas, contour, boxes, main)
    openings = _doors(doors, rooms)
    return FloorPlan(
        name=main.stem,
        rooms=rooms,
        doors=openings,
        walls=contour.buffer(OUTER_WALL, join_style="mitre").difference(contour),
        passages=contour.difference(shapely.union_all([room.polygon for room in rooms])),
        metadata={
            "format": "HouseExpo",
            "labels": json.dumps({name: [list(b.bounds) for b in of] for name, of in boxes.items()}),
        },
    )


def with_sidecars(path: Path) -> list[Path]:
    """The file of a plan, and those that may lie beside it, given any of them."""
    stem = path.stem
    for part in SIDECARS:
        stem = stem.removesuffix(f".{part}")
    return [path.with_name(f"{name}.json") for name in (stem, *(f"{stem}.{part}" for part in SIDECARS))]


def _check_sizes(
    where: str, contour: list[Any], areas: list[Any], doors: list[Any], boxes: dict[str, list[Polygon]]
) -> None:
    """Every area is cut by those before it and by the contour, and compared with every box and door."""
    count = sum(map(len, boxes.values()))
    check_plan(where, [*areas, *boxes.values()], doors)
    corners = sum(map(len, areas or [contour])) + 4
    # What is cut takes ten times as long as what is measured.
    cuts = 10.0 * (corners * count + len(contour) * len(areas))
    steps = cuts + (len(areas) + 1 + len(doors)) * (corners + 100 * count)
    check_work(where, "rooms, labels and doors", steps)
    check_outlines(f"{where}: areas", areas)


def _polygon(points: Any, where: str) -> Polygon:
    check_outlines(where, [points])
    parts = polygons_of(Polygon(points).buffer(0))
    if not parts:
        raise MapError(f"{where}: the contour has no area")
    return max(parts, key=lambda part: part.area)


def _label_boxes(categories: dict[str, Any]) -> dict[str, list[Polygon]]:
    """Label -> boxes; entries that are no boxes are left out, they only name rooms."""
    found: dict[str, list[Polygon]] = {}
    for name, boxes in categories.items():
        usable = [shapely.box(*box) for box in boxes if len(box) == 4]
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
    fits = {name: max(_overlap(shape, box) for box in of) for name, of in boxes.items()}
    best = max(fits, key=lambda name: fits[name], default="")
    return best if best and fits[best] >= 0.5 else ""


def _overlap(a: Polygon, b: Polygon) -> float:
    """The area that two shapes share over the area that they cover together."""
    shared = float(a.intersection(b).area)
    return shared / float(a.area + b.area - shared)


def _doors(entries: list[Any], rooms: tuple[Room, ...]) -> tuple[Door, ...]:
    """Doors between the two rooms nearest to each segment's middle."""
    doors = []
    for entry in entries:
        (x0, y0), (x1, y1) = ((float(x), float(y)) for x, y in entry)
        middle: Point = LineString([(x0, y0), (x1, y1)]).interpolate(0.5, normalized=True)
        near = sorted(rooms, key=lambda room: room.polygon.distance(middle))[:2]
        ids = sorted(room.id for room in near if room.polygon.distance(middle) < 0.5)
        doors.append(Door(start=(x0, y0), end=(x1, y1), rooms=((0, 0, *ids)[-2], (0, 0, *ids)[-1])))
    return tuple(doors)
