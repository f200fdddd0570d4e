"""What an IFC model says of its floors, in metres: run by itself, as a process of its own.

    python -m layoutexplore.maps.formats.ifc_geometry MODEL.ifc FLOORS.json

IfcOpenShell builds solids in compiled code, which a broken model can bring down; here it takes only this
process with it. What spaces, walls, columns and openings are as seen from above is written as JSON.
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from layoutexplore.errors import cause, checks_arguments, require
from layoutexplore.files import write_json
from layoutexplore.grids.arrays import Floats

MOST_BYTES = 6 * 2**30
"""Of memory that this process may ask for."""

NO_ROOM = ("EXTERNAL", "GFA")
SOLID = ("IfcWall", "IfcColumn", "IfcCurtainWall")
PASSABLE = (1.8, 0.5, 0.35)
"""Metres: a hole in a wall without door or window is a doorway if so high, so wide, so near to the floor."""

KNEE = 0.5
"""Metres above the floor: walls that begin above it hang over an opening, those that end below are steps."""

_LONGEST_NAME = 100
_SNAP = 1e-4
_TINY = 1e-6


class _Model:
    """A model and the shapes of its elements.

    Args:
        path: The file.
    """

    def __init__(self, path: Path) -> None:
        self._geometry = require("ifcopenshell.geom", "bim")
        self.elements = require("ifcopenshell.util.element", "bim")
        units = require("ifcopenshell.util.unit", "bim")
        self.file = require("ifcopenshell", "bim").open(str(path))
        self.scale = float(units.calculate_unit_scale(self.file))
        self._settings = self._geometry.settings()
        self._settings.set("use-world-coords", True)
        self._settings.set("disable-opening-subtractions", True)
        self.without_shape = 0

    def triangles(self, element: Any) -> Floats:
        """Float64 (n, 3 corners, xyz) in metres; none where the element has no shape that can be built."""
        try:
            shape = self._geometry.create_shape(self._settings, element).geometry
        except RuntimeError:
            return np.empty((0, 3, 3))
        corners = np.array(shape.verts, np.float64).reshape(-1, 3)
        return np.asarray(corners[np.array(shape.faces, np.int64).reshape(-1, 3)])

    def outline(self, element: Any) -> BaseGeometry:
        """The element as seen from above."""
        return _from_above(self.triangles(element))

    def storey(self, element: Any) -> Any:
        """The storey that an element is in or a part of, through whatever it belongs to; None for none."""
        for _ in range(20):
            if element is None or element.is_a("IfcBuildingStorey"):
                return element
            element = self.elements.get_aggregate(element) or self.elements.get_container(element)
        return None

    def all(self, *kinds: str) -> Iterator[Any]:
        """The elements of these classes; a class that the model's schema does not know has none."""
        for kind in kinds:
            try:
                yield from self.file.by_type(kind)
            except RuntimeError:
                continue


def _from_above(triangles: Floats) -> BaseGeometry:
    """The union of triangles (n, 3 corners, xyz), seen from above."""
    if not len(triangles) or not np.isfinite(triangles).all():
        return shapely.Polygon()
    flat = shapely.polygons(triangles[:, :, :2])
    return shapely.union_all(flat[shapely.area(flat) > _TINY], grid_size=_SNAP)


@checks_arguments
def floors_of_model(path: Path) -> dict[str, Any]:
    """The floors of a model, from below.

    Args:
        path: The file.

    Returns:
        `floors`: of each storey with a space its name, the name of its building, its spaces as (label, WKT),
        its `solid` parts as WKT, and its openings as (x, y, width). `without_shape`: spaces that have none.

    Raises:
        Exception: Whatever IfcOpenShell says of a file that is none.
    """
    model = _Model(path)
    floors: dict[int, dict[str, Any]] = {}
    for space in model.all("IfcSpace"):
        storey = model.storey(space)
        if storey is None or getattr(space, "PredefinedType", None) in NO_ROOM:
            continue
        triangles = model.triangles(space)
        outline = _from_above(triangles)
        if outline.is_empty:
            model.without_shape += 1
            continue
        floor = floors.setdefault(storey.id(), _floor(model, storey))
        floor["bottoms"].append(float(triangles[..., 2].min()))
        floor["spaces"].append([str(space.LongName or space.Name or "")[:_LONGEST_NAME], outline.wkt])
    grounds = {key: float(np.median(floor.pop("bottoms"))) for key, floor in floors.items()}
    for key, parts in _solid(model, grounds).items():
        floors[key]["solid"] = shapely.union_all(parts, grid_size=_SNAP).wkt
    for key, opening in _openings(model, grounds):
        floors[key]["openings"].append(opening)
    ordered = sorted(floors.values(), key=lambda floor: (floor["building"], floor["height"], floor["name"]))
    return {"floors": ordered, "without_shape": model.without_shape}


def _floor(model: _Model, storey: Any) -> dict[str, Any]:
    building = model.elements.get_aggregate(storey)
    return {
        "name": str(storey.Name or storey.LongName or f"{_height(model, storey):g}")[:_LONGEST_NAME],
        "building": str(getattr(building, "Name", "") or "")[:_LONGEST_NAME],
        "height": _height(model, storey),
        "spaces": [],
        "bottoms": [],
        "openings": [],
    }


def _height(model: _Model, storey: Any) -> float:
    return float(getattr(storey, "Elevation", None) or 0.0) * model.scale


def _solid(model: _Model, grounds: Mapping[int, float]) -> dict[int, list[BaseGeometry]]:
    """Walls and columns that stand in the way, seen from above, by storey; curtain walls may have parts."""
    found: dict[int, list[BaseGeometry]] = {key: [] for key in grounds}
    for element in model.all(*SOLID):
        home = model.storey(element)
        if home is None or home.id() not in found:
            continue
        knee = grounds[home.id()] + KNEE
        for part in (element, *(model.elements.get_parts(element) or ())):
            triangles = model.triangles(part)
            if len(triangles) and triangles[..., 2].min() <= knee <= triangles[..., 2].max():
                found[home.id()].append(_from_above(triangles))
    return found


def _openings(model: _Model, grounds: Mapping[int, float]) -> Iterator[tuple[int, list[float]]]:
    """Where one walks through a wall, as (storey, (x, y, width)): doors, and holes down to the floor."""
    for door in model.all("IfcDoor"):
        hole = next((fill.RelatingOpeningElement for fill in door.FillsVoids or ()), None)
        home = model.storey(door) or (_host(model, hole) if hole is not None else None)
        if home is None or home.id() not in grounds:
            continue
        outline = model.outline(hole) if hole is not None else shapely.Polygon()
        outline = model.outline(door) if outline.is_empty else outline
        if not outline.is_empty:
            yield home.id(), _placed(outline, float(door.OverallWidth or 0.0) * model.scale)
    for hole in model.all("IfcOpeningElement"):
        home = None if hole.HasFillings else _host(model, hole)
        if home is None or home.id() not in grounds:
            continue
        triangles = model.triangles(hole)
        if not len(triangles):
            continue
        low, high = float(triangles[..., 2].min()), float(triangles[..., 2].max())
        if high - low >= PASSABLE[0] and abs(low - grounds[home.id()]) <= PASSABLE[2]:
            place = _placed(_from_above(triangles), 0.0)
            if place[2] >= PASSABLE[1]:
                yield home.id(), place


def _host(model: _Model, hole: Any) -> Any:
    """The storey of the wall that a hole is in; None for a hole in something else."""
    host = next((void.RelatingBuildingElement for void in hole.VoidsElements or ()), None)
    return model.storey(host) if host is not None and host.is_a("IfcWall") else None


def _placed(outline: BaseGeometry, width: float) -> list[float]:
    """Middle of an opening, and its width: what the model says, or the longer side of its outline."""
    box = outline.minimum_rotated_rectangle
    points = shapely.get_coordinates(box)
    longest = float(np.hypot(*np.diff(points, axis=0).T).max(initial=0.0))
    return [float(box.centroid.x), float(box.centroid.y), width or longest]


@checks_arguments
def write_floors(source: str, target: str) -> int:
    """Write the floors of a model; what is wrong with it goes to the error stream, and the status is 1."""
    try:
        write_json(Path(target), floors_of_model(Path(source)))
    except Exception as error:
        print(cause(error), file=sys.stderr)
        return 1
    return 0


def _limit_memory() -> None:
    with contextlib.suppress(ImportError, ValueError, OSError):  # no such limit on this system
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))


if __name__ == "__main__":
    _limit_memory()
    sys.exit(write_floors(*sys.argv[1:]))
