"""Right-angled skeletons: the corridors of a building as wings on a spine.

A skeleton is a spine with teeth: wings that stand on the spine's north or south side and whose corridors run
through its band to the spine's corridor; a bar may close the teeth into courtyards. I, L, T, Z, U, H, comb,
fishbone, ring and eight are choices of teeth. The parts of the spine's band beside such a passage have no
facade: there the cores go.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from layoutexplore.maps.generator.programme import Programme
from layoutexplore.maps.generator.space_graph import SpaceGraph
from layoutexplore.maps.generator.wing_frame import Straight
from layoutexplore.maps.generator.wings import (
    Port,
    Section,
    Wing,
    WingOptions,
    draw_end,
    draw_wing,
    join_corridors,
)

COURT = 7.0
"""Least width of a courtyard or of the gap between two teeth, m."""

LONGEST_WING = 68.0
"""A wing is longer than this only when it is very wide or when its topology was asked for, m."""


@dataclass(frozen=True, kw_only=True)
class Skeleton:
    """Spine length (m), teeth as (share of the spine, side, length in m), and whether a bar closes them."""

    spine: float
    teeth: tuple[tuple[float, int, float], ...] = ()
    bar: bool = False


def teeth_of(topology: str, comb: int) -> tuple[tuple[float, ...], tuple[int, ...], bool]:
    """Where teeth stand (0 = left end, 1 = right), on which side, and whether a bar closes them."""
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
    graph: SpaceGraph, skeleton: Skeleton, section: Section, programme: Programme, rng: np.random.Generator
) -> list[Wing]:
    """Put all wings of a skeleton into the space graph, corridors joined; returns them."""
    places = _places(skeleton, section)
    sections = [section if skeleton.bar else vary(section, rng) for _ in places]
    ports = [
        _port(side, x, own) for x, (_, side, _), own in zip(places, skeleton.teeth, sections, strict=True)
    ]
    taken = [
        any(spot < 0.02 for spot, _, _ in skeleton.teeth),
        any(spot > 0.98 for spot, _, _ in skeleton.teeth),
    ]
    west, east = (None if busy else draw_end(programme, skeleton.spine, rng) for busy in taken)
    options = WingOptions(ports=ports, ends=(west, east), front=_fronts(skeleton))
    spine = draw_wing(graph, Straight(), skeleton.spine, section, rng, options)
    teeth = []
    for k, (x, own) in enumerate(zip(places, sections, strict=True)):
        teeth.append(_draw_tooth(graph, skeleton, k, x, section, own, programme, rng))
        join_corridors(graph, spine.piece_at(x), teeth[-1].pieces[0][2], rng)
    bar = [_draw_bar(graph, skeleton, section, places, teeth, rng)] if skeleton.bar else []
    return [spine, *teeth, *bar]


def _places(skeleton: Skeleton, section: Section) -> list[float]:
    """Local x on the spine of every tooth's corridor."""
    low, high = -section.right, skeleton.spine - section.left
    if skeleton.spine <= section.width:
        return [skeleton.spine / 2 for _ in skeleton.teeth]
    return [low + (high - low) * spot for spot, _, _ in skeleton.teeth]


def _draw_tooth(
    graph: SpaceGraph,
    skeleton: Skeleton,
    k: int,
    x: float,
    section: Section,
    own: Section,
    programme: Programme,
    rng: np.random.Generator,
) -> Wing:
    """The wing of tooth `k`, with a section of its `own`, that meets the spine's corridor at local `x`."""
    _, side, length = skeleton.teeth[k]
    lone = sum(other == side for _, other, _ in skeleton.teeth) == 1
    options = WingOptions(
        before=section.north if side > 0 else section.south,
        after=section.south if skeleton.bar else 0.0,
        front=(lone, lone),
        ends=(None, None if skeleton.bar else draw_end(programme, length, rng)),
    )
    frame = Straight().aside(x, section.left if side > 0 else section.right, side * math.pi / 2)
    return draw_wing(graph, frame, length, own, rng, options)


def _draw_bar(
    graph: SpaceGraph,
    skeleton: Skeleton,
    section: Section,
    places: list[float],
    teeth: list[Wing],
    rng: np.random.Generator,
) -> Wing:
    """The wing that closes the teeth into courtyards."""
    depth = section.left + skeleton.teeth[0][2] - section.right
    options = WingOptions(ports=[_port(-1, x, section) for x in places], front=(False, True))
    bar = draw_wing(graph, Straight().aside(0.0, depth, 0.0), skeleton.spine, section, rng, options)
    for x, tooth in zip(places, teeth, strict=True):
        join_corridors(graph, bar.piece_at(x), tooth.pieces[-1][2], rng)
    return bar


def vary(section: Section, rng: np.random.Generator) -> Section:
    """The section of another wing: often the same, else with other depths or rooms on one side only."""
    choice = rng.random()
    if choice < 0.45 or min(section.south, section.north) == 0.0:
        return section
    if choice < 0.6:
        return replace(section, **{str(rng.choice(["south", "north"])): 0.0})
    south = section.south * float(rng.uniform(0.85, 1.1))
    north = section.north * float(rng.uniform(0.85, 1.1))
    return replace(section, south=round(south, 2), north=round(north, 2))


def _port(side: int, x: float, section: Section) -> Port:
    """The passage for a tooth of the same section; its left points to -x on the north, +x on the south."""
    low, high = (section.left, -section.right) if side > 0 else (-section.right, section.left)
    return Port(side=side, x=x, corridor=section.corridor, low=x - low, high=x + high)


def _fronts(skeleton: Skeleton) -> tuple[bool, bool]:
    """Whether the spine has open ground on its south and north side."""
    sides = {side for _, side, _ in skeleton.teeth}
    return -1 not in sides, 1 not in sides
