"""Furniture as it is drawn into maps of whole buildings: along the walls of its room, whatever way they run.

Cupboards stand at the walls, some of them through one; tables on legs with chairs stand along the longest
wall; columns stand anywhere. What stands in a door is left out.
"""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from layoutexplore.grids.arrays import Bytes, Floats, Mask
from layoutexplore.grids.grid import Pose
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.raster import PlanRaster

CLEAR = 0.8
"""Around a door nothing stands that is no thinner than a leg [m]."""

THROUGH = (0.0, 0.0, 0.0, 0.05, 0.1, 0.2)
"""How far a cupboard may reach into its wall, one of them for each [m]."""


def draw_furniture(plan: FloorPlan, raster: PlanRaster, rng: np.random.Generator) -> Mask:
    """The occupied cells of a plan's raster with furniture in most of its rooms: bool (rows, cols)."""
    canvas = raster.occupied.astype(np.uint8)
    doors = [shapely.LineString([door.start, door.end]).buffer(CLEAR) for door in plan.doors if door.is_open]
    clear = shapely.union_all(doors)
    shapely.prepare(clear)
    cupboards, tables, columns = rng.uniform(0.1, 0.9), rng.uniform(0.2, 1.2), rng.uniform(0.0, 0.7)
    for room in plan.rooms:
        if rng.random() < 0.1:
            continue
        pieces = [
            *_cupboards(room.polygon, float(cupboards), rng),
            *_columns(room.polygon, float(columns), rng),
        ]
        wanted = float(tables) * room.polygon.area / 12
        legs = [leg for leg in _tables(room.polygon, wanted, rng) if room.polygon.contains(leg)]
        pieces = [piece for piece in pieces if not clear.intersects(piece)]
        for piece in (*pieces, *legs):
            _fill(canvas, piece, raster.origin, raster.resolution)
    return canvas > 0


def _fill(canvas: Bytes, shape: BaseGeometry, origin: Pose, resolution: float) -> None:
    points = (shapely.get_coordinates(shape) - (origin.x, origin.y)) / resolution - 0.5
    cv2.fillPoly(canvas, [np.rint(points * 16).astype(np.int32)], 1, cv2.LINE_8, 4)


def _box(centre: Floats, along: Floats, length: float, depth: float) -> Polygon:
    """A rectangle whose length runs along a direction."""
    u, v = 0.5 * length * along, 0.5 * depth * np.array([-along[1], along[0]])
    return Polygon([centre - u - v, centre + u - v, centre + u + v, centre - u + v])


def _walls(room: Polygon) -> list[tuple[Floats, Floats, float]]:
    """The walls of a room, counter-clockwise: where each begins, its direction and its length."""
    ring = shapely.get_coordinates(shapely.geometry.polygon.orient(room).exterior)
    steps = np.diff(ring, axis=0)
    lengths = np.hypot(*steps.T)
    return [(ring[k], steps[k] / lengths[k], float(lengths[k])) for k in np.flatnonzero(lengths > 0.1)]


def _cupboards(room: Polygon, count: float, rng: np.random.Generator) -> Iterator[BaseGeometry]:
    """About so many at each wall, in its corners or anywhere along it."""
    for begin, along, length in _walls(room):
        inward = np.array([-along[1], along[0]])
        for _ in range(int(rng.poisson(count)) if length > 1.2 else 0):
            long, depth = min(float(rng.uniform(0.7, 2.0)), length - 0.2), float(rng.uniform(0.35, 0.6))
            at = float(rng.choice([0.05, length - long - 0.05, rng.uniform(0.0, length - long)])) + long / 2
            away = depth / 2 - float(rng.choice(THROUGH))
            yield _box(begin + at * along + away * inward, along, long, depth)


def _columns(room: Polygon, count: float, rng: np.random.Generator) -> Iterator[BaseGeometry]:
    for place in _places(room, int(rng.poisson(count)), rng):
        yield shapely.Point(*place).buffer(float(rng.uniform(0.12, 0.25)))


def _places(room: Polygon, count: int, rng: np.random.Generator) -> Floats:
    """Some of so many random places in the bounding box of a room."""
    x0, y0, x1, y1 = room.bounds
    return np.asarray(rng.uniform((x0, y0), (x1, y1), (count, 2)))


def _tables(room: Polygon, count: float, rng: np.random.Generator) -> Iterator[BaseGeometry]:
    """The legs of about so many tables and of the chairs at them."""
    _, longest, _ = max(_walls(room), key=lambda wall: wall[2])
    for place in _places(room, int(rng.poisson(count)), rng):
        along = longest if rng.random() < 0.8 else _direction(float(rng.uniform(0, np.pi)))
        size = (
            rng.uniform((1.0, 0.7), (2.4, 1.2)) if rng.random() < 0.9 else rng.uniform((2.5, 1.8), (4.0, 3.0))
        )
        yield from _table(place, along, size, rng)


def _direction(angle: float) -> Floats:
    return np.array([np.cos(angle), np.sin(angle)])


def _table(place: Floats, along: Floats, size: Floats, rng: np.random.Generator) -> Iterator[BaseGeometry]:
    across, leg = np.array([-along[1], along[0]]), float(rng.uniform(0.05, 0.11))
    count = int(size[0]) + 2

    def at(x: float, y: float) -> Floats:
        return np.asarray(place + x * along + y * across)

    for x in np.linspace(-0.5, 0.5, count) * size[0]:
        for side in (-0.5, 0.5):
            yield shapely.Point(*at(x, side * size[1])).buffer(leg)
    for _ in range(int(rng.integers(1, 2 * count))):
        x, side = float(rng.uniform(-0.5, 0.5)) * size[0], float(rng.choice([-1.0, 1.0]))
        y = side * (size[1] / 2 + float(rng.uniform(0.0, 0.35)))
        for dx, dy in ((-0.18, -0.18), (-0.18, 0.18), (0.18, -0.18), (0.18, 0.18)):
            yield _box(at(x + dx, y + dy), along, 0.05, 0.05)
