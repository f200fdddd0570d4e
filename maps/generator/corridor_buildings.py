"""Buildings along right-angled corridors: offices, schools and hospitals on a skeleton or as a racetrack.

A racetrack is two parallel corridors with wards on the outer sides, a core of stairs, lifts, stores and nurse
stations between them, and cross links every 15 to 25 m.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely

from layoutexplore.maps.generator.bands import furnish_plots
from layoutexplore.maps.generator.config import DrawnConfig
from layoutexplore.maps.generator.programme import HOSPITAL, OFFICE, OFFICE_DEEP, SCHOOL, Programme
from layoutexplore.maps.generator.skeletons import draw_skeleton, plan_skeleton
from layoutexplore.maps.generator.space_graph import AttemptError, SpaceGraph, added
from layoutexplore.maps.generator.wing_frame import Straight
from layoutexplore.maps.generator.wings import Port, Section, Wing, WingOptions, draw_wing, join_corridors

POPULARITY = {
    "I": 1.0,
    "L": 2.0,
    "T": 1.6,
    "Z": 1.2,
    "U": 1.8,
    "H": 1.2,
    "comb": 1.3,
    "fishbone": 1.3,
    "ring": 1.6,
    "eight": 1.0,
}
"""How often a topology is tried first, where none is asked for."""

DEEP_ROOMS = (6.5, 10.0)
"""Depth of the laboratories inside a deep office building, m."""

LONGEST_RACETRACK = 85.0
"""Longest racetrack, m."""


def draw_section(programme: Programme, gross: float, single: float, rng: np.random.Generator) -> Section:
    """A wing's cross-section; shallower in small buildings, one-sided with probability `single`."""
    shrink = min(1.0, max(0.72, (gross / 420.0) ** 0.5))
    south, north = (float(rng.uniform(*programme.depth)) * shrink for _ in range(2))
    if rng.random() < 0.5:
        north = south
    if rng.random() < single:
        south = 0.0
    corridor = float(rng.uniform(*programme.corridor)) * max(shrink, 0.85)
    return Section(south=round(south, 2), corridor=round(max(corridor, 1.8), 2), north=round(north, 2))


def office(config: DrawnConfig, gross: float, rng: np.random.Generator) -> SpaceGraph:
    """Double-loaded corridors in any topology, or a deep building with laboratories between two corridors."""
    if gross > 1300.0 and not config.topology and rng.random() < 0.3:
        section = draw_section(OFFICE, gross, 0.0, rng)
        inner = tuple(float(d) for d in rng.uniform(*DEEP_ROOMS, 2))
        length = gross / (2 * section.south + 2 * section.corridor + added(inner))
        if 24.0 < length < LONGEST_RACETRACK:
            return _racetrack(config, gross, length, section, inner, OFFICE_DEEP, rng)
    return build_skeleton(OFFICE, config, gross, 0.05 if gross < 900.0 else 0.0, rng)


def school(config: DrawnConfig, gross: float, rng: np.random.Generator) -> SpaceGraph:
    """Classroom wings on wide corridors, often one-sided, with hall and gym where the size allows it."""
    return build_skeleton(SCHOOL, config, gross, 0.3, rng)


def hospital(config: DrawnConfig, gross: float, rng: np.random.Generator) -> SpaceGraph:
    """A racetrack of wards around a core, or, small, very large or by topology, double-loaded ward wings."""
    core = float(rng.uniform(5.0, 7.0))
    depth, corridor = float(rng.uniform(*HOSPITAL.depth)), float(rng.uniform(*HOSPITAL.corridor))
    length = gross / (2 * depth + 2 * corridor + core)
    if config.topology or not 24.0 <= length <= LONGEST_RACETRACK or rng.random() < 0.25:
        return build_skeleton(HOSPITAL, config, gross, 0.0, rng)
    return _racetrack(
        config,
        gross,
        length,
        Section(south=depth, corridor=corridor, north=depth),
        (core, 0.0),
        HOSPITAL,
        rng,
    )


def build_skeleton(
    programme: Programme, config: DrawnConfig, gross: float, single: float, rng: np.random.Generator
) -> SpaceGraph:
    """A building on a corridor skeleton of `gross` m2."""
    graph = SpaceGraph()
    section = draw_section(programme, gross, single, rng)
    run = gross / section.width
    names = [config.topology] if config.topology else _shuffled_topologies(rng)
    for topology in names:
        skeleton = plan_skeleton(topology, run, section.width, config.topology is not None, rng)
        if skeleton is not None:
            break
    else:
        raise AttemptError("no topology fits")
    wings = draw_skeleton(graph, skeleton, section, programme, rng)
    furnish_plots(graph, [plot for wing in wings for plot in wing.plots], programme, config.scale, gross, rng)
    return graph


def _shuffled_topologies(rng: np.random.Generator) -> list[str]:
    """All topologies in a random order that prefers the popular ones."""
    names = list(POPULARITY)
    weights = np.array([POPULARITY[n] for n in names])
    return [
        names[int(k)] for k in rng.choice(len(names), len(names), replace=False, p=weights / weights.sum())
    ]


def _racetrack(
    config: DrawnConfig,
    gross: float,
    length: float,
    section: Section,
    inner: tuple[float, ...],
    programme: Programme,
    rng: np.random.Generator,
) -> SpaceGraph:
    """Two corridors around a core; `inner`: depths of the core's bands on the first and second (0 = none)."""
    graph = SpaceGraph()
    half, deep = section.corridor / 2, added(inner)
    inset = 0.0 if rng.random() < 0.6 else float(rng.uniform(3.6, 5.0))
    links = max(1, round((length - 2 * inset) / float(rng.uniform(15.0, 26.0))))
    places = np.linspace(inset + half, length - inset - half, links + 1).tolist()
    gaps = [
        [Port(side=s, x=x, corridor=section.corridor, low=x - half, high=x + half) for x in places]
        for s in (1, -1)
    ]
    base = Straight()
    first, second = replace(section, north=inner[0]), replace(section, south=inner[1])
    one = draw_wing(graph, base, length, first, rng, WingOptions(ports=gaps[0]))
    across = base.aside(0.0, section.corridor + deep, 0.0)
    two = draw_wing(graph, across, length, second, rng, WingOptions(ports=gaps[1] if inner[1] else ()))
    for x in places:
        link = graph.room(base, shapely.box(x - half, half, x + half, half + deep), "corridor")
        join_corridors(graph, one.piece_at(x), link, rng)
        graph.link(two.piece_at(x), link, "double")
    for wing, side in ((one, 1.0), (two, -1.0)):
        for plot in wing.plots:
            plot.front = plot.near * side < 0
            plot.dark = not plot.front and plot.x0 > 0.01 and plot.x1 < length - 0.01
    if not inner[1]:
        _turn_some(one, two, rng)
    furnish_plots(graph, [*one.plots, *two.plots], programme, config.scale, gross, rng)
    return graph


def _turn_some(one: Wing, two: Wing, rng: np.random.Generator) -> None:
    """Let about half of the core's rooms open to the second corridor."""
    for plot in one.plots:
        if plot.dark and rng.random() < 0.5:
            plot.near, plot.far, plot.corridors = plot.far, plot.near, two.pieces
