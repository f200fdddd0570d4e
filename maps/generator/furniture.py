"""Furniture: rectangles and circles that stand on the floor, and never in the way.

Every room type has a small catalogue of pieces that stand against a wall or free in the room. A piece is kept
only when a robot of 0.3 m radius can still go from every door of the room to everywhere else it could go
before, which leaves a margin for rasterisation at 0.1 m around the promised 0.2 m.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

from layoutexplore.grids.arrays import Floats
from layoutexplore.maps.floorplan import Door, Room
from layoutexplore.maps.generator.construction import Built, rounded

CLEARANCE = 0.3
"""Half the width of the ways that stay clear, m."""

SWING = 0.8
"""Depth of the floor before a door that stays clear, m."""


ROW_GAP = 0.75
"""Way between free-standing tables, m."""


@dataclass(frozen=True, kw_only=True)
class Piece:
    """A piece of furniture: width along the wall and depth, m; whether it stands at a wall, and is round."""

    width: float
    depth: float
    wall: bool = True
    round: bool = False


DESK, SHELF, LOCKER = Piece(width=1.6, depth=0.8), Piece(width=1.2, depth=0.4), Piece(width=0.8, depth=0.5)
CHAIR, STOOL = (
    Piece(width=0.5, depth=0.5, wall=False, round=True),
    Piece(width=0.4, depth=0.4, wall=False, round=True),
)
TABLE, DINING = Piece(width=2.4, depth=1.1, wall=False), Piece(width=1.4, depth=0.9, wall=False)
PUPIL = Piece(width=1.3, depth=0.6, wall=False)
BENCH, SOFA, BED = Piece(width=1.8, depth=0.5), Piece(width=2.0, depth=0.9), Piece(width=1.0, depth=2.0)
DOUBLE_BED, COUNTER, WARDROBE = (
    Piece(width=1.7, depth=2.0),
    Piece(width=2.0, depth=0.6),
    Piece(width=1.5, depth=0.6),
)
ROUND = Piece(width=1.1, depth=1.1, wall=False, round=True)

CATALOGUE: Mapping[str, Sequence[Piece]] = {
    "office": (DESK, DESK, SHELF, LOCKER, CHAIR),
    "open office": (DESK, DESK, TABLE, SHELF, CHAIR, CHAIR),
    "meeting": (TABLE, TABLE, CHAIR, CHAIR, SHELF),
    "classroom": (PUPIL, PUPIL, PUPIL, CHAIR, SHELF, DESK),
    "laboratory": (COUNTER, COUNTER, TABLE, STOOL, SHELF),
    "library": (Piece(width=3.0, depth=0.5, wall=False), SHELF, TABLE, CHAIR),
    "cafeteria": (DINING, ROUND, CHAIR, CHAIR, COUNTER),
    "aula": (Piece(width=3.0, depth=0.5, wall=False), CHAIR),
    "gym": (BENCH, LOCKER),
    "lobby": (SOFA, ROUND, BENCH),
    "hall": (DESK, CHAIR, TABLE, LOCKER, CHAIR),
    "ward": (BED, BED, LOCKER, CHAIR),
    "day room": (SOFA, ROUND, CHAIR, CHAIR),
    "nurse station": (COUNTER, DESK, CHAIR, SHELF),
    "treatment": (BED, COUNTER, CHAIR, SHELF),
    "living": (SOFA, DINING, SHELF, CHAIR, ROUND),
    "bedroom": (DOUBLE_BED, WARDROBE, LOCKER, DESK),
    "studio": (BED, DESK, WARDROBE, DINING, CHAIR),
    "kitchen": (COUNTER, COUNTER, DINING, CHAIR),
    "storage": (SHELF, SHELF, LOCKER),
}
"""Pieces by the label of the room; other rooms (corridors, stairs, toilets, bathrooms) stay empty."""


def place_furniture(built: Built, clutter: float, rng: np.random.Generator) -> BaseGeometry:
    """The solid furniture of a plan: fixtures, and pieces on a share `clutter` of every room's floor."""
    pieces: list[BaseGeometry] = [built.fixtures] if not built.fixtures.is_empty else []
    if clutter > 0:
        solid = shapely.union(built.walls, built.fixtures)
        shapely.prepare(solid)
        for room in built.rooms:
            if room.label in CATALOGUE:
                doors = [door for door in built.doors if room.id in door.rooms]
                pieces += _furnish_room(room, doors, solid, clutter * float(rng.uniform(0.6, 1.4)), rng)
    return rounded(shapely.union_all(pieces)) if pieces else Polygon()


def _furnish_room(
    room: Room, doors: Sequence[Door], solid: BaseGeometry, share: float, rng: np.random.Generator
) -> list[BaseGeometry]:
    """Pieces for one room, tried one after the other until the share is reached."""
    inside = (
        shapely.difference(room.polygon, solid)
        if solid.intersects(room.polygon.buffer(-0.02))
        else room.polygon
    )
    if room.polygon.area < 4.0 or inside.geom_type != "Polygon":
        return []
    clear = shapely.union_all([_swing(door) for door in doors])
    ways = inside.buffer(-CLEARANCE)
    at_doors = clear.intersection(inside).buffer(-0.1)
    if ways.geom_type != "Polygon":
        return []
    standing: list[BaseGeometry] = []
    covered, wanted, misses = 0.0, share * room.polygon.area, 0
    kinds = CATALOGUE[room.label]
    edges = _edges(room.polygon)
    while covered < wanted and misses < 12 + len(standing):
        shape = _draw_piece(kinds[int(rng.integers(0, len(kinds)))], room.polygon, edges, rng)
        left = _without(ways, shape, standing, inside, clear) if shape is not None else None
        if shape is None or left is None or not left.distance(at_doors) < 0.35:  # of no floor it is NaN
            misses += 1
            continue
        ways = left
        standing.append(shape)
        covered += shape.area
    return standing


def _swing(door: Door) -> Polygon:
    """The floor on both sides of a door that stays clear."""
    return LineString([door.start, door.end]).buffer(SWING, cap_style="flat")


def _without(
    ways: Polygon, shape: Polygon, standing: Sequence[BaseGeometry], inside: Polygon, clear: BaseGeometry
) -> Polygon | None:
    """The paths left free beside a new piece, or None where it would stand in one, or in something else."""
    if clear.intersects(shape) or not inside.covers(shape):
        return None
    if standing and shapely.distance(standing, shape).min() < 0.05:
        return None
    left = ways.difference(shape.buffer(CLEARANCE, quad_segs=2))
    return left if left.geom_type == "Polygon" and not left.is_empty else None


def _edges(room: Polygon) -> Floats:
    """Walls over 0.8 m, float64 (n, 4) as (x0, y0, x1, y1), counter-clockwise: the room is on their left."""
    ring = shapely.get_coordinates(shapely.geometry.polygon.orient(room).exterior)
    edges = np.hstack([ring[:-1], ring[1:]])
    long = np.hypot(edges[:, 2] - edges[:, 0], edges[:, 3] - edges[:, 1]) > 0.8
    return edges[long] if long.any() else edges


def _draw_piece(kind: Piece, room: Polygon, edges: Floats, rng: np.random.Generator) -> Polygon | None:
    """A piece at a random place: at a wall, often in its corner, or somewhere in the room, tables in rows."""
    lengths = np.hypot(edges[:, 2] - edges[:, 0], edges[:, 3] - edges[:, 1])
    k = int(rng.choice(len(edges), p=lengths / lengths.sum()))
    along = (edges[k, 2:] - edges[k, :2]) / lengths[k]
    inward = np.array([-along[1], along[0]])
    if not kind.wall:
        x0, y0, x1, y1 = room.bounds
        centre = np.array([rng.uniform(x0, x1), rng.uniform(y0, y1)])
        if kind.round:
            return Point(centre).buffer(kind.width / 2, quad_segs=3)
        return _in_rows(kind, centre, edges[int(lengths.argmax())])
    spare = lengths[k] - kind.width - 0.1
    if spare < 0:
        return None
    at = 0.05 + spare * float(rng.choice([0.0, 1.0, rng.random()]))
    return _rectangle(edges[k, :2] + along * at + inward * 0.03, along * kind.width, inward * kind.depth)


def _in_rows(kind: Piece, near: Floats, edge: Floats) -> Polygon:
    """A piece at the place closest to a point on a lattice along the room's longest wall: rows arise."""
    along = (edge[2:] - edge[:2]) / np.hypot(*(edge[2:] - edge[:2]))
    inward = np.array([-along[1], along[0]])
    size = np.array([kind.width, kind.depth])
    pitch = size + ROW_GAP
    cell = np.floor(np.array([(near - edge[:2]) @ along, (near - edge[:2]) @ inward]) / pitch)
    u, v = cell * pitch + ROW_GAP / 2
    return _rectangle(edge[:2] + along * u + inward * v, along * kind.width, inward * kind.depth)


def _rectangle(corner: Floats, u: Floats, v: Floats) -> Polygon:
    return Polygon([corner, corner + u, corner + u + v, corner + v])
