"""Construction: from a space graph on wall centre lines to walls with thickness, net rooms and doors in them.

The outline grows by half an exterior wall, every space shrinks by half a wall, and what lies between is wall:
so rooms and walls never overlap, and shafts are solid without being drawn. Everything is rounded to
millimetres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from layoutexplore.maps.floorplan import Door, Room
from layoutexplore.maps.generator.config import DrawnConfig
from layoutexplore.maps.generator.doors import choose_closed, door_components, place_doors
from layoutexplore.maps.generator.space_graph import AttemptError, SpaceGraph

GRID = 0.001
"""Coordinates are whole millimetres."""


@dataclass(frozen=True, kw_only=True)
class Built:
    """A plan before furniture: rooms (renumbered from 1), doors, solid walls, fixtures (partitions)."""

    rooms: list[Room]
    doors: list[Door]
    walls: BaseGeometry
    fixtures: BaseGeometry


def net_polygons(graph: SpaceGraph, outline: Polygon, config: DrawnConfig) -> dict[int, Polygon]:
    """The floor of every space up to the faces of its walls, m.

    Raises:
        AttemptError: A space is too narrow to stand in.
    """
    inside = outline.buffer(-config.exterior_wall / 2, join_style="mitre")
    keys = list(graph.polygons)
    shrunk = shapely.buffer([graph.polygons[k] for k in keys], -config.interior_wall / 2, join_style="mitre")
    floors = shapely.set_precision(shapely.intersection(shrunk, inside), GRID)
    west, south, east, north = shapely.bounds(floors).T
    fills = shapely.area(floors) > (east - west) * (north - south) - 1e-9
    boxes = fills & (np.minimum(east - west, north - south) > 1.0)  # most: neither narrow nor with a neck
    net: dict[int, Polygon] = {}
    for key, floor, is_box in zip(keys, floors, boxes, strict=True):
        whole = floor.geom_type == "Polygon" and not floor.is_empty and not floor.interiors
        if not whole or (not is_box and floor.buffer(-0.45).is_empty):
            raise AttemptError(f"space {key} ({graph.labels[key]}) is too narrow")
        if not is_box and floor.buffer(-0.3, join_style="mitre").geom_type != "Polygon":
            raise AttemptError(f"space {key} ({graph.labels[key]}) has a neck")
        net[key] = shapely.normalize(floor)
    return net


def build_rooms(
    graph: SpaceGraph,
    outline: Polygon,
    config: DrawnConfig,
    closed_doors: float,
    rng: np.random.Generator,
    net: dict[int, Polygon] | None = None,
) -> Built:
    """Walls, rooms and doors of a space graph, of which the share `closed_doors` is shut.

    Args:
        graph: It.
        outline: Of the building, on the centre lines of its walls.
        config: The parameters.
        closed_doors: Share of the inner doors, 0-1.
        rng: Draws where doors stand and which are shut.
        net: Its `net_polygons`, where they are known.

    Raises:
        AttemptError: A door has no wall, a room is too narrow, or a room has no way in.
    """
    net = net_polygons(graph, outline, config) if net is None else net
    doors = place_doors(graph, outline, config, rng)
    number = {key: k + 1 for k, key in enumerate(sorted(net))}
    rooms = [Room(id=number[key], polygon=net[key], label=graph.labels[key]) for key in sorted(net)]
    number[0] = 0
    doors = [replace(door, rooms=(number[door.rooms[0]], number[door.rooms[1]])) for door in doors]
    ids = [room.id for room in rooms]
    parts = door_components(ids, doors, np.zeros(len(doors), np.bool_))
    if parts.max(initial=0) > 0:
        raise AttemptError("a room has no way in")
    for k in choose_closed(ids, doors, closed_doors, rng):
        doors[k] = replace(doors[k], is_open=False)
    outer = outline.buffer(config.exterior_wall / 2, join_style="mitre")
    walls = shapely.difference(outer, shapely.union_all([room.polygon for room in rooms]))
    walls = shapely.difference(walls, openings(doors, rooms))
    walls = shapely.union_all([walls, *graph.details])
    fixtures = shapely.union_all(graph.fixtures) if graph.fixtures else Polygon()
    return Built(rooms=rooms, doors=doors, walls=rounded(walls), fixtures=rounded(fixtures))


def openings(doors: Sequence[Door], rooms: Sequence[Room]) -> BaseGeometry:
    """The floor that the open doors cut through the walls."""
    polygons = {room.id: room.polygon for room in rooms}
    cuts = []
    for door in doors:
        if door.is_open:
            line = LineString([door.start, door.end])
            reach = max(_reach(line, polygons[key]) for key in door.rooms if key)
            cuts.append(line.buffer(reach + 0.02, cap_style="flat"))
    return shapely.union_all(cuts)


def _reach(line: LineString, room: Polygon) -> float:
    """How far the room's face lies from the door's line."""
    return float(
        shapely.distance(
            shapely.points([*line.coords, line.interpolate(0.5, normalized=True).coords[0]]), room
        ).max()
    )


def rounded(geometry: BaseGeometry) -> BaseGeometry:
    """Polygons on the millimetre grid, in normal form."""
    return shapely.normalize(shapely.set_precision(geometry, GRID))
