"""The graph of pieces: what each piece is like, and what lies between two that touch.

All counts are in cells or sides of cells, so that pieces and contacts can be added up when pieces merge.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.layout.openings import Openings, thicken

# Columns of the node table. AREA: known free cells; SPACE: all cells; SIDES: sides shared with anything else;
# OPEN_END: sides towards unknown space; ROWS..: bounding box, half open; PEAK: largest distance to the obstacles [cells].
AREA, SPACE, CLUTTER, SIDES, OPEN_END, WALL_SIDES, ROW0, ROW1, COL0, COL1, PEAK = range(11)
NODE_COLUMNS = 11

# Columns of the edge table. OPEN: sides in direct contact; ACROSS_ROWS: those between two rows; DOOR: those in an
# opening, with sums of its WIDTH and the LONG and SHORT run beside it [m]; PASS: largest distance to the obstacles on
# the contact [cells]; NEAR, NEAR_MIN, FAR: sums of the share of wall in line with the contact; THROUGH: contact across a wall.
OPEN, ACROSS_ROWS, DOOR, WIDTH, LONG, SHORT, PASS, NEAR, NEAR_MIN, FAR, THROUGH = range(11)
EDGE_COLUMNS = 11

NEAR_REACH, FAR_REACH = 1.5, 6.0
"""How far walls in line with a contact are looked for on either side, in metres."""

WALL_THICKNESS = 0.5
"""Two pieces touch across an obstacle up to twice so thick [m]."""


@dataclass(frozen=True, eq=False)
class PieceGraph:
    """Pieces and their contacts.

    Attributes:
        nodes: float64 (k + 1, NODE_COLUMNS), row 0 is empty.
        ends: int32 (m, 2), the two pieces of each contact, the lower first.
        edges: float64 (m, EDGE_COLUMNS).
        resolution: Metres a cell.
    """

    nodes: NDArray[np.float64]
    ends: NDArray[np.int32]
    edges: NDArray[np.float64]
    resolution: float


@njit(cache=True, nogil=True)
def _share(thick: NDArray[np.uint8], r: int, begin: int, end: int) -> float:
    """Share of wall among the cells begin <= c < end of a row; what lies outside the grid is no wall."""
    hits = 0
    for c in range(max(begin, 0), min(end, thick.shape[1])):
        hits += thick[r, c]
    return hits / (end - begin)


@njit(cache=True, nogil=True)
def _add_lines(edge: NDArray[np.float64], thick: NDArray[np.uint8], r: int, c: int, near: int, far: int) -> None:
    """Add the walls in line with a contact between cells (r, c) and (r + 1, c) of `thick`."""
    before = max(_share(thick, r, c - near, c), _share(thick, r + 1, c - near, c))
    after = max(_share(thick, r, c + 1, c + 1 + near), _share(thick, r + 1, c + 1, c + 1 + near))
    edge[NEAR] += before + after
    edge[NEAR_MIN] += min(before, after)
    edge[FAR] += max(_share(thick, r, c - far, c + 1 + far), _share(thick, r + 1, c - far, c + 1 + far))


@njit("void(int32[:,::1], boolean[:,::1], int64[::1], int64)", cache=True, nogil=True)
def _spread(out: NDArray[np.int32], wall: NDArray[np.bool_], front: NDArray[np.int64], steps: int) -> None:
    """Spread labels in place from the cells of a front."""
    rows, cols = out.shape
    for _ in range(steps):
        fresh = np.empty(4 * len(front), np.int64)
        m = 0
        for i in front:
            r, c = i // cols, i % cols
            for d in range(4):
                rr, cc = r + (d == 0) - (d == 1), c + (d == 2) - (d == 3)
                if 0 <= rr < rows and 0 <= cc < cols and wall[rr, cc] and out[rr, cc] == 0:
                    out[rr, cc] = out[r, c]
                    fresh[m] = rr * cols + cc
                    m += 1
        front = fresh[:m]


def spread_into(labels: NDArray[np.int32], wall: NDArray[np.bool_], steps: int) -> NDArray[np.int32]:
    """Labels spread into the walls by 4-neighbours, at most `steps` cells deep."""
    beside = cv2.dilate(wall.view(np.uint8), cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))).view(np.bool_)
    out = labels.copy()
    _spread(out, wall, np.flatnonzero(beside & (labels > 0)), steps)
    return out


@njit(cache=True, nogil=True)
def _edge(a: int, b: int, index: NDArray[np.int32], heads: NDArray[np.int32], links: NDArray[np.int32]) -> int:
    """Slot of contact (a, b) with a < b in the chain of a, or -1."""
    e = heads[a]
    while e >= 0:
        if index[e, 1] == b:
            return int(e)
        e = links[e]
    return -1


@njit(cache=True, nogil=True)
def _add_run(
    node: NDArray[np.float64],
    free: NDArray[np.bool_],
    clutter: NDArray[np.bool_],
    distance: NDArray[np.float32],
    r: int,
    begin: int,
    end: int,
) -> None:
    """Add the cells begin <= c < end of row r to a piece."""
    known = furniture = 0
    peak = np.float32(0)
    for c in range(begin, end):
        known += free[r, c]
        furniture += clutter[r, c]
        peak = max(peak, distance[r, c])
    node[SPACE] += end - begin
    node[AREA] += known
    node[CLUTTER] += furniture
    node[PEAK] = max(node[PEAK], peak)
    node[ROW0] = min(node[ROW0], r)
    node[ROW1] = max(node[ROW1], r + 1)
    node[COL0] = min(node[COL0], begin)
    node[COL1] = max(node[COL1], end)


@njit(cache=True, nogil=True)
def _add_side(nodes: NDArray[np.float64], label: int, other: int, blocked: bool) -> None:
    """Add a side of a cell of a piece; behind it lies another piece, or a wall, or nothing seen."""
    if label > 0:
        nodes[label, SIDES] += 1
        if other == 0:
            nodes[label, WALL_SIDES if blocked else OPEN_END] += 1


@njit(cache=True, nogil=True)
def _build(
    labels: NDArray[np.int32],
    spread: NDArray[np.int32],
    free: NDArray[np.bool_],
    clutter: NDArray[np.bool_],
    wall: NDArray[np.bool_],
    distance: NDArray[np.float32],
    gap: NDArray[np.int32],
    gaps: NDArray[np.float64],
    thick: NDArray[np.uint8],
    thick_turned: NDArray[np.uint8],
    near: int,
    far: int,
    count: int,
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.float64]]:
    rows, cols = labels.shape
    nodes = np.zeros((count + 1, NODE_COLUMNS))
    nodes[:, ROW0] = rows
    nodes[:, COL0] = cols
    ends = np.empty((1024, 2), np.int32)
    edges = np.zeros((1024, EDGE_COLUMNS))
    links = np.empty(1024, np.int32)
    heads = np.full(count + 1, -1, np.int32)
    m = 0
    for r in range(rows):
        begin = 0
        while begin < cols:  # runs of one label in a row
            a = labels[r, begin]
            end = begin + 1
            while end < cols and labels[r, end] == a:
                end += 1
            if a > 0:
                _add_run(nodes[a], free, clutter, distance, r, begin, end)
            begin = end
        for c in range(cols):
            a, p = int(labels[r, c]), int(spread[r, c])
            inner = r + 1 < rows and c + 1 < cols
            if inner and p == spread[r + 1, c] == spread[r, c + 1] and a == labels[r + 1, c] == labels[r, c + 1]:
                continue  # nothing ends here, as nearly everywhere
            for d in range(2):
                rr, cc = (r + 1, c) if d == 0 else (r, c + 1)
                inside = rr < rows and cc < cols
                b = int(labels[rr, cc]) if inside else 0
                q = int(spread[rr, cc]) if inside else 0
                if a == b and p == q:
                    continue
                if a != b:
                    _add_side(nodes, a, b, inside and wall[rr, cc])
                    _add_side(nodes, b, a, wall[r, c])
                if not inside:
                    continue
                if p == q or p == 0 or q == 0:
                    continue
                lo, hi = min(p, q), max(p, q)
                e = _edge(lo, hi, ends, heads, links)
                if e < 0:
                    if m >= len(links):
                        ends = np.concatenate((ends, np.empty_like(ends)))
                        edges = np.concatenate((edges, np.zeros_like(edges)))
                        links = np.concatenate((links, np.empty_like(links)))
                    e = m
                    m += 1
                    ends[e, 0] = lo
                    ends[e, 1] = hi
                    links[e] = heads[lo]
                    heads[lo] = e
                edge = edges[e]
                if a == 0 or b == 0:
                    edge[THROUGH] += 1
                    continue
                edge[OPEN] += 1
                edge[PASS] = max(edge[PASS], min(distance[r, c], distance[rr, cc]))
                door = max(gap[r, c], gap[rr, cc])
                if door > 0:
                    edge[DOOR] += 1
                    edge[WIDTH] += gaps[door, 0]
                    edge[LONG] += gaps[door, 1]
                    edge[SHORT] += gaps[door, 2]
                if d == 0:  # the contact runs along the row
                    edge[ACROSS_ROWS] += 1
                    _add_lines(edge, thick, r, c, near, far)
                else:
                    _add_lines(edge, thick_turned, c, r, near, far)
    # sides on the lower and left border of the grid
    for r in range(rows):
        if labels[r, 0] > 0:
            nodes[labels[r, 0], SIDES] += 1
            nodes[labels[r, 0], OPEN_END] += 1
    for c in range(cols):
        if labels[0, c] > 0:
            nodes[labels[0, c], SIDES] += 1
            nodes[labels[0, c], OPEN_END] += 1
    return nodes, ends[:m].copy(), edges[:m].copy()


def piece_graph(
    labels: NDArray[np.int32],
    *,
    free: NDArray[np.bool_],
    clutter: NDArray[np.bool_],
    wall: NDArray[np.bool_],
    distance: NDArray[np.float32],
    openings: Openings,
    resolution: float,
) -> PieceGraph:
    """The graph of a map's pieces.

    Args:
        labels: int32 (rows, cols), the pieces, numbered from 1 without gaps, 0 for none.
        free: bool (rows, cols), known free cells.
        clutter: bool (rows, cols), occupied cells that are no walls.
        wall: bool (rows, cols), occupied cells that are.
        distance: float32 (rows, cols), distance to the walls in cells.
        openings: The candidate openings.
        resolution: Metres a cell.
    """
    steps = max(round(WALL_THICKNESS / resolution), 1)
    slack = max(round(0.1 / resolution), 1)
    near, far = max(round(NEAR_REACH / resolution), 1), max(round(FAR_REACH / resolution), 1)
    nodes, ends, edges = _build(
        labels,
        spread_into(labels, wall, steps),
        free,
        clutter,
        wall,
        distance,
        openings.gap,
        openings.table.astype(np.float64) * resolution,
        thicken(wall, slack, across_rows=True),
        np.asarray(cv2.transpose(thicken(wall, slack, across_rows=False)), np.uint8),
        near,
        far,
        int(labels.max(initial=0)),
    )
    return PieceGraph(nodes, ends, edges, resolution)
