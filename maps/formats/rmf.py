"""Building files of Open-RMF's traffic editor (`NAME.building.yaml`), one level at a time.

Vertices are pixels of a drawing with y down; walls and doors are pairs of vertices, and `measurements` of
known length give the metres of a pixel, or `fiducials`, places that a level shares with the one of reference.
With `coordinate_system: cartesian_meters` vertices are metres with y up. There are no rooms: they are what
walls and doors leave of the floor. Walls are drawn 0.2 m thick.
"""

from __future__ import annotations

import math
import os
import warnings
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from layoutexplore.errors import MapError, MapWarning, checks_arguments, shortened
from layoutexplore.files import read_yaml
from layoutexplore.grids.arrays import Floats
from layoutexplore.grids.polygons import polygons_of
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.formats.levels import choose_level
from layoutexplore.maps.formats.polygons import Dropped
from layoutexplore.maps.formats.wall_plans import plan_from_walls
from layoutexplore.maps.shared_walls import WALL_THICKNESS
from layoutexplore.maps.sizes import MOST_METRES, check_outlines

ENDING = ".building.yaml"
DRAWING, METRES = "reference_image", "cartesian_meters"
"""Systems of coordinates that are read."""

_MOST_FIDUCIALS = 20

_AGREE = 0.1
"""Measurements of one drawing may differ by this share."""


@checks_arguments
def is_rmf(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a building of the traffic editor, by its name."""
    return Path(path).name.lower().endswith(ENDING)


@checks_arguments
def rmf_levels(path: str | os.PathLike[str]) -> list[str]:
    """The levels that have walls."""
    return list(_with_walls(_read(Path(path))["levels"]))


@checks_arguments
def load_rmf(path: str | os.PathLike[str], level: str = "") -> FloorPlan:
    """Read one level.

    Args:
        path: The file.
        level: Which level; may be empty where there is only one.

    Raises:
        MapError: The file is broken, has no such level, or a level has no scale.

    Warns:
        MapWarning: Walls or doors were left out, or measurements contradict each other.
    """
    path = Path(path)
    data = _read(path)
    levels = _with_walls(data["levels"])
    name = choose_level(path, level, list(levels))
    where, entries = f"{path}#{name}", levels[name]
    dropped = Dropped(where)
    points = _vertices(entries, where)
    if data.get("coordinate_system") != METRES:
        scale = _scale(entries, where) or _scale_by_fiducials(entries, data, path)
        if not scale:
            raise MapError(
                f"{where}: no usable measurement, so that nobody can say how long a pixel is: draw one in "
                "the traffic editor, or two fiducials that a level with a measurement has, too"
            )
        points = points * scale * np.array([1.0, -1.0])
    lines = _segments(_listed(entries, "walls", where), points, "walls", dropped)
    doors = _segments(_listed(entries, "doors", where), points, "doors", dropped)
    check_outlines(where, [*lines, *doors])
    dropped.warn()
    walls = shapely.union_all(
        [line.buffer(WALL_THICKNESS / 2, cap_style="square", join_style="mitre") for line in lines]
    )
    stem = path.name[: -len(ENDING)]
    return plan_from_walls(
        _floor(entries, points, walls, doors, where),
        walls,
        doors,
        name=f"{stem}-{name}",
        building=stem,
        metadata={"format": "Open-RMF building", "level": name},
        where=where,
    )


def _read(path: Path) -> dict[str, Any]:
    """What the file holds, `levels` by name among it.

    Raises:
        MapError: The file cannot be read as such a building.
    """
    data = read_yaml(path, what="building")
    levels = data.get("levels") if isinstance(data, dict) else None
    if not isinstance(data, dict) or not isinstance(levels, dict):
        raise MapError(f"{path}: a building needs the entry 'levels'")
    system = data.get("coordinate_system") or DRAWING
    if system not in (DRAWING, METRES):
        raise MapError(
            f"{path}: coordinate_system {shortened(str(system))} is not read, only {DRAWING} and {METRES}"
        )
    return {**data, "levels": {str(k): v for k, v in levels.items() if isinstance(v, dict)}}


def _with_walls(levels: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    return {name: entries for name, entries in levels.items() if entries.get("walls")}


def _listed(entries: dict[str, Any], key: str, where: str) -> list[Any]:
    """An entry of a level that is a list, or may be missing."""
    found = entries.get(key) or []
    if not isinstance(found, list):
        raise MapError(f"{where}: {key} must be a list, got {shortened(found)}")
    return found


def _number(value: Any) -> float:
    """A number, which YAML may have read as a text (1e3); a flag is none."""
    if isinstance(value, bool):
        raise TypeError
    return float(value)


def _vertices(entries: dict[str, Any], where: str) -> Floats:
    """Float64 (n, 2) in pixels.

    Raises:
        MapError: A vertex has no two finite numbers.
    """
    try:
        listed = _listed(entries, "vertices", where)
        points = np.array([[_number(v[0]), _number(v[1])] for v in listed]).reshape(-1, 2)
    except (TypeError, ValueError, IndexError, KeyError, OverflowError):
        points = np.full((1, 2), math.nan)
    if not (np.abs(points) <= MOST_METRES).all():
        raise MapError(
            f"{where}: vertices must be lists that begin with two finite numbers, at most {MOST_METRES:g}"
        )
    return points


def _scale(entries: dict[str, Any], where: str) -> float:
    """Metres a pixel: the mean over the measurements; 0 without a usable one.

    Warns:
        MapWarning: Two of them differ by more than `_AGREE`.
    """
    points, found = _vertices(entries, where), list[tuple[float, str]]()
    for measurement in _listed(entries, "measurements", where):
        try:
            a, b, said = measurement[0], measurement[1], measurement[2]["distance"]
            metres = _number(said[1] if isinstance(said, list) else said)
            scale = metres / math.dist(points[a], points[b])
        except (TypeError, ValueError, IndexError, KeyError, OverflowError, ZeroDivisionError):
            continue
        if 0 < scale <= MOST_METRES:
            found.append((scale, f"{scale:.4g} from vertex {a} to {b}"))
    if not found:
        return 0.0
    mean = float(np.mean([scale for scale, _ in found]))
    (least, one), (most, other) = min(found), max(found)
    if most > (1 + _AGREE) * least:
        warnings.warn(
            f"{where}: measurements contradict each other, {one} and {other} metres a pixel: their mean "
            f"{mean:.4g} is taken; delete what is wrong in the traffic editor",
            MapWarning,
            stacklevel=2,
        )
    return mean


def _scale_by_fiducials(entries: dict[str, Any], data: dict[str, Any], path: Path) -> float:
    """Metres a pixel by the places that a level shares with that of reference; 0 where there are none."""
    levels: dict[str, dict[str, Any]] = data["levels"]
    name = str(data.get("reference_level_name") or next(iter(levels)))
    reference, where = levels.get(name, {}), f"{path}#{name}"
    here, there = (_fiducials(level, where) for level in (entries, reference))
    shared = sorted({*here} & {*there})[:_MOST_FIDUCIALS]
    pairs = [(math.dist(here[a], here[b]), math.dist(there[a], there[b])) for a, b in combinations(shared, 2)]
    ratios = [other / one for one, other in pairs if one > 0 and other > 0]
    scale = _scale(reference, where) * float(np.mean(ratios)) if ratios else 0.0
    return scale if scale <= MOST_METRES else 0.0


def _fiducials(entries: dict[str, Any], where: str) -> dict[str, tuple[float, float]]:
    """Pixels of the named places of a level; what is none is left out."""
    found = {}
    for each in _listed(entries, "fiducials", where):
        try:
            place = _number(each[0]), _number(each[1])
            if all(abs(value) <= MOST_METRES for value in place):
                found[str(each[2])[:100]] = place
        except (TypeError, ValueError, IndexError, KeyError, OverflowError):
            continue
    return found


def _segments(pairs: list[Any], points: Floats, what: str, dropped: Dropped) -> list[LineString]:
    """Segments between vertices; those of no length or of vertices that do not exist are left out."""
    found = []
    for pair in pairs:
        try:
            a, b = int(pair[0]), int(pair[1])
            line = LineString([points[a], points[b]])
        except (TypeError, ValueError, IndexError, KeyError, OverflowError):
            line = LineString()
        if line.is_empty or line.length < 1e-6 or min(a, b) < 0:
            dropped.add(f"{what} without two different vertices are left out")
            continue
        found.append(line)
    return found


def _filled(shape: BaseGeometry) -> BaseGeometry:
    """A shape without its holes."""
    return shapely.union_all([Polygon(part.exterior) for part in polygons_of(shape)])


def _floor(
    entries: dict[str, Any], points: Floats, walls: BaseGeometry, doors: list[LineString], where: str
) -> BaseGeometry:
    """What walls and doors enclose; where they are not closed, the slabs of the floor."""
    leaves = [door.buffer(WALL_THICKNESS, cap_style="square") for door in doors]
    # Filled before, so that doors are not laid over the outlines of thousands of rooms.
    inside = _filled(shapely.union_all([_filled(walls), *leaves]))
    slabs = []
    for slab in _listed(entries, "floors", where):
        try:
            slabs.append(Polygon(points[[int(v) for v in slab["vertices"]]]))
        except (TypeError, ValueError, IndexError, KeyError, OverflowError):
            continue
    check_outlines(where, slabs)
    ground = shapely.union_all([slab.buffer(0) for slab in slabs])
    # All walls lie inside, so that areas tell what an overlay of thousands of them would.
    return inside if inside.area - walls.area >= 0.5 * ground.area else inside.union(ground)
