"""Local frames of wings: where a rectangle that is drawn along a corridor lies in the world.

A wing is drawn as if its corridor ran along the x axis (local x = metres along the corridor's centre line,
local y = metres to its left). `Straight` turns and shifts that drawing; `Arc` bends it around a centre, which
makes the walls across the corridor radial and the walls along it concentric. Rooms, bands and cores are
therefore written once for both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np
import shapely
from shapely import Polygon

from layoutexplore.grids.arrays import Floats

ARC_STEP = 0.6
"""Distance between the vertices of a curved wall along the centre line, m (3 mm off a circle of 15 m)."""


class WingFrame(Protocol):
    """Maps points of a wing's drawing into the world."""

    def points(self, local: Floats) -> Floats:
        """World points float64 (n, 2) of local points float64 (n, 2), m."""
        ...

    def place(self, polygon: Polygon) -> Polygon:
        """The world polygon of a local polygon without holes."""
        ...


@dataclass(frozen=True)
class Straight:
    """A wing that starts at (x, y) and runs towards `heading` (radians, counter-clockwise from x)."""

    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0

    def points(self, local: Floats) -> Floats:
        """World points float64 (n, 2) of local points float64 (n, 2), m."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        turned: Floats = local @ np.array([[c, s], [-s, c]]) + np.array([self.x, self.y])
        return turned

    def place(self, polygon: Polygon) -> Polygon:
        """The world polygon of a local polygon without holes."""
        return Polygon(self.points(shapely.get_coordinates(polygon)))

    def ahead(self, distance: float, turn: float = 0.0) -> Straight:
        """The frame `distance` metres further along the corridor, turned by `turn` radians."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        return Straight(self.x + c * distance, self.y + s * distance, self.heading + turn)

    def aside(self, x: float, y: float, turn: float) -> Straight:
        """The frame at the local point (x, y), turned by `turn` radians."""
        (point,) = self.points(np.array([[x, y]]))
        return Straight(float(point[0]), float(point[1]), self.heading + turn)


@dataclass(frozen=True)
class Arc:
    """A wing whose corridor starts at a straight frame and bends away from it.

    Attributes:
        start: Position and heading where the bend begins.
        radius: Radius of the corridor's centre line, m.
        left: Whether it bends to the left (the centre of the circle lies at local y = +radius).
    """

    start: Straight
    radius: float
    left: bool = True

    def points(self, local: Floats) -> Floats:
        """World points float64 (n, 2) of local points float64 (n, 2), m."""
        sign = 1.0 if self.left else -1.0
        angle = local[:, 0] / self.radius
        distance = self.radius - sign * local[:, 1]
        curved = np.column_stack([distance * np.sin(angle), sign * (self.radius - distance * np.cos(angle))])
        return self.start.points(curved)

    def place(self, polygon: Polygon) -> Polygon:
        """The world polygon of a local polygon without holes, with vertices every `ARC_STEP` of the arc."""
        return Polygon(self.points(_densify(shapely.get_coordinates(polygon))))

    def after(self, length: float) -> Straight:
        """The straight frame that goes on where the bend ends after `length` metres of its centre line."""
        (point,) = self.points(np.array([[length, 0.0]]))
        turn = length / self.radius
        return Straight(float(point[0]), float(point[1]), self.start.heading + (turn if self.left else -turn))


def _densify(ring: Floats) -> Floats:
    """The closed ring with a vertex at every multiple of `ARC_STEP` in x, shared with its neighbours."""
    parts: list[Floats] = []
    for a, b in pairwise(ring):
        low, high = sorted((a[0], b[0]))
        marks = np.arange(math.floor(low / ARC_STEP) + 1, math.ceil(high / ARC_STEP)) * ARC_STEP
        marks = marks[(marks > low + 0.05) & (marks < high - 0.05)]
        if a[0] > b[0]:
            marks = marks[::-1]
        share = (marks - a[0]) / (b[0] - a[0]) if len(marks) else marks
        parts.append(np.vstack([a[None], a + share[:, None] * (b - a)]))
    return np.vstack(parts)
