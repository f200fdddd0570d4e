"""Open halls: large rooms with columns and cubicles, separated by core strips and lined with small rooms.

The halls stand in a row. Between two of them runs a strip of stairs, toilets and stores with a passage
through it; along one long side (or both) meeting rooms and offices open straight into the halls.
"""

from __future__ import annotations

import math

import numpy as np
import shapely
from shapely import Polygon

from layoutexplore.maps.generator import bays
from layoutexplore.maps.generator.bands import Plot, furnish_plots
from layoutexplore.maps.generator.bays import Bay, Piece, columns
from layoutexplore.maps.generator.config import DrawnConfig
from layoutexplore.maps.generator.programme import CORE, Programme, RoomType
from layoutexplore.maps.generator.space_graph import SpaceGraph
from layoutexplore.maps.generator.wing_frame import Straight

OPEN_PLAN = Programme(
    facade=(
        RoomType(label="meeting", width=(3.6, 5.4), run=(1, 2), weight=2.0),
        RoomType(label="office", width=(2.7, 3.6), run=(2, 4), weight=2.0),
        RoomType(label="phone room", width=(1.8, 2.2), run=(2, 3), weight=0.6, build=bays.enfilade),
        RoomType(label="kitchen", width=(4.0, 6.0), weight=0.6, build=bays.lounge),
        RoomType(label="laboratory", width=(6.0, 9.0), weight=0.6, build=bays.beside),
    ),
    core=CORE,
    special=(RoomType(label="lobby", width=(5.0, 8.0), build=bays.foyer),),
    end=(),
    depth=(3.8, 5.4),
    corridor=(2.0, 2.6),
    connecting=0.1,
    core_every=60.0,
)

AISLE = 1.7
"""Width of the ways between rows of cubicles, m."""


def hall(config: DrawnConfig, gross: float, rng: np.random.Generator) -> SpaceGraph:
    """Halls in a row, with cubicles in most of them."""
    graph = SpaceGraph()
    count = (
        1
        if gross < 700.0
        else int(rng.integers(1, 3))
        if gross < 1600.0
        else min(5, int(rng.integers(2, 4)) + int(gross > 4500))
    )
    band = float(rng.uniform(*OPEN_PLAN.depth))
    south = band if rng.random() < 0.35 and gross > 500.0 else 0.0
    core = float(rng.uniform(4.6, 6.2))
    depth = float(np.clip(math.sqrt(gross / count) * rng.uniform(0.55, 0.8), 7.0, 32.0))
    whole = depth + band + south
    width = (gross - (count - 1) * core * whole) / (count * whole)
    plots: list[Plot] = []
    halls: list[Piece] = []
    x, base = 0.0, Straight()
    unequal = rng.uniform(0.8, 1.2, count)
    unequal *= count / unequal.sum()
    for k in range(count):
        own = float(width * unequal[k])
        area = shapely.box(x, 0.0, x + own, depth)
        halls.append((x, x + own, graph.room(base, area, "hall")))
        _fit_out(graph, area, rng)
        piece = [(x, x + own, halls[-1][2])]
        corner = 2.0 if k < count - 1 else 0.0
        for near, far in ((depth, depth + band), (0.0, -south)):
            if abs(far - near) > 0.1:
                plots.append(Plot(base, x, x + own - corner, near, far, piece, front=True))
                if corner:
                    end = Bay(base, x + own - corner, x + own + core, near, far, piece)
                    bays.plain(graph, end, "meeting", rng)
        x += own
        if k < count - 1:
            plots += _core_strip(graph, x, core, depth, rng)
            x += core
    _connect_strips(graph, plots, halls)
    furnish_plots(graph, plots, OPEN_PLAN, config.scale, gross, rng)
    return graph


def _core_strip(
    graph: SpaceGraph, x: float, width: float, depth: float, rng: np.random.Generator
) -> list[Plot]:
    """The plots of a strip across the building, with a passage from hall to hall left between them."""
    frame = Straight(x + width / 2, 0.0, math.pi / 2)
    way = float(rng.uniform(2.0, 2.8))
    middle = float(rng.uniform(0.35, 0.65)) * depth
    graph.room(frame, shapely.box(middle - way / 2, -width / 2, middle + way / 2, width / 2), "corridor")
    half = width / 2
    return [
        Plot(frame, a, b, half, -half, [], dark=True)
        for a, b in ((0.0, middle - way / 2), (middle + way / 2, depth))
    ]


def _connect_strips(graph: SpaceGraph, plots: list[Plot], halls: list[Piece]) -> None:
    """Open every passage to both halls, and the rooms of a strip to one of them."""
    passages = [key for key, label in graph.labels.items() if label == "corridor"]
    for k, passage in enumerate(passages):
        graph.link(halls[k][2], passage, "open")
        graph.link(halls[k + 1][2], passage, "double")
    strips = [plot for plot in plots if plot.dark]
    for k, plot in enumerate(strips):
        left = k % 3 != 1
        if not left:
            plot.near, plot.far = plot.far, plot.near
        plot.corridors = [(plot.x0, plot.x1, halls[k // 2 + (0 if left else 1)][2])]


def _fit_out(graph: SpaceGraph, area: Polygon, rng: np.random.Generator) -> None:
    """Columns, and in four halls of five rows of cubicles."""
    if rng.random() < 0.8:
        graph.fixtures += cubicles(area, rng)
    posts = columns(area, float(rng.uniform(6.0, 8.4)), float(rng.uniform(0.35, 0.5)), 1.5)
    desks = shapely.union_all(graph.fixtures) if graph.fixtures else Polygon()
    gaps = shapely.distance(desks, posts) if not desks.is_empty else np.full(len(posts), np.inf)
    graph.details += [post for post, gap in zip(posts, gaps, strict=True) if gap < 0.02 or gap > 0.8]


def cubicles(area: Polygon, rng: np.random.Generator) -> list[Polygon]:
    """Partitions 0.1 m thick of back-to-back cubicles in rows across a local rectangle, aisles between."""
    x0, y0, x1, y1 = area.bounds
    turned = (x1 - x0) < (y1 - y0)
    if turned:
        x0, y0, x1, y1 = y0, x0, y1, x1
    size, deep = float(rng.uniform(1.9, 2.4)), float(rng.uniform(1.8, 2.2))
    border = float(rng.uniform(1.7, 2.4))
    lanes = int((y1 - y0 - 2 * border + AISLE) // (2 * deep + AISLE))
    walls: list[Polygon] = []
    for lane in range(lanes):
        pitch = (y1 - y0 - 2 * border + AISLE) / lanes
        spine = y0 + border + (pitch - AISLE) / 2 + lane * pitch
        x = x0 + border
        while x + 2 * size < x1 - border:
            fits = int((x1 - border - x) // size)
            count = min(int(rng.integers(3, 7)), fits)
            if rng.random() < 0.88:
                walls += _cluster(x, spine, count, size, deep, rng)
            x += count * size + AISLE
    if turned:
        walls = [shapely.box(b, a, d, c) for a, b, c, d in (w.bounds for w in walls)]
    return walls


def _cluster(
    x: float, spine: float, count: int, size: float, deep: float, rng: np.random.Generator
) -> list[Polygon]:
    """One block of back-to-back cubicles: a spine, side walls, and short returns at the entrances."""
    half = 0.05
    walls = [shapely.box(x - half, spine - half, x + count * size + half, spine + half)]
    returns = float(rng.choice([0.0, 0.5, 0.7]))
    for k in range(count + 1):
        edge = x + k * size
        for side in (-1.0, 1.0):
            if 0 < k < count and rng.random() < 0.12:
                continue
            low, high = sorted((spine, spine + side * deep))
            walls.append(shapely.box(edge - half, low, edge + half, high))
            if returns and k < count:
                front = spine + side * deep
                walls.append(shapely.box(edge - half, front - half, edge + returns, front + half))
    return walls
