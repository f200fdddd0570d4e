"""Buildings that are not right-angled: wings at 30-60 degrees to each other, and wings on an arc.

`angled` puts wings around hubs: the hull of their end faces becomes a lobby, or a knee of the corridor with
wedge-shaped rooms beside it. `curved` bends a wing along an arc, alone, continued by straight wings, or with
a fan-shaped hall inside the bend.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import shapely
from shapely import Polygon

from layoutexplore.grids.arrays import Floats
from layoutexplore.maps.generator import bays
from layoutexplore.maps.generator.bands import furnish_plots
from layoutexplore.maps.generator.bays import Bay
from layoutexplore.maps.generator.config import DrawnConfig
from layoutexplore.maps.generator.corridor_buildings import draw_section
from layoutexplore.maps.generator.programme import HOSPITAL, OFFICE, SCHOOL, Programme
from layoutexplore.maps.generator.space_graph import AttemptError, SpaceGraph
from layoutexplore.maps.generator.wing_frame import Arc, Straight, WingFrame
from layoutexplore.maps.generator.wings import Section, Wing, WingOptions, draw_end, draw_wing, join_corridors

ANGLES = (30.0, 36.0, 40.0, 45.0, 45.0, 50.0, 60.0)
"""Turns between two wings, degrees."""

SHORTEST_WING = 9.0
"""Least length of a wing, m; two thirds of it in a small building."""

LONG = 160.0
"""Length of all wings from which a building closes up, as a star or as a ring of nearly a full turn, m."""

LARGEST_FAN = 1500.0
"""Gross area up to which a curved building has rooms on one side and a hall inside its bend, m2."""

SMALL = 300.0
"""Gross area up to which a building is small, m2."""

Face = tuple[WingFrame, float, int]
"""Where a wing meets a hub: its frame, the local x of its end, and the corridor's id there."""


def _pick(gross: float, rng: np.random.Generator) -> Programme:
    """What kind of building it is; small ones are offices."""
    return OFFICE if gross < SMALL else (OFFICE, OFFICE, SCHOOL, HOSPITAL)[int(rng.integers(0, 4))]


def angled(config: DrawnConfig, gross: float, rng: np.random.Generator) -> SpaceGraph:
    """Three or more wings around one hub, or a chain of two to four."""
    graph, programme = SpaceGraph(), _pick(gross, rng)
    section = draw_section(programme, gross, 0.3 if gross < SMALL else 0.04, rng)
    run = gross / section.width
    star = run > 4.5 * SHORTEST_WING and rng.random() < (0.35 if run < LONG else 1.0)
    wings = (_star if star else _chain)(graph, run, section, programme, rng)
    furnish_plots(graph, [plot for wing in wings for plot in wing.plots], programme, config.scale, gross, rng)
    return graph


def _chain(
    graph: SpaceGraph, run: float, section: Section, programme: Programme, rng: np.random.Generator
) -> list[Wing]:
    """Wings one after the other with a hub at every bend."""
    shortest = SHORTEST_WING if run * section.width > SMALL else SHORTEST_WING / 1.5
    most = int(run // (2.2 * SHORTEST_WING))
    count = max(2, min(int(rng.integers(2, 5)), most))
    shares = rng.dirichlet(np.full(count, 5.0))
    zigzag = rng.random() < 0.5
    sign = float(rng.choice([-1.0, 1.0]))
    frame, wings, last = Straight(), list[Wing](), None
    for k, share in enumerate(shares):
        length = max(shortest, float(share) * (run - (count - 1) * 0.6 * section.width))
        end = draw_end(programme, length, rng) if k in (0, count - 1) else None
        ends = (end if k == 0 else None, end if k == count - 1 and count > 1 else None)
        options = WingOptions(ends=ends, front=(count == 2, count == 2))
        wing = draw_wing(graph, frame, length, section, rng, options)
        if last is not None:
            _hub(graph, [last, (frame, 0.0, wing.piece_at(0.0))], section, rng)
        wings.append(wing)
        last = (frame, length, wing.piece_at(length))
        turn = math.radians(float(rng.choice(ANGLES))) * (sign if not zigzag or k % 2 == 0 else -sign)
        reach = max(section.left, -section.right) * math.tan(abs(turn) / 2) + float(rng.uniform(0.8, 3.0))
        frame = frame.ahead(length + reach, turn).ahead(reach)
    return wings


def _star(
    graph: SpaceGraph, run: float, section: Section, programme: Programme, rng: np.random.Generator
) -> list[Wing]:
    """Three to six wings around one hub."""
    count = max(3, min(6, round(run / 70.0)))
    spread = 2 * math.pi / count + np.radians(rng.uniform(-15.0, 15.0, count - 1)) * 3 / count
    headings = [0.0, *np.cumsum(spread).tolist()]
    tightest = min(float(spread.min()), 2 * math.pi - float(spread.sum()))
    reach = max(section.left, -section.right) / math.tan(tightest / 2) + 0.8
    lengths = np.maximum(rng.dirichlet(np.full(count, 6.0)) * (run - 1.2 * section.width), SHORTEST_WING)
    wings, faces = list[Wing](), list[Face]()
    for heading, length in zip(headings, lengths.tolist(), strict=True):
        frame = Straight(0.0, 0.0, heading).ahead(reach)
        options = WingOptions(front=(False, False), ends=(None, draw_end(programme, length, rng)))
        wing = draw_wing(graph, frame, length, section, rng, options)
        wings.append(wing)
        faces.append((frame, 0.0, wing.piece_at(0.0)))
    _hub(graph, faces, section, rng)
    return wings


def _hub(graph: SpaceGraph, faces: Sequence[Face], section: Section, rng: np.random.Generator) -> None:
    """The space between the end faces of wings: one lobby, or a corridor with rooms in the wedges."""
    half = section.corridor / 2
    whole = _hull(faces, section.right, section.left)
    world = Straight()
    if whole.area < 60.0 and rng.random() < 0.5:
        lobby = graph.room(world, whole, "lobby")
        for _, _, corridor in faces:
            graph.link(corridor, lobby, "open" if rng.random() < 0.6 else "double")
        return
    knee = _hull(faces, -half, half)
    wide = knee.area > 60.0
    middle = graph.room(world, knee, "lobby" if wide else "corridor")
    for _, _, corridor in faces:
        if wide:
            graph.link(corridor, middle, "open")
        else:
            join_corridors(graph, middle, corridor, rng)
    for wedge in sorted(_parts(whole.difference(knee)), key=lambda p: (-p.area, p.bounds)):
        if wedge.area > 6.0 and not wedge.buffer(-0.75).is_empty:
            uses = (
                ["stairs", "storage", "office", "meeting"]
                if wedge.area < 30.0
                else ["office", "meeting", "open office"]
            )
            room = graph.room(world, wedge, str(rng.choice(uses)))
            graph.link(middle, room)
        else:
            graph.solid(world, wedge)


def _hull(faces: Sequence[Face], low: float, high: float) -> Polygon:
    """Convex hull of the stretches from y = low to y = high of all end faces."""
    ends: list[Floats] = [frame.points(np.array([[x, low], [x, high]])) for frame, x, _ in faces]
    hull = shapely.MultiPoint(np.vstack(ends)).convex_hull
    if hull.geom_type != "Polygon":
        raise AttemptError("a hub without extent")
    return hull


def _parts(geometry: shapely.geometry.base.BaseGeometry) -> list[Polygon]:
    """The polygons of a difference."""
    return [
        part
        for part in getattr(geometry, "geoms", [geometry])
        if part.geom_type == "Polygon" and part.area > 0.01
    ]


def curved(config: DrawnConfig, gross: float, rng: np.random.Generator) -> SpaceGraph:
    """A wing on an arc, with straight wings before and after it where there is length for them."""
    graph, programme = SpaceGraph(), _pick(gross, rng)
    fan = rng.random() < 0.4 and gross < LARGEST_FAN
    section = draw_section(programme, gross, 0.0, rng)
    if fan:
        section = replace(section, north=0.0, south=max(section.south, section.north))
    left = True if fan else bool(rng.random() < 0.5)
    inside = section.left if left else -section.right
    spare = 0.85 if fan else 1.0
    run = spare * gross / section.width
    arc_length = run * (1.0 if run < 35.0 or rng.random() < 0.3 else float(rng.uniform(0.45, 0.75)))
    sweep = float(rng.uniform(50.0, 190.0))
    if run > LONG:
        arc_length, sweep = run, 190.0 + sweep / 2
    radius = max(arc_length / math.radians(sweep), inside + (9.0 if fan else 6.0))
    before = (run - arc_length) * float(rng.choice([0.0, 0.0, 0.3, 0.5]))
    lengths = [length if length >= 6.0 else 0.0 for length in (before, arc_length, run - arc_length - before)]
    wings = _path(graph, lengths, radius, left, section, programme, rng)
    if fan:
        bend = next(wing for wing in wings if isinstance(wing.frame, Arc))
        _fan_hall(graph, bend, radius, 0.15 * gross, rng)
    furnish_plots(graph, [plot for wing in wings for plot in wing.plots], programme, config.scale, gross, rng)
    return graph


def _path(
    graph: SpaceGraph,
    lengths: Sequence[float],
    radius: float,
    left: bool,
    section: Section,
    programme: Programme,
    rng: np.random.Generator,
) -> list[Wing]:
    """A straight wing, an arc and a straight wing, those of length 0 left out; corridors are joined."""
    start = Straight()
    arc = Arc(start.ahead(lengths[0]), radius, left)
    frames: list[WingFrame] = [start, arc, arc.after(lengths[1])]
    used = [k for k in range(3) if lengths[k] > 0]
    wings = list[Wing]()
    for k in used:
        first = draw_end(programme, lengths[k], rng) if k == used[0] else None
        final = draw_end(programme, lengths[k], rng) if k == used[-1] else None
        options = WingOptions(ends=(first, final), front=(left, not left))
        wings.append(draw_wing(graph, frames[k], lengths[k], section, rng, options))
    for one, two in pairwise(wings):
        join_corridors(graph, one.piece_at(one.length), two.piece_at(0.0), rng)
    return wings


def _fan_hall(graph: SpaceGraph, bend: Wing, radius: float, area: float, rng: np.random.Generator) -> None:
    """A fan-shaped hall inside the bend, on the corridor, of about `area` m2."""
    near = bend.section.left
    deep = min(radius - near - 3.0, float(rng.uniform(7.0, 14.0)))
    width = min(area / deep * radius / (radius - near - deep / 2), 0.75 * bend.length)
    if deep < 4.0 or width < 5.0:
        return
    x0 = float(rng.uniform(0.1, 0.9)) * (bend.length - width)
    bay = Bay(bend.frame, x0, x0 + width, near, near + deep, bend.pieces)
    bays.big(graph, bay, "aula", rng)
