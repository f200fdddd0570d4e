"""What a robot needs of a building: its cleaned map, the outlines of its rooms, its doors, and a room graph.

All of it is in the frame of the map that the robot knows: metres of the map's own origin and yaw.
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

from layoutexplore.errors import checks_arguments
from layoutexplore.files import all_or_none, write_atomically, write_json
from layoutexplore.grids.grid import Pose
from layoutexplore.grids.morphology import depth_inside
from layoutexplore.grids.polygons import Point
from layoutexplore.grids.ros_map import save_grid
from layoutexplore.importing.building import Building
from layoutexplore.importing.openings import find_openings, middle_of_widest
from layoutexplore.maps.floorplan import Room
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.maps.sizes import windows

OUTLINE_TOLERANCE = 0.1
"""Metres by which a simple outline may miss the cells."""

ROBOT_FILES = ("map.yaml", "map.pgm", "rooms.geojson", "graph.json")
"""What is written for a robot."""

GOAL_RADIUS = 0.25
"""Metres of a robot, for its goals, unless said otherwise."""

CLEARANCE = 1.0
"""Metres to walls beyond which a goal is not better for being farther from them."""


def room_goals(building: Building, *, radius: float = GOAL_RADIUS) -> dict[int, Point | None]:
    """A place in each room that a robot can reach and that is away from walls, in the world frame.

    Args:
        building: The building.
        radius: Of the robot, in metres.

    Returns:
        (x, y) in metres by room; None where the robot cannot get into the room.
    """
    grid = building.grid
    raster = PlanRaster(~grid.free, building.room_ids, grid.resolution, grid.origin)
    reachable = raster.reachable(radius)
    clearance = np.minimum(depth_inside(grid.free) * grid.resolution, CLEARANCE)
    goals: dict[int, Point | None] = {room.id: None for room in building.plan.rooms}
    for number, window in windows(building.plan.name, building.room_ids):
        places = (building.room_ids[window] == number) & reachable[window]
        if number in goals and places.any():
            corner = window[0].start, window[1].start
            cells = np.argwhere(places) + corner
            row, col = cells[middle_of_widest(cells, clearance[window][places], 0.9)].tolist()
            goals[number] = _rounded(grid.cell_to_world(row, col))
    return goals


def room_graph(building: Building, *, radius: float = GOAL_RADIUS) -> dict[str, Any]:
    """Rooms as nodes, with area, label and goal, and doors and other openings as edges, for JSON.

    An edge has a place on the way and a width. Doors come first, in the plan's order, open or closed;
    openings join what else the robot can walk between.
    """
    goals = room_goals(building, radius=radius)
    edges = _door_edges(building)
    edges += _opening_edges(building, radius, len(edges))
    ways: dict[tuple[str, int], list[int]] = {}
    for edge in edges:
        for number in sorted(set(edge["rooms"])):
            ways.setdefault((edge["kind"], number), []).append(edge["id"])
    nodes = [
        {
            "id": room.id,
            "label": room.label,
            "area": round(room.polygon.area, 2),
            "goal": goals[room.id],
            "doors": ways.get(("door", room.id), []),
            "openings": ways.get(("opening", room.id), []),
        }
        for room in building.plan.rooms
    ]
    return {"frame": "map", "robot_radius": radius, "nodes": nodes, "edges": edges}


def _door_edges(building: Building) -> list[dict[str, Any]]:
    """An edge for every door of the plan, numbered as there."""
    lines = [
        _turned(shapely.LineString([door.start, door.end]), building.grid.origin)
        for door in building.plan.doors
    ]
    return [
        {
            "id": k,
            "kind": "door",
            "rooms": list(door.rooms),
            "place": _rounded(line.centroid.coords[0]),
            "width": round(door.width, 2),
            "open": door.is_open,
        }
        for k, (door, line) in enumerate(zip(building.plan.doors, lines, strict=True))
    ]


def _opening_edges(building: Building, radius: float, first: int) -> list[dict[str, Any]]:
    """An edge for every other way between rooms, numbered from `first`."""
    return [
        {
            "id": k,
            "kind": "opening",
            "rooms": list(opening.rooms),
            "place": _rounded(building.grid.cell_to_world(*opening.cell)),
            "width": round(opening.width, 2),
            "open": True,
        }
        for k, opening in enumerate(find_openings(building, radius=radius), start=first)
    ]


@checks_arguments
def write_robot_files(
    building: Building, folder: str | os.PathLike[str], *, radius: float = GOAL_RADIUS
) -> list[Path]:
    """Write map.yaml with map.pgm, rooms.geojson (outlines, doors, goals) and graph.json; the files written.

    Args:
        building: The building.
        folder: Where the files go.
        radius: Of the robot, in metres, for the goals and what it can walk between.

    Raises:
        WriteError: A file cannot be written.
    """
    folder = Path(folder)
    graph = room_graph(building, radius=radius)
    origin = building.grid.origin
    features = [
        _feature(_outline(room, origin), "room", id=room.id, label=room.label) for room in building.plan.rooms
    ]
    features += [
        _feature(shapely.Point(node["goal"]), "goal", room=node["id"])
        for node in graph["nodes"]
        if node["goal"]
    ]
    for edge in graph["edges"]:
        shape: BaseGeometry = shapely.Point(edge["place"])
        if edge["kind"] == "door":
            door = building.plan.doors[edge["id"]]
            shape = _turned(shapely.LineString([door.start, door.end]), origin)
        features.append(
            _feature(shape, edge["kind"], id=edge["id"], rooms=edge["rooms"], width=edge["width"])
        )
    collection = {"type": "FeatureCollection", "features": features}
    with all_or_none(folder) as beside:  # rooms and goals of another map would lead a robot astray
        save_grid(building.grid, beside / "map.yaml")
        write_json(beside / "graph.json", graph)
        write_atomically(beside / "rooms.geojson", json.dumps(collection) + "\n")
    return [folder / name for name in ROBOT_FILES]


def _outline(room: Room, origin: Pose) -> BaseGeometry:
    """A room's outline with few corners, in the world frame."""
    return _turned(room.polygon.simplify(OUTLINE_TOLERANCE), origin)


def _turned(shape: BaseGeometry, origin: Pose) -> BaseGeometry:
    """A shape of the plan, whose axes are the map's rows and columns, in the world frame."""
    turned = shapely.affinity.rotate(shape, origin.theta, origin=(origin.x, origin.y), use_radians=True)
    return shapely.transform(turned, lambda points: np.round(points, 3))


def _rounded(point: tuple[float, ...]) -> Point:
    return round(float(point[0]), 3), round(float(point[1]), 3)


def _feature(geometry: BaseGeometry, kind: str, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "geometry": mapping(geometry), "properties": {"kind": kind, **properties}}
