"""Floor plans whose walls run in many directions: rooms along a corridor around a court of many sides.

A building has three to nine sides. Every side has its own direction, and walls across it another one, so that
one of five sides has walls in ten directions. Rings may be open and irregular, with rooms on one side of the
corridor or on both, with rooms around their corners, and with a hall instead of the court. They are made to
train on, and of no family of the generator, from whose families explorations are drawn.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from layoutexplore.errors import ConfigError
from layoutexplore.grids.arrays import Floats
from layoutexplore.maps.floorplan import Door, FloorPlan, Room
from layoutexplore.maps.generator.construction import openings, rounded

ATTEMPTS = 40
TOUCHING = 1e-6
"""Edges of two spaces closer than this are the same wall [m]."""

LEAST_SIDE = 2.5
"""No side of any ring of walls is shorter [m]."""


@dataclass(frozen=True, kw_only=True)
class _Section:
    """Lengths of a building [m]: depths of its bands of rooms, and what is in them."""

    outer: float
    corridor: float
    inner: float
    room: float
    wall: float
    facade: float
    door: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> _Section:
        return cls(
            outer=float(rng.uniform(3.0, 7.0)),
            corridor=float(rng.uniform(1.5, 3.2)),
            inner=float(rng.uniform(3.0, 6.0)) if rng.random() < 0.55 else 0.0,
            room=float(rng.uniform(2.8, 6.5)),
            wall=float(rng.uniform(0.1, 0.25)),
            facade=float(rng.uniform(0.2, 0.4)),
            door=float(rng.uniform(0.8, 1.2)),
        )


def polygonal_floor(seed: int) -> FloorPlan:
    """A floor plan; the same seed always gives the same plan.

    Raises:
        ConfigError: None could be drawn.
    """
    for attempt in range(ATTEMPTS):
        plan = _attempt(f"polygonal-{seed}", np.random.default_rng([seed, attempt]))
        if plan is not None:
            return plan
    raise ConfigError(f"no polygonal building could be drawn from seed {seed}: take another seed")


def _attempt(name: str, rng: np.random.Generator) -> FloorPlan | None:
    section = _Section.draw(rng)
    rings = _rings(section, rng)
    if rings is None:
        return None
    sides = len(rings[0])
    kept = range(sides if rng.random() < 0.75 else int(rng.integers(2, max(sides, 3))))
    bands = [(rings[0], rings[1]), *([(rings[2], rings[3])] if section.inner else [])]
    spaces = [
        space
        for band in bands
        for space in _around_corners([_cells(band, k, section.room, rng) for k in kept], sides, rng)
    ]
    corridor = shapely.union_all([_side(rings[1], rings[2], k) for k in kept])
    whole = shapely.union_all([*spaces, corridor])
    if len(kept) == sides and not section.inner and rng.random() < 0.4:
        spaces.append(Polygon(rings[2]))
        whole = Polygon(whole.exterior)
    return _built(name, spaces, corridor, whole, section, rng)


def _rings(section: _Section, rng: np.random.Generator) -> list[Floats] | None:
    """The corners (sides, 2) of the outer walls and of those further in; None where they do not fit."""
    sides = int(rng.integers(3, 10))
    turn = 2 * math.pi / sides
    angles = np.arange(sides) * turn + float(rng.uniform(0, 2 * math.pi))
    if rng.random() < 0.5:
        angles = angles + rng.uniform(-0.2, 0.2, sides) * turn
    depth = section.outer + section.corridor + section.inner
    radius = max(float(rng.uniform(4.0, 13.0)) / math.sin(turn / 2), (depth + 3.0) / math.cos(turn / 2))
    corners = min(radius, 32.0) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    rings = [_inside(corners, d) for d in (0.0, section.outer, section.outer + section.corridor, depth)]
    along = _steps(corners)
    along /= np.hypot(*along.T)[:, None]
    fits = all(((_steps(ring) * along).sum(axis=1) > LEAST_SIDE).all() for ring in rings)
    return rings if fits else None


def _steps(corners: Floats) -> Floats:
    """Each side of a ring (sides, 2), from its corner to the next one."""
    return np.asarray(np.roll(corners, -1, axis=0) - corners)


def _inside(corners: Floats, distance: float) -> Floats:
    """The corners of a convex ring whose sides lie so far inside (counter-clockwise)."""
    steps = _steps(corners)
    normals = np.stack([-steps[:, 1], steps[:, 0]], axis=1) / np.hypot(*steps.T)[:, None]
    offsets = (normals * corners).sum(axis=1) + distance
    # each corner lies on its own side and on the one before
    pairs = np.stack([np.roll(normals, 1, axis=0), normals], axis=1)
    values = np.stack([np.roll(offsets, 1), offsets], axis=1)
    return np.asarray(np.linalg.solve(pairs, values[..., None])[..., 0])


def _side(outer: Floats, inner: Floats, k: int) -> Polygon:
    """What lies between side k of a ring and that of one further in."""
    after = (k + 1) % len(outer)
    return Polygon([outer[k], outer[after], inner[after], inner[k]])


def _cells(band: tuple[Floats, Floats], k: int, width: float, rng: np.random.Generator) -> list[Polygon]:
    """The rooms of one side of a band, of about a width, with walls across it."""
    whole = _side(*band, k)
    begin, end = band[0][k], band[0][(k + 1) % len(band[0])]
    along = (end - begin) / np.hypot(*(end - begin))
    inward = np.array([-along[1], along[0]])
    ends = [float((corner - begin) @ along) for corner in (end, band[1][k], band[1][(k + 1) % len(band[1])])]
    low, high = max(ends[1], 0.0), min(ends[2], ends[0])
    count = max(round((high - low) / width), 1)
    marks = np.linspace(low, high, count + 1)[1:-1]
    marks = marks + rng.uniform(-0.25, 0.25, len(marks)) * (high - low) / count
    bounds = [low - 50.0, *marks.tolist(), high + 50.0]
    strips = [
        Polygon([begin + along * x + inward * y for x, y in ((a, -50.0), (b, -50.0), (b, 50.0), (a, 50.0))])
        for a, b in pairwise(bounds)
    ]
    return [whole.intersection(strip) for strip in strips]


def _around_corners(sides: list[list[Polygon]], count: int, rng: np.random.Generator) -> list[Polygon]:
    """All rooms of a band; at some corners the last of a side and the first of the next one are one."""
    closed = len(sides) == count
    for k in range(len(sides) if closed else len(sides) - 1):
        after = sides[(k + 1) % len(sides)]
        if rng.random() < 0.3 and len(sides[k]) > 1 and len(after) > 1:
            after[0] = shapely.union(sides[k].pop(), after[0])
    return [space for side in sides for space in side]


def _built(
    name: str,
    spaces: list[Polygon],
    corridor: Polygon,
    whole: BaseGeometry,
    section: _Section,
    rng: np.random.Generator,
) -> FloorPlan | None:
    """The plan of some spaces with doors to the corridor; None where one is no room or has no door."""
    floors = [space.buffer(-section.wall / 2, join_style="mitre") for space in (*spaces, corridor)]
    if not all(floor.geom_type == "Polygon" and floor.area > 3.0 for floor in floors):
        return None
    labels = ["room"] * len(spaces) + ["corridor"]
    rooms = [
        Room(id=k + 1, polygon=floor, label=label)
        for k, (floor, label) in enumerate(zip(floors, labels, strict=True))
    ]
    doors = []
    for k, space in enumerate(spaces):
        ends = _opening(space, corridor, section, rng)
        if ends is None:
            return None
        doors.append(Door(start=ends[0], end=ends[1], rooms=(k + 1, len(rooms))))
    outer = whole.buffer(section.facade - section.wall / 2, join_style="mitre")
    walls = outer.difference(shapely.union_all(floors)).difference(openings(doors, rooms))
    return FloorPlan(name=name, rooms=tuple(rooms), doors=tuple(doors), walls=rounded(walls))


def _opening(
    space: Polygon, corridor: Polygon, section: _Section, rng: np.random.Generator
) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """The ends of a door in the longest wall between a space and the corridor; None where it is too short."""
    common = space.boundary.intersection(corridor.boundary.buffer(TOUCHING))
    edges = [
        LineString(pair)
        for line in getattr(common, "geoms", [common])
        if line.geom_type == "LineString"
        for pair in pairwise(line.coords)
    ]
    edge = max(edges, key=lambda line: line.length, default=LineString())
    width = section.door if rng.random() < 0.85 else float(rng.uniform(1.2, 2.0))
    spare = edge.length - width - 2 * section.wall
    if spare < 0.1:
        return None
    at = section.wall + spare * float(rng.choice([0.05, 0.95, rng.random()]))
    (x0, y0), (x1, y1) = (edge.interpolate(x).coords[0] for x in (at, at + width))
    return (x0, y0), (x1, y1)
