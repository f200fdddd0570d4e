"""Floor plans from rasters: room polygons and walls by exact tracing, doors from the gaps between rooms.

A door is found where free cells of no room join exactly two rooms over a small area (a doorway in an image
with a room per colour), or where two rooms touch. Its segment lies in the middle of the gap, across the way
through.
"""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np
import shapely

from layoutexplore.errors import MapError, checks_arguments, shortened
from layoutexplore.grids.arrays import Floats, Ints, Ints32, Mask
from layoutexplore.grids.components import components
from layoutexplore.grids.grid import in_cells
from layoutexplore.grids.morphology import with_neighbours
from layoutexplore.grids.outlines import trace_mask
from layoutexplore.grids.polygons import Point, polygons_of
from layoutexplore.maps.floorplan import Door, FloorPlan, Room
from layoutexplore.maps.raster import PlanRaster, meetings
from layoutexplore.maps.sizes import check_count, check_raster, windows

DOORWAY_AREA = 4.0
"""Square metres up to which a gap between two rooms counts as a doorway; larger ones are passages."""

LEAST_ROOM = 1.0
"""Square metres; smaller separate free areas of a map without room numbers are specks, not rooms."""

WALL_DEPTH = 0.5
"""Metres of the solid around the free space that are traced as walls."""


@checks_arguments
def plan_from_raster(
    source: PlanRaster,
    *,
    name: str,
    building: str = "",
    labels: Mapping[int, str] | None = None,
    metadata: Mapping[str, str] | None = None,
    oblique: bool = False,
) -> FloorPlan:
    """A floor plan whose truth is a raster.

    Args:
        source: The raster; a room id with several separate parts makes one room of its largest part, the rest
            becomes passages. Without any room id, each separate free area of at least a square metre is a
            room.
        name: The plan's name.
        building: The building's name; the plan's name when empty.
        labels: Room id -> label.
        metadata: Where it comes from.
        oblique: Doors where rooms touch may lie in any direction, not only along rows and columns.
    """
    where = f"plan {shortened(name)}"
    check_raster(where, source.occupied, source.room_ids)
    if not source.room_ids.any():
        source = PlanRaster(source.occupied, _free_areas(source), source.resolution, source.origin)
        check_count(where, "rooms", int(source.room_ids.max()))
    rooms = _trace_rooms(source, labels or {}, where)
    known = np.isin(source.room_ids, [room.id for room in rooms])
    source = PlanRaster(
        source.occupied, np.where(known, source.room_ids, 0), source.resolution, source.origin
    )
    corner = (source.origin.x, source.origin.y)
    loose = trace_mask(source.free & (source.room_ids == 0), source.resolution, corner)
    return FloorPlan(
        name=name,
        building=building,
        rooms=rooms,
        doors=trace_doors(source, where, oblique=oblique),
        walls=_trace_walls(source),
        passages=loose,
        source=source,
        metadata=metadata or {},
    )


def _free_areas(source: PlanRaster) -> Ints32:
    """A number for every separate free area that is large enough to be a room (the largest always is)."""
    _, parts, stats, _ = cv2.connectedComponentsWithStats(source.free.astype(np.uint8), connectivity=4)
    areas = stats[:, cv2.CC_STAT_AREA] * source.resolution**2
    areas[0] = 0.0
    large = (areas >= LEAST_ROOM) | (areas == areas.max())
    large[0] = False
    numbers = np.where(large, np.cumsum(large), 0)
    return np.asarray(numbers[parts], np.int32)


def _trace_rooms(source: PlanRaster, labels: Mapping[int, str], where: str) -> tuple[Room, ...]:
    """One room an id; parts of a room that lie apart are left to the passages."""
    rooms = []
    for number, box in windows(where, source.room_ids):
        mask = (source.room_ids[box] == number) & ~source.occupied[box]
        parts = polygons_of(trace_mask(mask, source.resolution, _corner(source, box)))
        if parts:
            largest = max(parts, key=lambda polygon: polygon.area)
            rooms.append(Room(id=number, polygon=largest, label=labels.get(number, "")))
    return tuple(rooms)


def _corner(source: PlanRaster, box: tuple[slice, slice]) -> Point:
    rows, cols = box
    x = source.origin.x + cols.start * source.resolution
    return x, source.origin.y + rows.start * source.resolution


def _trace_walls(source: PlanRaster) -> shapely.Geometry:
    """Outlines of the solid cells near free space."""
    border = in_cells(WALL_DEPTH, source.resolution)
    free = np.pad(source.free, border)
    corner = (source.origin.x - border * source.resolution, source.origin.y - border * source.resolution)
    return trace_mask(with_neighbours(free, border) & ~free, source.resolution, corner)


@checks_arguments
def trace_doors(source: PlanRaster, where: str = "the plan", *, oblique: bool = False) -> tuple[Door, ...]:
    """Doors between the rooms of a raster: small gaps that join two rooms, and where two rooms touch.

    Args:
        source: The raster.
        where: The plan, for messages.
        oblique: As for `plan_from_raster`.
    """
    gaps = (source.free & (source.room_ids == 0)).astype(np.uint8)
    _, parts = cv2.connectedComponents(gaps, connectivity=8, ltype=cv2.CV_32S)
    doors = []
    limit = DOORWAY_AREA / source.resolution**2
    for number, (rows, cols) in windows(where, parts.astype(np.int32)):
        window = _widen(rows, source.shape[0]), _widen(cols, source.shape[1])
        mask = parts[window] == number
        contacts = _contacts(mask, source.room_ids[window])
        if len(contacts) == 2 and mask.sum() <= limit:
            (a, side_a), (b, side_b) = contacts
            doors.append(_door(source, window, _centres(mask), _way_through(side_a, side_b), (a, b)))
    return tuple(door for door in [*doors, *_touching(source, oblique, where)] if door.width > 0)


def _way_through(side_a: Floats, side_b: Floats) -> Floats:
    """Direction (row, col) through a gap: across its faces float64 (n, 2), or, if short, between them."""
    spread = np.vstack([side - side.mean(axis=0) for side in (side_a, side_b)])
    values, axes = np.linalg.eigh(spread.T @ spread)
    if values[1] > 4.0 * values[0] and values[1] > 0.5:
        return np.asarray(axes[:, 0], np.float64)
    return np.asarray(side_b.mean(axis=0) - side_a.mean(axis=0), np.float64)


def _widen(window: slice, size: int) -> slice:
    return slice(max(0, window.start - 1), min(size, window.stop + 1))


def _contacts(mask: Mask, ids: Ints32) -> list[tuple[int, Floats]]:
    """Rooms that touch the mask, by id, with the cells float64 (n, 2) of each room that do."""
    ring = cv2.dilate(mask.astype(np.uint8), np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.uint8)) > 0
    touched = np.where(ring & ~mask, ids, 0)
    rooms, centres = touched[touched > 0], _centres(touched > 0)
    return [(int(rooms[group[0]]), centres[group]) for group in _grouped(rooms)]


def _grouped(keys: Ints | Ints32) -> list[Ints]:
    """Indices, rising, of the entries of each key (n,), by rising key."""
    order = np.argsort(keys, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(keys[order])) + 1) if len(order) else []


def _centres(mask: Mask) -> Floats:
    return np.argwhere(mask).astype(np.float64) + 0.5


def _touching(source: PlanRaster, oblique: bool, where: str) -> list[Door]:
    """A door for every stretch along which two rooms share the borders of cells."""
    ids = np.where(source.occupied, 0, source.room_ids)
    borders, pairs = [], []
    for (cells, rooms), step in zip(meetings(ids), ((1.0, 0.5), (0.5, 1.0)), strict=True):
        check_count(where, "cells where rooms touch", len(cells), "vertices")
        borders.append(cells + step)
        pairs.append(rooms)
    points, sides = np.concatenate(borders), np.concatenate(pairs)
    level = np.arange(len(points)) < len(borders[0])
    found = _grouped(sides[:, 0] << 32 | sides[:, 1])
    check_count(where, "doors", len(found))
    whole = slice(0, source.shape[0]), slice(0, source.shape[1])
    doors: list[Door] = []
    for members in found:
        check_count(where, "doors", len(doors))
        pair = int(sides[members[0], 0]), int(sides[members[0], 1])
        for stretch in _stretches(points[members]):
            group = members[stretch]
            across = np.array([1.0, 0.0]) if level[group].mean() >= 0.5 else np.array([0.0, 1.0])
            if oblique:
                across = _across(points[group], across)
            doors.append(_door(source, whole, points[group], across, pair))
    return doors


def _across(points: Floats, straight: Floats) -> Floats:
    """Direction across points (row, col) in line; `straight` where they lie in no line."""
    centred = points - points.mean(axis=0)
    values, axes = np.linalg.eigh(centred.T @ centred)
    return np.asarray(axes[:, 0], np.float64) if values[1] > 4.0 * values[0] else straight


def _stretches(points: Floats) -> list[Ints]:
    """Groups of points that lie within one cell of the next, as rising indices."""
    from scipy.spatial import cKDTree

    a, b = cKDTree(points).query_pairs(1.01, output_type="ndarray").T
    return _grouped(components(a, b, len(points)))


def _door(
    source: PlanRaster, window: tuple[slice, slice], points: Floats, across: Floats, rooms: tuple[int, int]
) -> Door:
    """The segment through the middle of the points (row, col), at right angles to the way through."""
    length = float(np.hypot(*across))
    way = across / length if length > 0 else np.array([1.0, 0.0])
    along = np.array([-way[1], way[0]])
    middle = points.mean(axis=0)
    spread = (points - middle) @ along
    half = 0.5 * (abs(along[0]) + abs(along[1]))
    ends = [middle + along * (spread.min() - half), middle + along * (spread.max() + half)]
    x, y = _corner(source, window)
    start, end = sorted(
        (x + float(e[1]) * source.resolution, y + float(e[0]) * source.resolution) for e in ends
    )
    return Door(start=start, end=end, rooms=rooms)


@checks_arguments
def floorplan_from_ascii(text: str, resolution: float = 1.0, *, name: str = "ascii") -> FloorPlan:
    """A floor plan drawn as text, one cell a character; the first line is the top (the highest y).

    Args:
        text: '#' and spaces are solid, '.' is free floor of no room (a door gap), every letter is a room with
            that letter as its label; a letter that fills separate areas is one room an area.
        resolution: Side of a character in metres.
        name: The plan's name.

    Example:
        >>> plan = floorplan_from_ascii('''
        ... #######
        ... #aa#bb#
        ... #aa.bb#
        ... #######
        ... ''')
        >>> [(room.label, room.polygon.area) for room in plan.rooms]
        [('a', 4.0), ('b', 4.0)]
        >>> plan.doors[0].start, plan.doors[0].end, plan.doors[0].rooms
        ((3.5, 1.0), (3.5, 2.0), (1, 2))
    """
    lines = [line.rstrip() for line in text.strip("\n").splitlines()]
    width = max((len(line) for line in lines), default=0)
    if width == 0:
        raise MapError("the drawing is empty")
    drawn = np.array([list(line.ljust(width)) for line in reversed(lines)])
    room_ids = np.zeros(drawn.shape, np.int32)
    labels: dict[int, str] = {}
    for letter in sorted(set(drawn.ravel()) - set("#. ")):
        count, parts = cv2.connectedComponents(
            (drawn == letter).astype(np.uint8), connectivity=4, ltype=cv2.CV_32S
        )
        for part in range(1, count):
            labels[len(labels) + 1] = str(letter)
            room_ids[parts == part] = len(labels)
    occupied = (drawn == "#") | (drawn == " ")
    return plan_from_raster(PlanRaster(occupied, room_ids, resolution), name=name, labels=labels)
