"""Bays: the slots along a corridor, and how each kind of room is drawn into one.

A `Bay` is a rectangle of a wing with the corridor on one side: `u` runs along the corridor, `v` from the
corridor wall to the facade. Every function here takes a bay and puts its room, or its little group of rooms,
in the space graph: a plain room, a room behind an alcove, a hotel room with its bathroom, toilets with
cabins, a stair, a pair of rooms one behind the other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely import Polygon

from layoutexplore.maps.generator.space_graph import OUTSIDE, SpaceGraph
from layoutexplore.maps.generator.wing_frame import WingFrame

CHASES = 0.2
"""Share of the plain rooms with a pipe chase in a corner."""

Piece = tuple[float, float, int]
"""A stretch of corridor: from x to x (m, local to its frame) and the id of its space."""


@dataclass(frozen=True)
class Bay:
    """A slot of a band of rooms.

    Attributes:
        frame: The wing's frame.
        x0, x1: Extent along the corridor, m.
        near: Local y of the corridor's wall, m.
        far: Local y of the facade, m.
        corridors: The pieces of the corridor that run along the wing.
        flip: Whether the door is at the x1 end instead of the x0 end (neighbours mirror each other).
    """

    frame: WingFrame
    x0: float
    x1: float
    near: float
    far: float
    corridors: Sequence[Piece]
    flip: bool = False

    @property
    def width(self) -> float:
        """Along the corridor, m."""
        return self.x1 - self.x0

    @property
    def depth(self) -> float:
        """From the corridor to the facade, m."""
        return abs(self.far - self.near)

    def x(self, u: float) -> float:
        """Local x of u, which counts from the end where the door is."""
        return self.x1 - u if self.flip else self.x0 + u

    def y(self, v: float) -> float:
        """Local y of v, which counts from the corridor's wall (negative: into the corridor)."""
        return self.near + v if self.far > self.near else self.near - v

    def shape(self, points: Sequence[tuple[float, float]]) -> Polygon:
        """The local polygon through the points (u, v)."""
        return Polygon([(self.x(u), self.y(v)) for u, v in points])

    def box(self, u0: float, u1: float, v0: float, v1: float) -> Polygon:
        """The local rectangle from (u0, v0) to (u1, v1)."""
        return self.shape([(u0, v0), (u1, v0), (u1, v1), (u0, v1)])

    def notched(self, wide: float, deep: float) -> Polygon:
        """The bay without a rectangle in its corner on the corridor that is farther from the door."""
        w, d = self.width, self.depth
        return self.shape([(0.0, 0.0), (w - wide, 0.0), (w - wide, deep), (w, deep), (w, d), (0.0, d)])

    def world(self, u: float, v: float) -> tuple[float, float]:
        """The world point of (u, v)."""
        (point,) = self.frame.points(np.array([[self.x(u), self.y(v)]]))
        return float(point[0]), float(point[1])

    def corridor(self, u0: float = 0.0, u1: float | None = None) -> int:
        """Id of the piece of corridor that has most of the wall between u0 and u1."""
        a, b = sorted((self.x(u0), self.x(self.width if u1 is None else u1)))
        return max(self.corridors, key=lambda piece: min(b, piece[1]) - max(a, piece[0]))[2]


Builder = Callable[[SpaceGraph, Bay, str, np.random.Generator], int]
"""Draws rooms of a label into a bay and returns the id of the one that lies on the corridor."""


def plain(graph: SpaceGraph, bay: Bay, label: str, rng: np.random.Generator) -> int:
    """One room; a long one has a second door at its other end; some have a pipe chase in a corner."""
    w, d = bay.width, bay.depth
    outline = bay.box(0.0, w, 0.0, d)
    if w > 2.3 and rng.random() < CHASES:
        wide, deep = float(rng.uniform(0.45, 0.9)), float(rng.uniform(0.35, 0.75))
        outline = bay.notched(wide, deep)
        graph.solid(bay.frame, bay.box(w - wide, w, 0.0, deep))
    room = graph.room(bay.frame, outline, label)
    graph.link(bay.corridor(0.0, min(bay.width, 3.0)), room, near=bay.world(0.0, 0.0))
    if bay.width > 9.0:
        other = bay.corridor(bay.width - 3.0, bay.width)
        graph.link(other, room, near=bay.world(bay.width, 0.0), optional=True)
    return room


def big(graph: SpaceGraph, bay: Bay, label: str, rng: np.random.Generator) -> int:
    """A hall with a double door, and a second one where it is long."""
    room = graph.room(bay.frame, bay.box(0.0, bay.width, 0.0, bay.depth), label)
    share = float(rng.uniform(0.15, 0.3))
    graph.link(bay.corridor(0.0, bay.width / 2), room, "double", near=bay.world(share * bay.width, 0.0))
    if bay.width > 7.0:
        other = bay.corridor(bay.width / 2, bay.width)
        graph.link(other, room, "double", near=bay.world((1 - share) * bay.width, 0.0), optional=True)
    if bay.width * bay.depth > 90.0 and label not in ("gym", "aula", "lecture hall"):
        posts = columns(bay.box(0.0, bay.width, 0.0, bay.depth), float(rng.uniform(5.0, 7.5)), 0.4, 1.5)
        graph.details += [bay.frame.place(post) for post in posts]
    return room


def lounge(graph: SpaceGraph, bay: Bay, label: str, rng: np.random.Generator) -> int:
    """A room that is open to the corridor over its whole width."""
    room = graph.room(bay.frame, bay.box(0.0, bay.width, 0.0, bay.depth), label)
    graph.link(bay.corridor(), room, "open")
    return room


def foyer(graph: SpaceGraph, bay: Bay, label: str, rng: np.random.Generator) -> int:
    """A lobby open to the corridor, with the entrance in its outer wall, often behind a wind porch."""
    wind = 2.2 if bay.width > 5.0 and bay.depth > 4.0 and rng.random() < 0.6 else 0.0
    room = lounge(graph, replace(bay, far=bay.y(bay.depth - wind)), label, rng)
    door = bay.world(bay.width / 2, bay.depth)
    if not wind:
        graph.link(OUTSIDE, room, "double", near=door)
        return room
    half = (bay.width - float(rng.uniform(2.4, 3.0))) / 2
    porch = graph.room(bay.frame, bay.box(half, bay.width - half, bay.depth - wind, bay.depth), "entrance")
    graph.link(room, porch, "double")
    graph.link(OUTSIDE, porch, "double", near=door)
    return room


def alcove(graph: SpaceGraph, bay: Bay, label: str, rng: np.random.Generator) -> int:
    """A room whose door lies at the back of an alcove of the corridor."""
    niche, back = float(rng.uniform(1.5, 2.0)), float(rng.uniform(0.9, 1.3))
    if bay.width < niche + 2.5:
        return plain(graph, bay, label, rng)
    w, d = bay.width, bay.depth
    room = graph.room(
        bay.frame, bay.shape([(niche, 0), (w, 0), (w, d), (0, d), (0, back), (niche, back)]), label
    )
    corridor = bay.corridor(0.0, niche)
    graph.extend(corridor, bay.frame, bay.box(0.0, niche, 0.0, back))
    graph.link(corridor, room, near=bay.world(niche / 2, back))
    return room


def with_bathroom(graph: SpaceGraph, bay: Bay, label: str, rng: np.random.Generator) -> int:
    """A ward or hotel room: entry passage beside a bathroom, the room behind."""
    w, d = bay.width, bay.depth
    entry, deep = 1.45, min(2.3, d - 2.6)
    if w < 3.2 or deep < 1.6:
        return plain(graph, bay, label, rng)
    wide = min(w - entry, 2.6)
    bath = graph.room(bay.frame, bay.box(w - wide, w, 0.0, deep), "bathroom")
    room = graph.room(bay.frame, bay.notched(wide, deep), label)
    graph.link(bay.corridor(0.0, w - wide), room)
    graph.link(
        room, bath, "narrow", near=bay.world(w - wide, deep / 2) if rng.random() < 0.7 else bay.world(w, deep)
    )
    return room


def toilets(graph: SpaceGraph, bay: Bay, label: str, rng: np.random.Generator) -> int:
    """An anteroom with wash basins on the corridor, cabins behind it."""
    w, d = bay.width, bay.depth
    cabins = min(int((w + 0.2) // 1.3), 3)
    deep = min(max(0.36 * d, 1.6), 2.2)
    if cabins < 1 or d < 3.0:
        return plain(graph, bay, label, rng)
    front = graph.room(bay.frame, bay.box(0.0, w, 0.0, d - deep), label)
    graph.link(bay.corridor(), front, near=bay.world(0.0, 0.0))
    for k in range(cabins):
        cabin = graph.room(bay.frame, bay.box(w * k / cabins, w * (k + 1) / cabins, d - deep, d), label)
        graph.link(front, cabin, "narrow")
    return front


def stairs(graph: SpaceGraph, bay: Bay, label: str, rng: np.random.Generator) -> int:
    """A stair with two flights and the wall between them."""
    room = graph.room(bay.frame, bay.box(0.0, bay.width, 0.0, bay.depth), label)
    graph.link(bay.corridor(), room, "door", near=bay.world(0.0, 0.0))
    if bay.width > 2.6 and bay.depth > 4.2:
        middle = bay.width / 2
        string = bay.box(middle - 0.1, middle + 0.1, 1.7, bay.depth - 1.5)
        graph.details.append(bay.frame.place(string))
    return room


def enfilade(graph: SpaceGraph, bay: Bay, label: str, rng: np.random.Generator) -> int:
    """Two rooms one behind the other; the back one is reached through the front one."""
    split = bay.depth * float(rng.uniform(0.42, 0.58))
    if min(split, bay.depth - split) < 2.2:
        return plain(graph, bay, label, rng)
    front = graph.room(bay.frame, bay.box(0.0, bay.width, 0.0, split), label)
    back = graph.room(bay.frame, bay.box(0.0, bay.width, split, bay.depth), label)
    graph.link(bay.corridor(0.0, min(bay.width, 3.0)), front, near=bay.world(0.0, 0.0))
    graph.link(front, back, near=bay.world(0.0 if rng.random() < 0.5 else bay.width, split))
    return front


def beside(graph: SpaceGraph, bay: Bay, label: str, rng: np.random.Generator) -> int:
    """A large room with a store cut out of its corridor side."""
    w, d = bay.width, bay.depth
    side, deep = float(rng.uniform(1.8, 2.8)), float(rng.uniform(2.0, 3.2))
    if w - side < 3.0 or d - deep < 2.0:
        return plain(graph, bay, label, rng)
    room = graph.room(bay.frame, bay.notched(side, deep), label)
    store = graph.room(bay.frame, bay.box(w - side, w, 0.0, deep), "storage")
    graph.link(bay.corridor(0.0, min(w - side, 3.0)), room, near=bay.world(0.0, 0.0))
    if rng.random() < 0.5:
        graph.link(room, store, "narrow", near=bay.world(w, deep))
    else:
        graph.link(bay.corridor(w - side, w), store, "narrow", near=bay.world(w, 0.0))
    return room


def shaft(graph: SpaceGraph, bay: Bay, label: str, rng: np.random.Generator) -> int:
    """A closed lift on the corridor with a store around it; just a store where there is no room for both."""
    w, d = bay.width, bay.depth
    deep, lift = float(rng.uniform(1.8, 2.4)), min(w - 1.4, 2.2)
    if lift < 1.5 or d - deep < 1.3:
        return plain(graph, bay, label, rng)
    graph.solid(bay.frame, bay.box(w - lift, w, 0.0, deep))
    room = graph.room(bay.frame, bay.notched(lift, deep), label)
    graph.link(bay.corridor(0.0, w - lift), room, "narrow", near=bay.world(0.0, 0.0))
    return room


def columns(area: Polygon, spacing: float, size: float, inset: float) -> list[Polygon]:
    """Square columns on a grid inside a local polygon, away from its edges by `inset` (all m)."""
    x0, y0, x1, y1 = area.bounds
    nx, ny = max(1, round((x1 - x0) / spacing)), max(1, round((y1 - y0) / spacing))
    inner = area.buffer(-inset)
    xs, ys = np.linspace(x0, x1, nx + 1), np.linspace(y0, y1, ny + 1)
    centres = [(float(x), float(y)) for x in xs for y in ys if inner.intersects(shapely.Point(x, y))]
    return [shapely.box(x - size / 2, y - size / 2, x + size / 2, y + size / 2) for x, y in centres]
