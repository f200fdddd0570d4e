"""Grids and graphs that the tests of the merging method share."""

from __future__ import annotations

import itertools
from dataclasses import replace

import cv2
import numpy as np
import shapely
from hypothesis import strategies as st

from layoutexplore.grids.grid import UNKNOWN, OccupancyGrid
from layoutexplore.layout.alignment import surfaces
from layoutexplore.layout.merging.graph_tables import EDGE, NODE, RegionGraph


def office(clutter: bool = False) -> OccupancyGrid:
    """A corridor of 2 m, three rooms of 4 x 5 m on either side, doors of 0.9 m, walls of 0.2 m; at 0.05 m."""
    cells = np.full((260, 280), -1, np.int8)
    cells[10:250, 10:270] = 100
    cells[110:150, 14:266] = 0
    for k in range(3):
        left = 14 + 84 * k + (2 if k == 2 else 0)
        for rows, door in (((14, 106), (106, 110)), ((154, 246), (150, 154))):
            cells[rows[0] : rows[1], left : left + 80] = 0
            cells[door[0] : door[1], left + 30 : left + 48] = 0
    if clutter:
        rng = np.random.default_rng(3)
        for r, c in rng.integers(20, 240, (25, 2)):
            if (cells[r - 2 : r + 6, c - 2 : c + 6] == 0).all():
                cells[r : r + 3, c : c + 3] = 100
    return OccupancyGrid(cells, 0.05)


def plan() -> np.ndarray:
    """Two rooms of 4 m x 5 m above a corridor of 2 m, walls of 0.2 m, doors of 0.9 m, at 0.05 m."""
    cells = np.full((170, 190), UNKNOWN, np.int8)
    cells[10:164, 10:178] = 100
    cells[14:54, 14:174] = 0
    cells[58:158, 14:92] = 0
    cells[58:158, 96:174] = 0
    cells[54:58, 40:58] = 0
    cells[54:58, 120:138] = 0
    return cells


def rough(cells: np.ndarray) -> np.ndarray:
    """The same map with the surfaces of its walls stepping in and out by a cell, as on recorded maps."""
    out, rng = cells.copy(), np.random.default_rng(0)
    out[surfaces(cells) & (rng.random(cells.shape) < 0.4)] = 0
    return out


def rooms_of(cells: np.ndarray) -> np.ndarray:
    truth = np.zeros(cells.shape, np.int32)
    truth[14:54], truth[58:158, 14:92], truth[58:158, 96:174] = 1, 2, 3
    return np.where(cells == 0, truth, 0).astype(np.int32)


@st.composite
def graphs(draw: st.DrawFn) -> RegionGraph:
    count = draw(st.integers(2, 9))
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    pairs = [(a, b) for a in range(1, count + 1) for b in range(a + 1, count + 1) if rng.random() < 0.5]
    nodes = np.zeros((count + 1, len(NODE)))
    nodes[1:] = rng.integers(1, 60, (count, len(NODE)))
    edges = rng.integers(0, 6, (len(pairs), len(EDGE))).astype(np.float64)
    edges[:, EDGE.door] = np.minimum(edges[:, EDGE.door], edges[:, EDGE.open])
    rooms = rng.integers(0, 5, (count + 1, 3)).astype(np.float64)
    return RegionGraph(nodes, np.array(pairs, np.int32).reshape(-1, 2), edges, rooms, 1.0)


def boxed(graph: RegionGraph) -> RegionGraph:
    """A drawn graph whose regions have bounding boxes of at least one cell."""
    nodes = graph.nodes.copy()
    nodes[1:, NODE.row1] += nodes[1:, NODE.row0]
    nodes[1:, NODE.col1] += nodes[1:, NODE.col0]
    return replace(graph, nodes=nodes)


def slow_parts(graph: RegionGraph, area: float) -> list[set[int]]:
    """The regions that become one: each sliver in turn, by size, looks at all its group's contacts."""
    groups = {k: {k} for k in range(1, len(graph.nodes))}
    of = {k: k for k in groups}
    order = sorted(groups, key=lambda k: (graph.nodes[k, NODE.space], k))
    for k in order:
        if sum(graph.nodes[m, NODE.space] for m in groups[of[k]]) >= area:
            continue
        found: dict[int, list[float]] = {}
        for (a, b), edge in zip(graph.ends.tolist(), graph.edges, strict=True):
            if edge[EDGE.open] > 0 and (of[a] == of[k]) != (of[b] == of[k]):
                other = of[b] if of[a] == of[k] else of[a]
                sums = found.setdefault(other, [0.0, 0.0, 0.0])
                sums[0] += edge[EDGE.open]
                sums[1] += edge[EDGE.door]
                sums[2] = max(sums[2], edge[EDGE.clearance])
        if found:
            top = max((v[2] * (0.5 if v[1] > 0.5 * v[0] else 1.0), v[0]) for v in found.values())
            best = {o for o, v in found.items() if (v[2] * (0.5 if v[1] > 0.5 * v[0] else 1.0), v[0]) == top}
            if len(best) > 1:
                return []  # a tie: any choice is right
            other, mine = best.pop(), of[k]
            groups[other] |= groups.pop(mine)
            for m in groups[other]:
                of[m] = other
    return list(groups.values())


def pentagon(seed: int = 0) -> tuple[OccupancyGrid, np.ndarray]:
    """A pentagon with ten rooms along a corridor around a court, furnished, and its rooms; at 0.05 m.

    Each side has two rooms of about 5 m depth, doors of 0.9 m in a corridor of 2 m, walls of 0.15 m;
    cupboards stand at the walls, some of them through a wall, and tables on thin legs in the rooms.
    """
    rng = np.random.default_rng(seed)
    rings = [
        radius * np.exp(2j * np.pi * (np.arange(6) / 5 + 0.03)) for radius in (15.0, 15.0 - 6.2, 15.0 - 8.7)
    ]
    outer, front, court = (np.stack([ring.real, ring.imag], axis=1) for ring in rings)
    floors, doors, things = [], [], []
    for k in range(5):
        middle, back = front[k : k + 2].mean(0), outer[k : k + 2].mean(0)
        for corner, end in ((outer[k], front[k]), (outer[k + 1], front[k + 1])):
            room = shapely.Polygon([corner, back, middle, end]).buffer(-0.075, join_style="mitre")
            door = (
                end + 0.6 * (middle - end),
                end + (0.6 + 0.9 / np.hypot(*(middle - end))) * (middle - end),
            )
            floors.append(room)
            doors.append(shapely.LineString(door).buffer(0.12, cap_style="flat"))
            things += _furniture(room, np.stack([corner, back, middle]), rng)
    floors.append(shapely.Polygon(front[:5], [court[:5]]).buffer(-0.075, join_style="mitre"))
    away = shapely.union_all(doors).buffer(0.7)
    free = shapely.union_all([*floors, *doors]).difference(
        shapely.union_all([thing for thing in things if not thing.intersects(away)])
    )
    side = 640
    x, y = (v.ravel() * 0.05 - 16.0 for v in np.meshgrid(np.arange(side) + 0.5, np.arange(side) + 0.5))
    cells = np.where(shapely.contains_xy(free, x, y), 0, 100).reshape(side, side).astype(np.int8)
    near = cv2.dilate((cells == 0).astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    building = shapely.Polygon(outer[:5], [court[:5]]).buffer(0.3, join_style="mitre")
    cells[~near & ~shapely.contains_xy(building, x, y).reshape(side, side)] = UNKNOWN
    truth = np.zeros((side, side), np.int32)
    for k, floor in enumerate(floors):
        truth[shapely.contains_xy(floor, x, y).reshape(side, side)] = k + 1
    return OccupancyGrid(cells, 0.05), truth


def _furniture(room: shapely.Polygon, walls: np.ndarray, rng: np.random.Generator) -> list[shapely.Polygon]:
    """Cupboards along two walls of a room, and a table with chairs, both on legs."""
    out = []
    for begin, end in itertools.pairwise(walls):
        along = (end - begin) / np.hypot(*(end - begin))
        for place in rng.uniform(0.1, 0.9, 2):
            at, long = begin + place * (end - begin), rng.uniform(0.4, 0.9)
            out.append(
                shapely.LineString([at - long * along, at + long * along]).buffer(0.45, cap_style="flat")
            )
    centre, (u, v) = np.array(room.centroid.coords[0]), np.eye(2)
    for row, col in itertools.product((-0.6, 0.0, 0.6), (-0.4, 0.4)):
        out.append(shapely.Point(*(centre + row * u + col * v)).buffer(0.08))
        out.append(shapely.Point(*(centre + (row + 0.2) * u + 2 * col * v)).buffer(0.04))
    return out
