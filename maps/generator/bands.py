"""Bands: filling the strips along the corridors with bays.

The skeleton leaves a list of `Plot`s, stretches of a wing with a corridor on one side. Here the special rooms
and the cores are dealt out to them, and the rest is divided into runs of equal rooms on the planning grid, as
facades are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from layoutexplore.maps.generator.bays import Bay, Piece, plain
from layoutexplore.maps.generator.programme import Programme, RoomType
from layoutexplore.maps.generator.space_graph import SpaceGraph, added
from layoutexplore.maps.generator.wing_frame import WingFrame

Slot = tuple[RoomType, float]
"""A kind of room and its width along the corridor, m."""


@dataclass
class Plot:
    """A stretch of a wing to be filled with rooms.

    Attributes:
        frame: The wing's frame.
        x0, x1: Extent along the corridor, m.
        near: Local y of the corridor's wall, m.
        far: Local y of the facade, m.
        corridors: Pieces of the corridor along the wing.
        dark: No facade of its own: for cores and stores.
        front: Whether there is open ground before the facade, so that a hall may stick out.
        wanted: Slots that must find a place here.
    """

    frame: WingFrame
    x0: float
    x1: float
    near: float
    far: float
    corridors: Sequence[Piece]
    dark: bool = False
    front: bool = False
    wanted: list[list[Slot]] = field(default_factory=list)

    @property
    def length(self) -> float:
        """Along the corridor, m."""
        return self.x1 - self.x0

    @property
    def spare(self) -> float:
        """Length that is not promised to wanted slots, m."""
        return self.length - added(width for group in self.wanted for _, width in group)


@dataclass(frozen=True, kw_only=True)
class Style:
    """What is the same all over one building: planning grid (m), width factor, door habits, facade steps."""

    module: float
    scale: float
    connecting: float
    notch: float
    """Probability that the facade of a run of rooms steps in or out."""


def _draw_style(programme: Programme, scale: float, rng: np.random.Generator) -> Style:
    """A building's habits."""
    notch = float(rng.choice([0.0, 0.0, 0.12, 0.3]))
    return Style(
        module=float(rng.uniform(*programme.module)),
        scale=scale,
        connecting=programme.connecting,
        notch=notch,
    )


def furnish_plots(
    graph: SpaceGraph,
    plots: Sequence[Plot],
    programme: Programme,
    scale: float,
    area: float,
    rng: np.random.Generator,
) -> None:
    """Fill all plots of a building of `area` m2 with rooms, `scale` times as wide as is usual."""
    style = _draw_style(programme, scale, rng)
    bright = [plot for plot in plots if not plot.dark]
    _deal_specials(bright, programme, area, rng)
    _deal_cores(plots, programme, rng)
    turn = 0
    for plot in plots:
        if plot.dark:
            turn = _fill_dark(graph, plot, programme, style, turn, rng)
        else:
            _fill_bright(graph, plot, programme, style, rng)


def _deal_specials(
    plots: Sequence[Plot], programme: Programme, area: float, rng: np.random.Generator
) -> None:
    """Promise every special room that fits the building to a plot; deep ones need open ground before it."""
    for kind in programme.special:
        width = float(rng.uniform(*kind.width))
        far = min(float(rng.uniform(*kind.depth)), area / width) if kind.depth else 6.0
        room = width * far
        limit = programme.special_share * area
        if room > limit:
            factor = np.sqrt(limit / room)
            if factor < 0.62:
                continue
            width *= float(factor)
        fitting = [
            p
            for p in plots
            if p.spare > width + 2.0 and (p.front or kind.depth is None or kind.depth[1] < 10.0)
        ]
        if not fitting or (kind is not programme.special[0] and rng.random() < 0.3):
            continue
        weights = np.array([p.spare for p in fitting])
        plot = fitting[int(rng.choice(len(fitting), p=weights / weights.sum()))]
        plot.wanted.append([(kind, width)])


def _deal_cores(plots: Sequence[Plot], programme: Programme, rng: np.random.Generator) -> None:
    """Promise cores (stair, toilets, lift, store) to facades where the dark zones hold too few."""
    length = added(p.length for p in plots if not p.dark) / 2
    dark = added(p.length for p in plots if p.dark)
    missing = max(0 if dark > 12.0 else 1, round(length / programme.core_every - dark / 12.0))
    hosts = [p for p in plots if not p.dark]
    for _ in range(missing):
        size = 4 if length > 25.0 else int(rng.integers(2, 4)) if length > 12.0 else 1
        chosen = programme.core[:size] if size > 1 else programme.core[1:2]
        group = [(kind, float(rng.uniform(*kind.width))) for kind in chosen]
        host = max(hosts, key=lambda p: p.spare, default=None)
        if host is None or host.spare < added(width for _, width in group):
            return
        host.wanted.append(group if rng.random() < 0.5 else group[::-1])


def _fill_dark(
    graph: SpaceGraph, plot: Plot, programme: Programme, style: Style, turn: int, rng: np.random.Generator
) -> int:
    """Core rooms in turn, as many as fit; returns whose turn it is in the building's next dark zone."""
    slots: list[Slot] = []
    left, misses = plot.length, 0
    while misses < len(programme.core):
        kind = programme.core[turn % len(programme.core)]
        turn += 1
        width = min(float(rng.uniform(*kind.width)), left)
        if width < kind.width[0] - 0.4:
            misses += 1
            continue
        slots.append((kind, width))
        left, misses = left - width, 0
    _place(graph, plot, _stretched(slots, plot.length), style, rng)
    return turn


def _fill_bright(
    graph: SpaceGraph, plot: Plot, programme: Programme, style: Style, rng: np.random.Generator
) -> None:
    """Runs of facade rooms between the wanted groups."""
    groups = [plot.wanted[int(k)] for k in rng.permutation(len(plot.wanted))]
    shares = rng.dirichlet(np.full(len(groups) + 1, 2.0)) * max(plot.spare, 0.0)
    slots: list[Slot] = []
    owed = 0.0
    for k, share in enumerate(shares):
        run = divide(float(share) + owed, programme.facade, style, rng)
        owed += float(share) - added(width for _, width in run)
        slots += run + (groups[k] if k < len(groups) else [])
    _place(graph, plot, _stretched(slots, plot.length), style, rng)


def divide(length: float, kinds: Sequence[RoomType], style: Style, rng: np.random.Generator) -> list[Slot]:
    """Runs of rooms on the planning grid that together are at most `length` metres long."""
    slots: list[Slot] = []
    weights = np.array([kind.weight for kind in kinds])
    smallest = min(kind.width[0] for kind in kinds) * style.scale
    left, misses = length, 0
    while left >= smallest and misses < 12:
        kind = kinds[int(rng.choice(len(kinds), p=weights / weights.sum()))]
        width = _on_grid(float(rng.uniform(*kind.width)) * style.scale, style.module)
        count = min(int(rng.integers(kind.run[0], kind.run[1] + 1)), int(left // width))
        misses += count == 0
        slots += [(kind, width)] * count
        left -= width * count
    return slots


def _on_grid(width: float, module: float) -> float:
    """The nearest multiple of half the planning grid."""
    return max(round(2 * width / module), 3) * module / 2


def _stretched(slots: list[Slot], length: float) -> list[Slot]:
    """The slots widened (or narrowed a little) so that they fill the length exactly."""
    total = added(width for _, width in slots)
    return [(kind, width * length / total) for kind, width in slots]


def _place(graph: SpaceGraph, plot: Plot, slots: list[Slot], style: Style, rng: np.random.Generator) -> None:
    """Draw the slots one after the other; neighbours of a run mirror each other, some are connected."""
    if not slots:
        bay = Bay(plot.frame, plot.x0, plot.x1, plot.near, plot.far, plot.corridors)
        if bay.width > 1.6:
            plain(graph, bay, "storage", rng)
        elif bay.width > 0.05:
            graph.solid(plot.frame, bay.box(0.0, bay.width, 0.0, bay.depth))
        return
    x, step, flip = plot.x0, 0.0, bool(rng.random() < 0.5)
    previous: tuple[RoomType, int] | None = None
    for k, (kind, width) in enumerate(slots):
        if previous is None or previous[0] is not kind:
            run = added(w for other, w in slots[k : k + 3] if other is kind)
            step = _facade_step(plot, style, rng) if run > 5.5 else 0.0
        far = _far(plot, kind, width, step, rng)
        flip = not flip if rng.random() < 0.65 else flip
        bay = Bay(plot.frame, x, x + width, plot.near, far, plot.corridors, flip)
        room = kind.build(graph, bay, kind.label, rng)
        if previous and previous[0] is kind and rng.random() < style.connecting:
            at = x, plot.near + (far - plot.near) * 0.75
            (point,) = plot.frame.points(np.array([at]))
            graph.link(previous[1], room, near=(float(point[0]), float(point[1])), optional=True)
        previous = kind, room
        x += width


def _facade_step(plot: Plot, style: Style, rng: np.random.Generator) -> float:
    """How far the facade of the next run lies before (+) or behind (-) the wing's, m."""
    if plot.dark or not plot.front or rng.random() >= style.notch:
        return 0.0
    return float(rng.choice([-1.2, -0.9, -0.6, 0.6, 1.2, 1.8]))


def _far(plot: Plot, kind: RoomType, width: float, step: float, rng: np.random.Generator) -> float:
    """Local y of the outer wall of a room of this kind."""
    sign = 1.0 if plot.far > plot.near else -1.0
    depth = abs(plot.far - plot.near)
    if kind.depth is None or plot.dark:
        return plot.near + sign * (depth + (step if depth + step > 3.4 else 0.0))
    own = float(rng.uniform(*kind.depth)) * min(1.0, width / kind.width[0])
    return plot.near + sign * (max(own, depth) if plot.front else depth)
