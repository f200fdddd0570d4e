"""IFC building models (`.ifc`), one storey at a time.

A room is an `IfcSpace`, without the walls and columns that reach into it; a door is the opening that an
`IfcDoor` fills, or a hole of a wall that nothing fills and that reaches the floor. Spaces that touch where no
wall is are joined by an opening as wide as they touch. The model is read by IfcOpenShell, in a process of its
own (`layoutexplore.maps.formats.ifc_geometry`): the extra `bim` brings it.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from layoutexplore.errors import MapError, cause, checks_arguments, require
from layoutexplore.files import read_bytes, read_json
from layoutexplore.files.reading import shown_path
from layoutexplore.files.schema import Items, Number, Record, Text
from layoutexplore.grids.polygons import polygons_of
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.formats.levels import choose_level
from layoutexplore.maps.formats.polygons import Dropped, room_parts
from layoutexplore.maps.shared_walls import WALL_THICKNESS, Opening, open_borders, plan_from_outlines
from layoutexplore.maps.sizes import MOST_METRES, check_count, check_outlines, check_overlaps

SECONDS = 600.0
"""A model that takes longer is given up."""

COVERED = 0.5
"""A space of whose area other spaces cover so much is the sum of them, and no room."""

LEAST_ROOM = 0.5
"""Square metres of floor; what walls cut off of a space and is smaller is no room."""

ONE_ROOM = 0.65
"""Of the half metre around a door: if one room has more, the door is inside of that room."""

_PAIRS = 10
"""Pairs of spaces that touch or overlap, over the limit of rooms."""

_SNAP = 1e-4
_HAIR = 1e-3
_PLACE = Number(low=-MOST_METRES, high=MOST_METRES)
_OUTLINE = Text(most=32_000_000)
_FLOOR = Record(
    {
        "name": Text(),
        "building": Text(),
        "height": _PLACE,
        "spaces": Items(Items(_OUTLINE)),
        "solid": _OUTLINE,
        "openings": Items(Items(_PLACE)),
    }
)
_FLOORS = Record({"floors": Items(_FLOOR), "without_shape": Number(low=0)})


@checks_arguments
def is_ifc(path: str | os.PathLike[str]) -> bool:
    """Whether a file is an IFC model, by its name."""
    return Path(path).suffix.lower() == ".ifc"


@checks_arguments
def ifc_levels(path: str | os.PathLike[str]) -> list[str]:
    """The storeys that have spaces, from below: "BUILDING/STOREY" where there are several buildings."""
    return list(_levels(Path(path))[0])


@checks_arguments
def load_ifc(path: str | os.PathLike[str], level: str = "") -> FloorPlan:
    """Read one storey.

    Args:
        path: The file.
        level: Which storey; may be empty where there is only one.

    Raises:
        MapError: The file is broken or larger than the limits, or there is no such storey.
        MissingExtraError: IfcOpenShell is not installed.

    Warns:
        MapWarning: Spaces or doors were left out or mended.
    """
    path = Path(path)
    levels, without_shape = _levels(path)
    if not levels:
        raise MapError(
            f"{path}: no floor in this model: none of its storeys has a space (IfcSpace) with a shape, "
            f"{without_shape} have none: export rooms or zones as well, with their volumes"
        )
    name = choose_level(path, level, list(levels))
    where, floor = f"{path}#{name}", levels[name]
    dropped = Dropped(where)
    if without_shape:
        dropped.counts["spaces of the model have no shape and are left out"] = without_shape
    spaces = [
        (label, part)
        for label, text in floor["spaces"]
        for part in room_parts(_joined(shapely.from_wkt(text)), dropped)
    ]
    solid = shapely.from_wkt(floor["solid"])
    check_outlines(where, [solid])
    check_count(where, "doors and holes of walls", len(floor["openings"]))
    _check_overlaps(where, [space for _, space in spaces])
    rooms = _rooms(spaces, solid, dropped)
    floors = {number: room for number, (_, room) in rooms.items()}
    openings = list(_doors(floor["openings"], list(floors.values()), dropped))
    for opening in open_borders(floors, solid):
        openings.append(opening)
        check_count(where, "doors and open borders", len(openings))
    dropped.warn()
    home = f"{path.stem}-{name}"
    return plan_from_outlines(
        {number: _to_the_middle(room) for number, room in floors.items()},
        {number: label for number, (label, _) in rooms.items()},
        openings,
        name=home.replace("/", "-"),
        building=home.rpartition("/")[0] or path.stem,
        metadata={"format": "IFC", "level": name},
    )


def _levels(path: Path) -> tuple[dict[str, Mapping[str, Any]], int]:
    """The storeys by name, and how many spaces have no shape."""
    try:
        status = path.stat()
    except (OSError, ValueError) as error:
        raise MapError(f"{shown_path(path)}: cannot read the model: {cause(error)}") from error
    found = _extracted(path.resolve(), status.st_mtime_ns, status.st_size)
    floors = found["floors"]
    several = len({floor["building"] for floor in floors}) > 1
    levels: dict[str, Mapping[str, Any]] = {}
    for floor in floors:
        name = f"{floor['building']}/{floor['name']}" if several else floor["name"]
        while name in levels:  # storeys of one name are told apart by their height
            name = f"{name} at {floor['height']:g} m"
        levels[name] = floor
    return levels, int(found["without_shape"])


@lru_cache(maxsize=4)
def _extracted(path: Path, _changed: int, _size: int) -> dict[str, Any]:
    """The floors of a model, read by another process.

    Raises:
        MapError: The file is too large, cut short or no model, or reading it takes too much time or memory.
    """
    data = read_bytes(path, MapError, "model")
    if not data[:100].lstrip().startswith(b"ISO-10303-21"):
        raise MapError(f"{path}: is no IFC model: it must begin with ISO-10303-21")
    if b"END-ISO-10303-21" not in data[-100:]:
        raise MapError(f"{path}: the model is cut short: it must end with END-ISO-10303-21")
    require("ifcopenshell", "bim")
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "floors.json"
        module = "layoutexplore.maps.formats.ifc_geometry"
        try:
            done = subprocess.run(
                [sys.executable, "-m", module, str(path), str(target)],
                capture_output=True,
                check=False,
                timeout=SECONDS,
            )
        except subprocess.TimeoutExpired as error:
            raise MapError(f"{path}: building the model's solids takes more than {SECONDS:g} s") from error
        if done.returncode or not target.is_file():
            said = done.stderr.decode(errors="replace").strip().splitlines()[-1:]
            reason = cause(ValueError(said[0])) if said else f"the reader died of signal {-done.returncode}"
            raise MapError(f"{path}: IfcOpenShell cannot read the model: {reason}")
        found: dict[str, Any] = read_json(target, _FLOORS)
    check_count(str(path), "spaces", max((len(f["spaces"]) for f in found["floors"]), default=0))
    return found


def _joined(space: BaseGeometry) -> BaseGeometry:
    """A space whose triangles left a gap of a hair between them, as one."""
    return shapely.set_precision(space, _HAIR) if space.geom_type == "MultiPolygon" else space


def _check_overlaps(where: str, spaces: list[Polygon]) -> None:
    """Raise `MapError` where far too many spaces touch or lie over each other: each pair is looked at."""
    check_overlaps(where, spaces)
    tree = shapely.STRtree(spaces)
    pairs = (len(tree.query(spaces, predicate="intersects")[0]) - len(spaces)) // 2
    check_count(where, "times ten pairs of spaces that touch or overlap", pairs // _PAIRS)


def _rooms(
    spaces: list[tuple[str, Polygon]], solid: BaseGeometry, dropped: Dropped
) -> dict[int, tuple[str, Polygon]]:
    """Number -> label and floor of each room, up to the faces of walls, which may cut a space in several."""
    rooms: dict[int, tuple[str, Polygon]] = {}
    tree = shapely.STRtree([space for _, space in spaces])
    for at, (label, space) in enumerate(spaces):
        inside = [k for k in tree.query(space).tolist() if k != at and spaces[k][1].area < space.area]
        covered = shapely.union_all([spaces[k][1] for k in inside]).intersection(space).area
        if len(inside) > 1 and covered > COVERED * space.area:
            dropped.add("spaces are the sum of others and are left out")
            continue
        parts = [part for part in polygons_of(space.difference(solid)) if part.area >= LEAST_ROOM]
        if not parts:
            dropped.add("spaces lie inside walls and are left out")
        for part in sorted(parts, key=lambda part: -part.area):
            rooms[len(rooms) + 1] = label, part
    return rooms


def _doors(openings: list[list[float]], rooms: list[Polygon], dropped: Dropped) -> Iterator[Opening]:
    """Openings of walls between rooms; doors of cubicles, all around which is one room, are none."""
    tree = shapely.STRtree(rooms)
    for x, y, width in openings:
        around = shapely.Point(x, y).buffer(0.5)
        if any(_overlap(around, rooms[k]) > ONE_ROOM * around.area for k in tree.query(around)):
            dropped.add("doors inside of one room are left out")
            continue
        yield Opening((x, y), width)


def _overlap(small: Polygon, large: Polygon) -> float:
    """The area in square metres that two polygons have in common; one may have thousands of corners."""
    near = shapely.clip_by_rect(large, *small.bounds)
    return float(small.intersection(near if near.is_valid else large).area)


def _to_the_middle(room: Polygon) -> Polygon:
    """The outline in the middle of walls of the usual thickness around a room."""
    # On a grid, so that lines of neighbours are the same.
    outline = room.buffer(WALL_THICKNESS / 2, join_style="mitre")
    return polygons_of(shapely.set_precision(outline, _SNAP))[0]
