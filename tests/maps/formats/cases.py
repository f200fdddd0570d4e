"""Two rooms of 5 x 4 m side by side with a door of 0.9 m between them, in the formats of other programs."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from shapely import LineString, Polygon, box
from shapely.geometry import mapping
from shapely.geometry.base import BaseGeometry

from layoutexplore.maps.formats.geographic import METRES_PER_DEGREE

LONGITUDE, LATITUDE = 13.7, 60.0
LEFT, RIGHT = box(0, 0, 5, 4), box(5, 0, 10, 4)


def degrees(x: float, y: float) -> tuple[float, float]:
    """Longitude and latitude of a place in metres."""
    return LONGITUDE + x / (METRES_PER_DEGREE / 2), LATITUDE + y / METRES_PER_DEGREE


def on_earth(shape: BaseGeometry) -> dict[str, Any]:
    """A shape in metres as GeoJSON in degrees."""
    from shapely import transform

    return dict(mapping(transform(shape, lambda p: [degrees(x, y) for x, y in p.tolist()])))


def feature(shape: BaseGeometry | None, **properties: Any) -> dict[str, Any]:
    key = properties.pop("id", None)
    geometry = None if shape is None else on_earth(shape)
    return {"type": "Feature", "id": key, "properties": properties, "geometry": geometry}


def write_collection(path: Path, *features: dict[str, Any]) -> Path:
    path.write_text(json.dumps({"type": "FeatureCollection", "features": list(features)}))
    return path


def write_imdf(folder: Path, *, homes: tuple[str, ...] = ("a",)) -> Path:
    """Two floors a building; the upper one is a single room without a door."""
    folder.mkdir(exist_ok=True)
    levels, units, doors = [], [], []
    for home in homes:
        for floor in (0, 1):
            key = f"{home}{floor}"
            levels.append(
                feature(None, id=key, short_name={"en": str(floor)}, ordinal=floor, building_ids=[home])
            )
        units += [
            feature(LEFT, level_id=f"{home}0", category="classroom"),
            feature(RIGHT, level_id=f"{home}0", category="walkway"),
            feature(box(1, 1, 2, 2), level_id=f"{home}0", category="column"),
            feature(LEFT, level_id=f"{home}1", category="office"),
        ]
        doors.append(feature(LineString([(5, 1), (5, 1.9)]), level_id=f"{home}0", category="automobile"))
    write_collection(folder / "level.geojson", *levels)
    write_collection(folder / "unit.geojson", *units)
    write_collection(folder / "opening.geojson", *doors)
    return folder


class OsmFile:
    """Collects nodes and ways of an OpenStreetMap file."""

    def __init__(self) -> None:
        self.nodes: dict[tuple[float, float], int] = {}
        self.tags: dict[int, Mapping[str, str]] = {}
        self.ways: list[str] = []
        self.relations: list[str] = []

    def node(self, x: float, y: float, **tags: str) -> int:
        number = self.nodes.setdefault((x, y), -len(self.nodes) - 1)
        if tags:
            self.tags[number] = tags
        return number

    def way(self, points: list[tuple[float, float]], **tags: str) -> None:
        refs = "".join(f"<nd ref='{self.node(*point)}'/>" for point in points)
        self.ways.append(f"<way id='{-1000 - len(self.ways)}'>{refs}{_tags(tags)}</way>")

    def multipolygon(
        self, outer: list[list[tuple[float, float]]], inner: list[tuple[float, float]], **tags: str
    ) -> None:
        """A relation of outer lines and one inner ring."""
        members = ""
        for role, points in [*(("outer", line) for line in outer), ("inner", inner)]:
            self.way(points)
            members += f"<member type='way' ref='{-999 - len(self.ways)}' role='{role}'/>"
        self.relations.append(
            f"<relation id='-5'>{members}{_tags({'type': 'multipolygon', **tags})}</relation>"
        )

    def write(self, path: Path) -> Path:
        nodes = ""
        for (x, y), number in self.nodes.items():
            lon, lat = degrees(x, y)
            inside = _tags(self.tags.get(number, {}))
            nodes += f"<node id='{number}' lon='{lon:.10f}' lat='{lat:.10f}'>{inside}</node>"
        path.write_text(f"<osm version='0.6'>{nodes}{''.join(self.ways + self.relations)}</osm>")
        return path


def _tags(tags: Mapping[str, str]) -> str:
    return "".join(f"<tag k='{key.replace('__', ':')}' v='{value}'/>" for key, value in tags.items())


def corners(shape: Polygon) -> list[tuple[float, float]]:
    return [(x, y) for x, y in shape.exterior.coords]


def write_osm(path: Path) -> Path:
    """Floor 0: a room and a corridor, a door on their shared outline; floor 1: one room on both floors."""
    file = OsmFile()
    file.node(5, 2, door="hinged", level="0")
    left = [(0, 0), (5, 0), (5, 2), (5, 4), (0, 4), (0, 0)]
    right = [(5, 0), (10, 0), (10, 4), (5, 4), (5, 2), (5, 0)]
    file.way(left, indoor="room", level="0", room="office")
    file.way(right, indoor="corridor", level="0-1")
    file.way([(0, 0), (20, 0)], highway="footway")
    return file.write(path)


def write_osmag(path: Path) -> Path:
    file = OsmFile()
    file.way(corners(LEFT), osmAG__type="area", osmAG__areaType="room", level="1", indoor="room")
    file.way(corners(RIGHT), osmAG__type="area", osmAG__areaType="room", level="1", indoor="room")
    file.way([(5, 1), (5, 2.1)], osmAG__type="passage", osmAG__from="-1000", osmAG__to="-1001", level="1")
    file.way(corners(box(-1, -1, 11, 5)), osmAG__type="area", osmAG__areaType="structure", level="1")
    return file.write(path)


RMF = """
name: two
levels:
  L1:
    elevation: 0
    drawing: {filename: two.png}
    vertices:
    - [0, 0, 0, ""]
    - [250, 0, 0, ""]
    - [500, 0, 0, ""]
    - [500, 200, 0, ""]
    - [250, 200, 0, ""]
    - [0, 200, 0, ""]
    - [250, 80, 0, ""]
    - [250, 125, 0, ""]
    walls:
    - [0, 1, {}]
    - [1, 2, {}]
    - [2, 3, {}]
    - [3, 4, {}]
    - [4, 5, {}]
    - [5, 0, {}]
    - [1, 6, {}]
    - [7, 4, {}]
    doors:
    - [6, 7, {name: [1, d], type: [1, hinged]}]
    measurements:
    - [0, 2, {distance: [3, 10.0]}]
"""


def write_rmf(path: Path) -> Path:
    path.write_text(RMF)
    return path


def write_walls(path: Path) -> Path:
    """Walls, a window and a door with a thickness in a GeoJSON, and a lift in the right room."""
    wall = box(0, 0, 10, 4) - box(0.2, 0.2, 4.9, 3.8) - box(5.1, 0.2, 9.8, 3.8)
    door = box(4.9, 1, 5.1, 1.9)
    return write_collection(
        path,
        feature(box(0, 0, 10, 4), type="building_outline"),
        feature(wall - door, type="wall"),
        feature(door, type="door"),
        feature(box(9.2, 3, 9.8, 3.8), type="elevator"),
    )


class IfcModel:
    """Collects spaces, walls and openings of an IFC model that measures in millimetres."""

    def __init__(self) -> None:
        self.api = pytest.importorskip("ifcopenshell.api")
        self.file = self.run("project.create_file")
        project = self.add("IfcProject", "model")
        self.run(
            "unit.assign_unit", units=[self.run("unit.add_si_unit", unit_type="LENGTHUNIT", prefix="MILLI")]
        )
        model = self.run("context.add_context", context_type="Model")
        self.body = self.run(
            "context.add_context",
            context_type="Model",
            context_identifier="Body",
            target_view="MODEL_VIEW",
            parent=model,
        )
        self.site = self.part("IfcSite", "site", project)

    def run(self, usecase: str, **arguments: Any) -> Any:
        given = () if usecase == "project.create_file" else (self.file,)
        return self.api.run(usecase, *given, **arguments)

    def add(self, kind: str, name: str) -> Any:
        return self.run("root.create_entity", ifc_class=kind, name=name)

    def part(self, kind: str, name: str, whole: Any) -> Any:
        """An element that is a part of another."""
        element = self.add(kind, name)
        self.run("aggregate.assign_object", products=[element], relating_object=whole)
        return element

    def storey(self, building: Any, name: str, elevation: float) -> Any:
        storey = self.part("IfcBuildingStorey", name, building)
        storey.Elevation = 1000.0 * elevation
        return storey

    def block(self, element: Any, area: Polygon, bottom: float, height: float) -> Any:
        """Give an element the shape of an area [m], extruded."""
        points = [(1000.0 * x, 1000.0 * y) for x, y in area.exterior.coords]
        make = self.file.create_entity
        curve = make("IfcPolyline", [make("IfcCartesianPoint", point) for point in points])
        origin = make(
            "IfcAxis2Placement3D", make("IfcCartesianPoint", (0.0, 0.0, 1000.0 * bottom)), None, None
        )
        up = make("IfcDirection", (0.0, 0.0, 1.0))
        profile = make("IfcArbitraryClosedProfileDef", "AREA", None, curve)
        solid = make("IfcExtrudedAreaSolid", profile, origin, up, 1000.0 * height)
        shape = make("IfcShapeRepresentation", self.body, "Body", "SweptSolid", [solid])
        self.run("geometry.assign_representation", product=element, representation=shape)
        self.run("geometry.edit_object_placement", product=element)
        return element

    def space(self, storey: Any, area: Polygon, name: str, bottom: float = 0.0) -> Any:
        return self.block(self.part("IfcSpace", name, storey), area, bottom, 2.7)

    def wall(self, storey: Any, area: Polygon, bottom: float = 0.0) -> Any:
        wall = self.add("IfcWall", "wall")
        self.run("spatial.assign_container", products=[wall], relating_structure=storey)
        return self.block(wall, area, bottom, 3.0)

    def hole(self, wall: Any, area: Polygon, bottom: float = 0.0, height: float = 2.1) -> Any:
        hole = self.block(self.add("IfcOpeningElement", "hole"), area, bottom, height)
        self.run("feature.add_feature", feature=hole, element=wall)
        return hole

    def door(self, storey: Any, hole: Any, width: float) -> Any:
        door = self.add("IfcDoor", "door")
        door.OverallWidth = 1000.0 * width
        self.run("spatial.assign_container", products=[door], relating_structure=storey)
        self.run("feature.add_filling", opening=hole, element=door)
        return door

    def write(self, path: Path) -> Path:
        self.file.write(str(path))
        return path


def write_ifc(path: Path) -> Path:
    """Two storeys; spaces up to the faces of walls of 0.2 m, and a door in its hole; above it one room."""
    model = IfcModel()
    building = model.part("IfcBuilding", "house", model.site)
    ground, upper = model.storey(building, "EG", 0.0), model.storey(building, "1. OG", 3.0)
    model.space(ground, box(0.1, 0.1, 4.9, 3.9), "Büro")
    model.space(ground, box(5.1, 0.1, 9.9, 3.9), "Flur")
    wall = model.wall(ground, box(4.9, -0.1, 5.1, 4.1))
    for area in (
        box(-0.1, -0.1, 0.1, 4.1),
        box(9.9, -0.1, 10.1, 4.1),
        box(0, -0.1, 10, 0.1),
        box(0, 3.9, 10, 4.1),
    ):
        model.wall(ground, area)
    model.door(ground, model.hole(wall, box(4.9, 1, 5.1, 1.9)), 0.9)
    model.space(upper, box(0.1, 0.1, 4.9, 3.9), "Dach", 3.0)
    return model.write(path)
