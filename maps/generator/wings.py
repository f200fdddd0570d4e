"""Wings: a corridor with a band of rooms on one or both sides, and the right-angled skeletons made of them.

A skeleton is a spine with teeth: wings that stand on the spine's north or south side and whose corridors run
through its band to the spine's corridor; a bar may close the teeth into courtyards. I, L, T, Z, U, H, comb,
fishbone, ring and eight are choices of teeth. The parts of the spine's band beside such a passage have no
facade: there the cores go.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
import shapely

from layoutexplore.maps.generator.bands import Plot
from layoutexplore.maps.generator.bays import Piece
from layoutexplore.maps.generator.programme import Programme, RoomType
from layoutexplore.maps.generator.space_graph import Sketch, SketchError
from layoutexplore.maps.generator.wing_frame import Frame, Straight

COURT = 7.0
"""Least width of a courtyard or of the gap between two teeth, m."""

LONGEST_WING = 68.0
"""A wing is longer than this only when it is very wide or when its topology was asked for, m."""

FIRE_SECTION = (22.0, 34.0)
"""Length of corridor between fire doors, m."""


@dataclass(frozen=True, kw_only=True)
class Section:
    """Cross-section of a wing, m: depth of the bands right and left of the corridor (0 = none), corridor width."""

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
    """A passage through a wing's band: side (+1 left, -1 right), where, and how far the dark zone reaches (local x, m)."""

    side: int
    x: float
    corridor: float
    low: float
    high: float


@dataclass
class Wing:
    """What later steps need of a wing: its frame, length, section, corridor pieces, and the plots to fill."""

    frame: Frame
    length: float
    section: Section
    pieces: list[Piece]
    plots: list[Plot] = field(default_factory=list)

    def piece_at(self, x: float) -> int:
        """Id of the corridor piece at local x."""
        return min(self.pieces, key=lambda p: max(p[0] - x, x - p[1], 0.0))[2]


def draw_wing(
    sketch: Sketch,
    frame: Frame,
    length: float,
    section: Section,
    rng: np.random.Generator,
    *,
    ports: Sequence[Port] = (),
    before: float = 0.0,
    after: float = 0.0,
    front: tuple[bool, bool] = (True, True),
    ends: tuple[RoomType | None, RoomType | None] = (None, None),
) -> Wing:
    """Put a wing's corridor on the sketch and list its plots.

    Args:
        sketch: Where to draw.
        frame: Local x runs along the corridor, y = 0 is its centre line.
        length: Of the bands, m.
        section: Cross-section.
        rng: Where the fire doors go.
        ports: Passages of other wings through the bands.
        before: How far the corridor goes on before x = 0, m.
        after: How far the corridor goes on after x = length, m.
        front: Whether there is open ground right and left of the wing.
        ends: Rooms across the start and the end of the wing; None = the corridor runs up to the end.
    """
    lows, highs = [0.0, length], [0.0, 0.0]
    for k, kind in enumerate(ends):
        highs[k] = float(rng.uniform(*kind.width)) if kind is not None else 0.0
    x0, x1 = highs[0], lows[1] - highs[1]
    if x1 - x0 < 4.0:
        raise SketchError("a wing is too short for its end rooms")
    half = section.corridor / 2
    cuts = _fire_doors(x0 - before, x1 + after, ports, rng)
    pieces = [
        (a, b, sketch.room(frame, shapely.box(a, -half, b, half), "corridor")) for a, b in pairwise(cuts)
    ]
    for one, two in pairwise(pieces):
        sketch.link(one[2], two[2], "double")
    wing = Wing(frame, length, section, pieces)
    for side, depth, ground in ((-1, section.south, front[0]), (1, section.north, front[1])):
        if depth > 0:
            _list_plots(wing, side, depth, ground, [p for p in ports if p.side == side], x0, x1)
    for k, kind in enumerate(ends):
        if kind is not None:
            _end_rooms(sketch, wing, kind, (0.0, x0) if k == 0 else (x1, length), rng)
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
    sketch: Sketch, wing: Wing, kind: RoomType, span: tuple[float, float], rng: np.random.Generator
) -> None:
    """A room, or two unequal ones, across the end of a wing; both lie on the corridor's end."""
    section, (x0, x1) = wing.section, span
    corridor = wing.piece_at((x0 + x1) / 2)
    (point,) = wing.frame.points(np.array([[x1 if x0 == 0.0 else x0, 0.0]]))
    near = float(point[0]), float(point[1])
    if section.width < 9.0 or section.corridor < 2.4 or rng.random() < 0.35:
        room = sketch.room(wing.frame, shapely.box(x0, section.right, x1, section.left), kind.label)
        sketch.link(corridor, room, "double" if section.width > 9.0 else "door", near=near)
        return
    split = float(rng.choice([-1.0, 1.0])) * (section.corridor / 2 - 0.05)
    big = (section.right, split) if split > 0 else (split, section.left)
    small = (split, section.left) if split > 0 else (section.right, split)
    room = sketch.room(wing.frame, shapely.box(x0, big[0], x1, big[1]), kind.label)
    sketch.link(corridor, room, "door", near=near)
    other = sketch.room(wing.frame, shapely.box(x0, small[0], x1, small[1]), kind.label)
    sketch.link(room, other, "door")


@dataclass(frozen=True, kw_only=True)
class Skeleton:
    """A right-angled skeleton: spine length, teeth as (centre share or m, side, length), whether a bar closes them."""

    spine: float
    teeth: tuple[tuple[float, int, float], ...] = ()
    bar: bool = False


def teeth_of(topology: str, comb: int) -> tuple[tuple[float, ...], tuple[int, ...], bool]:
    """Where the teeth of a topology stand (0 = left end, 1 = right end), on which side, and whether a bar closes them."""
    table: dict[str, tuple[tuple[float, ...], tuple[int, ...], bool]] = {
        "I": ((), (), False),
        "L": ((0.0,), (1,), False),
        "T": ((0.5,), (1,), False),
        "Z": ((0.0, 1.0), (1, -1), False),
        "U": ((0.0, 1.0), (1, 1), False),
        "H": ((0.0, 0.0, 1.0, 1.0), (1, -1, 1, -1), False),
        "comb": (tuple(k / (comb - 1) for k in range(comb)), (1,) * comb, False),
        "fishbone": (tuple(k / (comb - 1) for k in range(comb)) * 2, (1,) * comb + (-1,) * comb, False),
        "ring": ((0.0, 1.0), (1, 1), True),
        "eight": ((0.0, 0.5, 1.0), (1, 1, 1), True),
    }
    return table[topology]


def plan_skeleton(
    topology: str, run: float, width: float, asked: bool, rng: np.random.Generator
) -> Skeleton | None:
    """A skeleton of a topology whose wings together are `run` metres long, or None where it does not fit.

    Args:
        topology: One of `config.TOPOLOGIES`.
        run: Total length of all wings, m.
        width: Of a wing, m.
        asked: Whether just this topology is wanted, so that long wings are accepted.
        rng: Proportions.
    """
    comb = max(3, min(8, round(run / ((6.0 if topology == "fishbone" else 3.4) * width))))
    places, sides, bar = teeth_of(topology, comb)
    columns, bars = len(set(places)), 2 if bar else 1
    least = max(columns * width + (columns - 1) * COURT, width + COURT) if places else 6.0
    shortest = COURT if bar else 0.5 * width
    room = run - bars * least - len(places) * shortest
    limit = max(LONGEST_WING, 4.5 * width, 2 * LONGEST_WING * asked)
    if room < 0 or (not places and run > limit):
        return None
    if not places:
        return Skeleton(spine=run)
    low = max(0.15, 1.0 - (0.85 * limit - shortest) * len(places) / max(room, 1.0))
    high = min(0.65, (max(limit, 1.35 * least) - least) * bars / max(room, 1.0))
    if low > high:
        return None
    share = float(rng.uniform(low, high))
    mix = np.ones(len(places)) if bar else rng.dirichlet(np.full(len(places), 6.0)) * len(places)
    lengths = shortest + room * (1 - share) / len(places) * mix
    flip = bool(rng.random() < 0.5)
    spots = [
        1.0 - p if flip else p + float(rng.uniform(-0.15, 0.15)) * (0.0 < p < 1.0 and columns == 1)
        for p in places
    ]
    return Skeleton(
        spine=least + room * share / bars,
        teeth=tuple(zip(spots, sides, lengths.tolist(), strict=True)),
        bar=bar,
    )


def draw_skeleton(
    sketch: Sketch, skeleton: Skeleton, section: Section, programme: Programme, rng: np.random.Generator
) -> list[Wing]:
    """Put all wings of a skeleton on the sketch, corridors joined; returns them with their plots."""
    low, high = -section.right, skeleton.spine - section.left
    outer = [
        (low + (high - low) * spot if skeleton.spine > section.width else skeleton.spine / 2)
        for spot, _, _ in skeleton.teeth
    ]
    sections = [section if skeleton.bar else vary(section, rng) for _ in outer]
    ports = [
        _port(side, x, own) for x, (_, side, _), own in zip(outer, skeleton.teeth, sections, strict=True)
    ]
    busy = {(spot < 0.02, spot > 0.98) for spot, _, _ in skeleton.teeth}
    ends = (
        None if any(b[0] for b in busy) else draw_end(programme, skeleton.spine, rng),
        None if any(b[1] for b in busy) else draw_end(programme, skeleton.spine, rng),
    )
    base = Straight()
    spine = draw_wing(
        sketch, base, skeleton.spine, section, rng, ports=ports, ends=ends, front=_fronts(skeleton)
    )
    wings = [spine]
    tops: list[tuple[float, Wing]] = []
    for x, (_, side, length), own in zip(outer, skeleton.teeth, sections, strict=True):
        frame = base.aside(x, section.left if side > 0 else section.right, side * math.pi / 2)
        lone = sum(1 for _, other, _ in skeleton.teeth if other == side) == 1
        tooth = draw_wing(
            sketch,
            frame,
            length,
            own,
            rng,
            before=section.north if side > 0 else section.south,
            after=section.south if skeleton.bar else 0.0,
            front=(lone, lone),
            ends=(None, None if skeleton.bar else draw_end(programme, length, rng)),
        )
        join(sketch, spine.piece_at(x), tooth.pieces[0][2], rng)
        wings.append(tooth)
        tops.append((x, tooth))
    if skeleton.bar:
        depth = section.left + skeleton.teeth[0][2] - section.right
        bar_ports = [_port(-1, x, section) for x in outer]
        bar = draw_wing(
            sketch,
            base.aside(0.0, depth, 0.0),
            skeleton.spine,
            section,
            rng,
            ports=bar_ports,
            front=(False, True),
        )
        for x, tooth in tops:
            join(sketch, bar.piece_at(x), tooth.pieces[-1][2], rng)
        wings.append(bar)
    return wings


def vary(section: Section, rng: np.random.Generator) -> Section:
    """The section of another wing of the same building: often the same, else with other depths or rooms on one side only."""
    choice = rng.random()
    if choice < 0.45 or min(section.south, section.north) == 0.0:
        return section
    if choice < 0.6:
        return replace(section, **{str(rng.choice(["south", "north"])): 0.0})
    south, north = (
        section.south * float(rng.uniform(0.85, 1.1)),
        section.north * float(rng.uniform(0.85, 1.1)),
    )
    return replace(section, south=round(south, 2), north=round(north, 2))


def _port(side: int, x: float, section: Section) -> Port:
    """The passage for a tooth of the same section: its left side points to -x on the north side, to +x on the south."""
    low, high = (section.left, -section.right) if side > 0 else (-section.right, section.left)
    return Port(side=side, x=x, corridor=section.corridor, low=x - low, high=x + high)


def _fronts(skeleton: Skeleton) -> tuple[bool, bool]:
    """Whether the spine has open ground on its south and north side."""
    sides = {side for _, side, _ in skeleton.teeth}
    return -1 not in sides, 1 not in sides


def join(sketch: Sketch, corridor: int, other: int, rng: np.random.Generator) -> None:
    """Two corridors meet: one space, or a fire door between them."""
    if rng.random() < 0.5:
        sketch.merge(corridor, other)
    else:
        sketch.link(corridor, other, "double")


def draw_end(programme: Programme, length: float, rng: np.random.Generator) -> RoomType | None:
    """What closes a corridor: a room across the end, or nothing (a window)."""
    if not programme.end or length < 16.0 or rng.random() < 0.4:
        return None
    weights = np.array([kind.weight for kind in programme.end])
    return programme.end[int(rng.choice(len(programme.end), p=weights / weights.sum()))]
