"""Apartment houses: two flats on a stair hall, or flats along a corridor.

A flat has an inner hall, small rooms (bath, store, kitchen) on its dark side and living rooms on the facade.
A flat that reaches from facade to facade has its hall in the middle, as a little corridor, and rooms on both
sides.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import shapely

from layoutexplore.maps.generator import bays
from layoutexplore.maps.generator.bays import Bay
from layoutexplore.maps.generator.config import DrawnConfig
from layoutexplore.maps.generator.corridor_buildings import build_skeleton
from layoutexplore.maps.generator.programme import LIFT, STAIRS, STORE, Programme, RoomType
from layoutexplore.maps.generator.space_graph import SpaceGraph
from layoutexplore.maps.generator.wing_frame import Straight

LARGEST_PAIR = 330.0
"""Gross area up to which a house is a pair of flats on a stair hall, m2."""


def apartment(config: DrawnConfig, gross: float, rng: np.random.Generator) -> SpaceGraph:
    """A pair of flats on a stair hall when small, else flats along corridors."""
    if gross < LARGEST_PAIR and not (config.topology or (gross > 220.0 and rng.random() < 0.4)):
        return _pair(gross, rng)
    return build_skeleton(HOUSE, config, gross, 0.15, rng)


def flat(graph: SpaceGraph, bay: Bay, label: str, rng: np.random.Generator) -> int:
    """A flat with one facade: entrance and small rooms on the corridor, a hall, living rooms before it."""
    w, d = bay.width, bay.depth
    dark, strip = float(rng.uniform(1.9, 2.5)), float(rng.uniform(1.3, 1.6))
    if w < 5.0 or d - dark - strip < 2.9:
        return bays.with_bathroom(graph, bay, "studio", rng)
    entry, back = float(rng.uniform(1.5, 1.9)), dark + strip
    small = _shares(entry, w, 2.2, 1.5, rng)
    large = _shares(0.0, w, 3.7, 2.5, rng)
    cut = _shortening(small, large, rng)
    end = w - cut
    hall = graph.room(
        bay.frame,
        bay.shape([(0, 0), (entry, 0), (entry, dark), (end, dark), (end, back), (0, back)]),
        "hallway",
    )
    graph.link(bay.corridor(0.0, entry), hall, near=bay.world(entry / 2, 0.0))
    labels = _dark_labels(len(small) - 1)
    for k, name in enumerate(labels):
        room = graph.room(bay.frame, bay.box(small[k], small[k + 1], 0.0, dark), name)
        graph.link(hall, room, "narrow", near=bay.world(small[k], dark))
    _living_rooms(graph, bay, hall, large, (dark, back, d), end, "kitchen" in labels, rng)
    return hall


def _living_rooms(
    graph: SpaceGraph,
    bay: Bay,
    hall: int,
    cuts: list[float],
    depths: tuple[float, float, float],
    end: float,
    has_kitchen: bool,
    rng: np.random.Generator,
) -> None:
    """Rooms between the hall's strip (up to u = end) and the facade; the last takes the rest of the strip."""
    dark, back, facade = depths
    names = ["bedroom"] * (len(cuts) - 2) + ["living"]
    if not has_kitchen and len(names) > 1:
        names[int(np.argmin(np.diff(cuts[:-1])))] = "kitchen"
    last: int | None = None
    for k, name in enumerate(names):
        u0, u1 = cuts[k], cuts[k + 1]
        shape = bay.box(u0, u1, back, facade)
        if k == len(names) - 1 and end < u1 - 0.1:
            shape = bay.shape([(u0, back), (end, back), (end, dark), (u1, dark), (u1, facade), (u0, facade)])
        room = graph.room(bay.frame, shape, name)
        graph.link(hall, room, near=bay.world(u0 + 0.2 if rng.random() < 0.7 else u1, back))
        if last is not None and "kitchen" in (name, names[k - 1]) and rng.random() < 0.5:
            graph.link(last, room, near=bay.world(u0, (back + facade) / 2), optional=True)
        last = room


def _shares(start: float, end: float, typical: float, least: float, rng: np.random.Generator) -> list[float]:
    """Cuts from start to end into parts of about the typical width, none below the least."""
    length = end - start
    count = max(1, min(round(length / typical), int(length / least)))
    weights = rng.uniform(0.7, 1.4, count)
    parts = least + (length - count * least) * weights / weights.sum()
    return [start, *(start + np.cumsum(parts)).tolist()]


def _shortening(small: list[float], large: list[float], rng: np.random.Generator) -> float:
    """How much of the hall's strip the last living room can have so that both last rooms keep a door."""
    spare = min(small[-1] - small[-2], large[-1] - large[-2]) - 1.5
    return float(rng.uniform(0.6, 1.0)) * spare if spare > 0.8 and rng.random() < 0.7 else 0.0


def _dark_labels(count: int) -> list[str]:
    """What the small rooms of a flat are."""
    names = ["bathroom", "storage", "kitchen", "bathroom", "storage", "storage"]
    return [names[k % len(names)] for k in range(count)]


def _pair(gross: float, rng: np.random.Generator) -> SpaceGraph:
    """Two flats from facade to facade with a stair hall between them; one reaches behind the stair."""
    graph = SpaceGraph()
    depth = float(rng.uniform(9.5, 12.5)) if gross > 160.0 else float(rng.uniform(8.0, 9.5))
    well, run = float(rng.uniform(2.7, 3.3)), float(rng.uniform(4.4, 5.0))
    strip = float(rng.uniform(1.35, 1.6))
    low = depth - run - strip - 0.35
    widths = (gross / depth - well) * np.array([1.0, 1.0]) / 2
    shift = float(rng.uniform(-0.12, 0.12)) * widths[0]
    left, right = float(widths[0] + shift), float(widths[1] - shift)
    base = Straight()
    landing = graph.room(base, shapely.box(left, low, left + well, depth - run), "corridor")
    stair = Bay(base, left, left + well, depth - run, depth, [(left, left + well, landing)])
    room = graph.room(base, stair.box(0.0, well, 0.0, run), "stairs")
    graph.link(landing, room, "open")
    graph.details.append(base.place(stair.box(well / 2 - 0.08, well / 2 + 0.08, 0.6, run - 1.3)))
    near = [(0.0, left + right + well, landing)]
    _through_flat(graph, Bay(base, 0.0, left, 0.0, depth, near, True), (low, low + strip), well, rng)
    front, back = (float(rng.choice([-0.9, -0.6, 0.0, 0.0, 0.6, 1.2])) for _ in range(2))
    other = Bay(base, left + well, left + well + right, -front, depth + back, near)
    _through_flat(graph, other, (low + front, low + front + strip), 0.0, rng)
    graph.link(0, room, "door", near=stair.world(well / 2, run))
    return graph


def _through_flat(
    graph: SpaceGraph, bay: Bay, strip: tuple[float, float], behind: float, rng: np.random.Generator
) -> None:
    """A flat from facade to facade: entrance at u = 0, its south side `behind` metres behind the stair."""
    w, low, high = bay.width, *strip
    south, north = _shares(-behind, w, 3.8, 2.6, rng), _shares(0.0, w, 3.0, 2.0, rng)
    if behind:
        south[1:-1] = [u for u in south[1:-1] if u > 1.4]
    cut = _shortening(north, south, rng)
    hall = graph.room(bay.frame, bay.box(0.0, w - cut, low, high), "hallway")
    graph.link(bay.corridor(), hall, near=bay.world(0.0, (low + high) / 2))
    names = ["bathroom", "kitchen", "bedroom", "bedroom", "bedroom", "bedroom"]
    pod = high + 2.3 if len(north) > 2 and bay.depth - high > 4.1 and rng.random() < 0.8 else bay.depth
    for k, (u0, u1) in enumerate(pairwise(north)):
        shape = bay.box(u0, u1, high, bay.depth if k else pod)
        if k == 1 and pod < bay.depth:
            shape = bay.shape(
                [(u0, high), (u1, high), (u1, bay.depth), (0.0, bay.depth), (0.0, pod), (u0, pod)]
            )
        room = graph.room(bay.frame, shape, names[min(k, 5)])
        graph.link(hall, room, "narrow" if k == 0 else "door", near=bay.world(u0 + 0.2, high))
    ground = replace(bay, near=bay.y(low), far=bay.y(0.0))
    if behind:
        room = graph.room(ground.frame, ground.box(-behind, south[1], 0.0, low), "bedroom")
        graph.link(hall, room, near=ground.world(south[1], 0.0))
        south = south[1:]
    if len(south) > 1:
        _living_rooms(graph, ground, hall, south, (low - high, 0.0, low), w - cut, True, rng)


HOUSE = Programme(
    facade=(
        RoomType(label="flat", width=(6.5, 8.5), run=(1, 3), weight=2.0, build=flat),
        RoomType(label="flat", width=(8.5, 12.5), run=(1, 2), weight=2.0, build=flat),
        RoomType(label="studio", width=(3.6, 4.6), run=(1, 3), weight=0.8, build=flat),
    ),
    core=(STAIRS, LIFT, STORE, replace(STORE, build=bays.enfilade)),
    special=(RoomType(label="lobby", width=(3.0, 4.5), build=bays.foyer),),
    end=(),
    depth=(7.0, 9.2),
    corridor=(1.6, 2.1),
    module=(0.9, 1.2),
    connecting=0.0,
    core_every=36.0,
)
