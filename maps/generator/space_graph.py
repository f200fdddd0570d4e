"""The space graph of a plan: spaces between wall centre lines, and which of them are to be connected.

Families put spaces (gross polygons that share their edges), solid blocks (shafts, lifts) and wishes for doors
into the graph; `layoutexplore.maps.generator.construction` turns it into walls with thickness, net room
polygons and doors. Nothing here knows about a family.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Iterable
from dataclasses import dataclass, field

import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from layoutexplore.maps.generator.wing_frame import WingFrame

TOLERANCE = 0.03
"""Edges closer than this are the same wall, m."""

ROUNDING = 1e-9
"""Vertices closer than this are one and the same but for rounding, m."""

OUTSIDE = 0


class AttemptError(Exception):
    """This attempt does not work out (wings collide, a door has no wall): the generator draws another one."""


def added(values: Iterable[float]) -> float:
    """A sum that is rounded after each value; `sum` is more exact from Python 3.12 on, and buildings differ.

    Example:
        >>> added([0.1] * 10)
        0.9999999999999999
    """
    return functools.reduce(operator.add, values, 0.0)


@dataclass(frozen=True)
class Link:
    """A wish for a connection between two spaces (ids; `OUTSIDE` for an entrance).

    Attributes:
        a: One space.
        b: The other space.
        kind: "door", "narrow" (toilets, stores), "double" (halls, fire doors) or "open" (no door, the wall is
            left out).
        near: World point that the door should be close to; None = the middle of the wall.
        optional: Whether the plan is fine without it.
    """

    a: int
    b: int
    kind: str = "door"
    near: tuple[float, float] | None = None
    optional: bool = False


@dataclass
class SpaceGraph:
    """Spaces by id (1-based), solids, details inside rooms, links. Lengths in m, all in the world."""

    polygons: dict[int, Polygon] = field(default_factory=dict)
    labels: dict[int, str] = field(default_factory=dict)
    links: list[Link] = field(default_factory=list)
    solids: list[Polygon] = field(default_factory=list)
    details: list[BaseGeometry] = field(default_factory=list)
    fixtures: list[BaseGeometry] = field(default_factory=list)
    _merged: dict[int, int] = field(default_factory=dict)
    _next: int = 1

    def room(self, frame: WingFrame, polygon: Polygon, label: str) -> int:
        """Add a space and return its id; `polygon` is local to `frame`."""
        key = self._next
        self._next += 1
        self.polygons[key] = frame.place(polygon)
        self.labels[key] = label
        return key

    def solid(self, frame: WingFrame, polygon: Polygon) -> None:
        """A closed shaft or lift: inside the outline, but no room."""
        self.solids.append(frame.place(polygon))

    def find(self, key: int) -> int:
        """The id under which a space lives after merging."""
        while key in self._merged:
            key = self._merged[key]
        return key

    def link(
        self,
        a: int,
        b: int,
        kind: str = "door",
        *,
        near: tuple[float, float] | None = None,
        optional: bool = False,
    ) -> None:
        """Wish for a connection; see `Link`."""
        self.links.append(Link(a, b, kind, near, optional))

    def extend(self, key: int, frame: WingFrame, polygon: Polygon) -> None:
        """Add a local polygon (an alcove) to a space that it touches."""
        key = self.find(key)
        self.polygons[key] = _closed_union(self.polygons[key], frame.place(polygon))

    def merge(self, a: int, b: int) -> None:
        """Make two touching spaces one, or, where that would close a ring, join them by a double door."""
        a, b = self.find(a), self.find(b)
        if a == b:
            return
        union = _closed_union(self.polygons[a], self.polygons[b])
        if union.geom_type != "Polygon" or union.interiors:
            self.link(a, b, "double")
            return
        self.polygons[a] = union
        del self.polygons[b], self.labels[b]
        self._merged[b] = a

    def resolved_links(self) -> list[Link]:
        """The links with merged ids, without doubles inside one space."""
        found = [Link(self.find(k.a), self.find(k.b), k.kind, k.near, k.optional) for k in self.links]
        return [k for k in found if k.a != k.b]

    def check_disjoint(self) -> BaseGeometry:
        """The outline (union of all); `AttemptError` where spaces overlap or a polygon is broken."""
        parts = [*self.polygons.values(), *self.solids]
        if not all(p.is_valid and p.geom_type == "Polygon" for p in parts):
            raise AttemptError("a space is not a simple polygon")
        union = shapely.union_all(parts)
        overlap = added(p.area for p in parts) - union.area
        if overlap > 0.02 * len(parts):
            raise AttemptError(f"{overlap:.1f} m2 of the spaces overlap")
        outline = _closed(union)
        if outline.geom_type != "Polygon":
            raise AttemptError("the building falls apart")
        return outline


def _closed_union(a: Polygon, b: Polygon) -> Polygon:
    """Union of two polygons that touch within the tolerance."""
    grown = shapely.union(a.buffer(TOLERANCE, join_style="mitre"), b.buffer(TOLERANCE, join_style="mitre"))
    return grown.buffer(-TOLERANCE, join_style="mitre")


def _closed(union: BaseGeometry) -> BaseGeometry:
    """Polygons without the gaps between them, and in them, that are narrower than twice the tolerance.

    Edges that touch but for rounding leave holes without width: a mitred buffer divides by zero there.
    """
    parts = [
        Polygon(part.exterior, [hole for hole in part.interiors if Polygon(hole).area > TOLERANCE**2])
        for part in shapely.get_parts(union)
    ]
    grown = shapely.MultiPolygon(parts).buffer(TOLERANCE, join_style="mitre")
    return grown.buffer(-TOLERANCE, join_style="mitre")
