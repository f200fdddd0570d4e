"""Wings: a corridor with a band of rooms on one or both sides, cut into the plots that rooms will fill."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import shapely

from layoutexplore.maps.generator.bands import Plot
from layoutexplore.maps.generator.bays import Piece
from layoutexplore.maps.generator.programme import Programme, RoomType
from layoutexplore.maps.generator.space_graph import AttemptError, SpaceGraph
from layoutexplore.maps.generator.wing_frame import WingFrame

FIRE_SECTION = (22.0, 34.0)
"""Length of corridor between fire doors, m."""


@dataclass(frozen=True, kw_only=True)
class Section:
    """Cross-section of a wing, m: depths of the bands beside the corridor (0 = none) and its width."""

    south: float
    corridor: float
    north: float

    @property
    def width(self) -> float:
        """Of the whole wing, m."""
        return self.south + self.corridor + self.north

    @property
    def right(self) -> float:
        """Local y of the right facade, m."""
        return -self.corridor / 2 - self.south

    @property
    def left(self) -> float:
        """Local y of the left facade, m."""
        return self.corridor / 2 + self.north


@dataclass(frozen=True, kw_only=True)
class Port:
    """A passage through a wing's band: side (+1 left, -1 right), its middle and dark zone (local x, m)."""

    side: int
    x: float
    corridor: float
    low: float
    high: float


@dataclass
class Wing:
    """What later steps need of a wing: its frame, length, section, corridor pieces, and the plots to fill."""

    frame: WingFrame
    length: float
    section: Section
    pieces: list[Piece]
    plots: list[Plot] = field(default_factory=list)

    def piece_at(self, x: float) -> int:
        """Id of the corridor piece at local x."""
        return min(self.pieces, key=lambda p: max(p[0] - x, x - p[1], 0.0))[2]


@dataclass(frozen=True, kw_only=True)
class WingOptions:
    """What a wing meets at its sides and ends.

    Attributes:
        ports: Passages of other wings through the bands.
        before: How far the corridor goes on before x = 0, m.
        after: How far the corridor goes on after x = length, m.
        front: Whether there is open ground right and left of the wing.
        ends: Rooms across the start and the end of the wing; None = the corridor runs up to the end.
    """

    ports: Sequence[Port] = ()
    before: float = 0.0
    after: float = 0.0
    front: tuple[bool, bool] = (True, True)
    ends: tuple[RoomType | None, RoomType | None] = (None, None)


def draw_wing(
    graph: SpaceGraph,
    frame: WingFrame,
    length: float,
    section: Section,
    rng: np.random.Generator,
    options: WingOptions,
) -> Wing:
    """Put a wing's corridor into the space graph and list its plots.

    Args:
        graph: Where to draw.
        frame: Local x runs along the corridor, y = 0 is its centre line.
        length: Of the bands, m.
        section: Cross-section.
        rng: Where the fire doors go.
        options: What it meets at its sides and ends.
    """
    ports = options.ports
    depths = [float(rng.uniform(*kind.width)) if kind is not None else 0.0 for kind in options.ends]
    x0, x1 = depths[0], length - depths[1]
    if x1 - x0 < 4.0:
        raise AttemptError("a wing is too short for its end rooms")
    half = section.corridor / 2
    cuts = _fire_doors(x0 - options.before, x1 + options.after, ports, rng)
    pieces = [
        (a, b, graph.room(frame, shapely.box(a, -half, b, half), "corridor")) for a, b in pairwise(cuts)
    ]
    for one, two in pairwise(pieces):
        graph.link(one[2], two[2], "double")
    wing = Wing(frame, length, section, pieces)
    for side, depth, ground in ((-1, section.south, options.front[0]), (1, section.north, options.front[1])):
        if depth > 0:
            _list_plots(wing, side, depth, ground, [p for p in ports if p.side == side], x0, x1)
    for kind, span in zip(options.ends, ((0.0, x0), (x1, length)), strict=True):
        if kind is not None:
            _end_rooms(graph, wing, kind, span, rng)
    return wing


def _fire_doors(x0: float, x1: float, ports: Sequence[Port], rng: np.random.Generator) -> list[float]:
    """Ends of the corridor's pieces; no cut falls before a passage."""
    count = max(1, round((x1 - x0) / float(rng.uniform(*FIRE_SECTION))))
    cuts = [x0]
    for k in range(1, count):
        x = x0 + (x1 - x0) * k / count
        for port in ports:
            if abs(x - port.x) < port.corridor / 2 + 0.6:
                x = port.x + port.corridor / 2 + 0.6
        if x - cuts[-1] > 6.0 and x1 - x > 6.0:
            cuts.append(x)
    return [*cuts, x1]


def _list_plots(
    wing: Wing, side: int, depth: float, ground: bool, ports: Sequence[Port], x0: float, x1: float
) -> None:
    """Cut one band into bright plots and, beside the passages, dark ones."""
    near = side * wing.section.corridor / 2
    far = near + side * depth
    x = x0
    for port in sorted(ports, key=lambda p: p.x):
        gap = (port.x - port.corridor / 2, port.x + port.corridor / 2)
        low, high = max(port.low, x), min(port.high, x1)
        if low - x < 2.6:
            low = x
        if x1 - high < 2.6:
            high = x1
        spans = ((x, low, False), (low, gap[0], True), (gap[1], high, True))
        wing.plots += [
            Plot(wing.frame, a, b, near, far, wing.pieces, dark) for a, b, dark in spans if b - a > 0.01
        ]
        x = high
    if x1 - x > 0.01:
        wing.plots.append(Plot(wing.frame, x, x1, near, far, wing.pieces))
    for plot in wing.plots:
        if not plot.dark and plot.near == near:
            plot.front = ground and not ports


def _end_rooms(
    graph: SpaceGraph, wing: Wing, kind: RoomType, span: tuple[float, float], rng: np.random.Generator
) -> None:
    """A room, or two unequal ones, across the end of a wing; both lie on the corridor's end."""
    section, (x0, x1) = wing.section, span
    corridor = wing.piece_at((x0 + x1) / 2)
    (point,) = wing.frame.points(np.array([[x1 if x0 == 0.0 else x0, 0.0]]))
    near = float(point[0]), float(point[1])
    if section.width < 9.0 or section.corridor < 2.4 or rng.random() < 0.35:
        room = graph.room(wing.frame, shapely.box(x0, section.right, x1, section.left), kind.label)
        graph.link(corridor, room, "double" if section.width > 9.0 else "door", near=near)
        return
    split = float(rng.choice([-1.0, 1.0])) * (section.corridor / 2 - 0.05)
    big = (section.right, split) if split > 0 else (split, section.left)
    small = (split, section.left) if split > 0 else (section.right, split)
    room = graph.room(wing.frame, shapely.box(x0, big[0], x1, big[1]), kind.label)
    graph.link(corridor, room, "door", near=near)
    other = graph.room(wing.frame, shapely.box(x0, small[0], x1, small[1]), kind.label)
    graph.link(room, other, "door")


def join_corridors(graph: SpaceGraph, corridor: int, other: int, rng: np.random.Generator) -> None:
    """Two corridors meet: one space, or a fire door between them."""
    if rng.random() < 0.5:
        graph.merge(corridor, other)
    else:
        graph.link(corridor, other, "double")


def draw_end(programme: Programme, length: float, rng: np.random.Generator) -> RoomType | None:
    """What closes a corridor: a room across the end, or nothing (a window)."""
    if not programme.end or length < 16.0 or rng.random() < 0.4:
        return None
    weights = np.array([kind.weight for kind in programme.end])
    return programme.end[int(rng.choice(len(programme.end), p=weights / weights.sum()))]
