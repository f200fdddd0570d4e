"""The graph of pieces: what each piece is like, and what lies between two that touch.

All counts are in cells or sides of cells, so that pieces and contacts can be added up when pieces merge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.bitsets import count_bits, set_bits, true_cells
from layoutexplore.grids.flood import spread_in_place
from layoutexplore.layout.merging.door_gaps import Openings
from layoutexplore.layout.merging.line_evidence import LineEvidence, count_rooms

# Columns of the node table. AREA: known free cells; SPACE: all cells; SIDES: sides shared with anything else;
# OPEN_END: sides towards unknown space; ROWS..: bounding box, half open; PEAK: largest distance to the
# obstacles' edges [cells].
AREA, SPACE, CLUTTER, SIDES, OPEN_END, WALL_SIDES, ROW0, ROW1, COL0, COL1, PEAK = range(11)
NODE_COLUMNS = 11

# Columns of the edge table. OPEN: sides in direct contact; ACROSS_ROWS: those between two rows; DOOR: those
# in an opening, with sums of its WIDTH and the LONG and SHORT run beside it [m]; PASS: largest distance to
# the obstacles on the contact [cells]; NEAR, NEAR_MIN, FAR: sums of the share of wall in line with the
# contact; THROUGH: contact across a wall; PARTED, COVERED, APART: sides near which lies an edge between two
# faces of the representative lines, sums of the covered shares of these edges, and sides near which two of
# their rooms meet; SEEN: those between two known free cells.
(
    OPEN,
    ACROSS_ROWS,
    DOOR,
    WIDTH,
    LONG,
    SHORT,
    PASS,
    NEAR,
    NEAR_MIN,
    FAR,
    THROUGH,
    PARTED,
    COVERED,
    APART,
    SEEN,
) = range(15)
EDGE_COLUMNS = 15

NEAR_REACH, FAR_REACH = 1.5, 6.0
"""How far walls in line with a contact are looked for on either side, in metres."""

SLACK = 0.1
"""A wall may step aside by this much [m]."""

BESIDE = 0.3
"""A line lies near a contact within this distance [m]."""

WALL_THICKNESS = 0.5
"""Two pieces touch across an obstacle up to twice so thick [m]."""

Lines = tuple[
    NDArray[np.int32],
    NDArray[np.int32],
    NDArray[np.int32],
    NDArray[np.int32],
    NDArray[np.float64],
    NDArray[np.float64],
    int,
]
"""For kernels: the arrays of a `LineEvidence` in their order, and in how many cells a line lies near a contact."""


@dataclass(frozen=True, eq=False)
class PieceGraph:
    """Pieces and their contacts.

    Attributes:
        nodes: float64 (k + 1, NODE_COLUMNS), row 0 is empty.
        ends: int32 (m, 2), the two pieces of each contact, the lower first.
        edges: float64 (m, EDGE_COLUMNS).
        rooms: float64 (k + 1, r + 1), known free cells of each piece in each room of the lines, column 0 in
            none.
        resolution: Metres a cell.
    """

    nodes: NDArray[np.float64]
    ends: NDArray[np.int32]
    edges: NDArray[np.float64]
    rooms: NDArray[np.float64]
    resolution: float


@njit(cache=True, nogil=True)
def _add_lines(
    edge: NDArray[np.float64], walls: NDArray[np.uint64], cols: int, r: int, c: int, near: int, far: int
) -> None:
    """Add the walls in line with a contact between cells (r, c) and (r + 1, c); what lies outside the grid is no wall."""
    before = max(count_bits(walls, r, cols, c - near, c), count_bits(walls, r + 1, cols, c - near, c)) / near
    after = (
        max(
            count_bits(walls, r, cols, c + 1, c + 1 + near),
            count_bits(walls, r + 1, cols, c + 1, c + 1 + near),
        )
        / near
    )
    edge[NEAR] += before + after
    edge[NEAR_MIN] += min(before, after)
    wide = max(
        count_bits(walls, r, cols, c - far, c + 1 + far), count_bits(walls, r + 1, cols, c - far, c + 1 + far)
    )
    edge[FAR] += wide / (2 * far + 1)


@njit(cache=True, nogil=True)
def add_node(whole: NDArray[np.float64], part: NDArray[np.float64]) -> None:
    """Add a piece to another one (rows of the node table); the sides between them still count."""
    for column in (AREA, SPACE, CLUTTER, SIDES, OPEN_END, WALL_SIDES):
        whole[column] += part[column]
    whole[ROW0], whole[COL0] = min(whole[ROW0], part[ROW0]), min(whole[COL0], part[COL0])
    whole[ROW1], whole[COL1] = max(whole[ROW1], part[ROW1]), max(whole[COL1], part[COL1])
    whole[PEAK] = max(whole[PEAK], part[PEAK])


@njit(cache=True, nogil=True)
def find_edge(
    a: int, b: int, index: NDArray[np.int32], heads: NDArray[np.int32], links: NDArray[np.int32]
) -> int:
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
    r: int,
    begin: int,
    end: int,
) -> None:
    """Add the cells begin <= c < end of row r to a piece."""
    known = furniture = 0
    for c in range(begin, end):
        known += free[r, c]
        furniture += clutter[r, c]
    node[SPACE] += end - begin
    node[AREA] += known
    node[CLUTTER] += furniture
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


@njit("boolean[:,::1](int32[:,::1], boolean[:,::1])", cache=True, nogil=True)
def _changes(spread: NDArray[np.int32], wall: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Cells whose right or upper neighbour belongs elsewhere, or lies outside the grid where the cell belongs to a piece.

    A piece ends at the walls that it was spread into.
    """
    rows, cols = spread.shape
    out = np.zeros((rows, cols), np.bool_)
    for r in range(rows - 1):
        here, above, wall_here, wall_above = spread[r], spread[r + 1], wall[r], wall[r + 1]
        for c in range(cols - 1):
            out[r, c] = (
                (here[c] != above[c])
                | (here[c] != here[c + 1])
                | ((here[c] > 0) & ((wall_here[c] != wall_above[c]) | (wall_here[c] != wall_here[c + 1])))
            )
    for r in range(rows):
        out[r, cols - 1] = (spread[r, cols - 1] > 0) | (
            r + 1 < rows and spread[min(r + 1, rows - 1), cols - 1] > 0
        )
    for c in range(cols):
        out[rows - 1, c] = (spread[rows - 1, c] > 0) | (
            c + 1 < cols and spread[rows - 1, min(c + 1, cols - 1)] > 0
        )
    return out


@njit(cache=True, nogil=True)
def _nodes(
    labels: NDArray[np.int32],
    changes: NDArray[np.int64],
    free: NDArray[np.bool_],
    clutter: NDArray[np.bool_],
    heights: NDArray[np.int32],
    count: int,
) -> NDArray[np.float64]:
    """The node table without the sides: a run of one label in a row begins at the row's first cell or after a change.

    `heights` are the bits of the distances: above 0, they rise as the distances do, and whole numbers are
    compared at once.
    """
    rows, cols = labels.shape
    nodes = np.zeros((count + 1, NODE_COLUMNS))
    peak = np.zeros(count + 1, np.int32)
    nodes[:, ROW0] = rows
    nodes[:, COL0] = cols
    k = 0
    for r in range(rows):
        begin = 0
        while begin < cols:
            a = labels[r, begin]
            end = cols
            while k < len(changes) and changes[k] < (r + 1) * cols:
                c = changes[k] - r * cols + 1
                k += 1
                if c < cols and labels[r, c] != a:
                    end = c
                    break
            if a > 0:
                _add_run(nodes[a], free, clutter, r, begin, end)
                top = peak[a]
                for c in range(begin, end):
                    top = max(top, heights[r, c])
                peak[a] = top
            begin = end
    nodes[:, PEAK] = peak.view(np.float32)
    for r in range(rows):  # sides on the left border of the grid
        if labels[r, 0] > 0:
            nodes[labels[r, 0], SIDES] += 1
            nodes[labels[r, 0], OPEN_END] += 1
    for c in range(cols):  # and on the lower one
        if labels[0, c] > 0:
            nodes[labels[0, c], SIDES] += 1
            nodes[labels[0, c], OPEN_END] += 1
    return nodes


@njit(cache=True, nogil=True)
def _add_evidence(edge: NDArray[np.float64], r: int, c: int, above: bool, lines: Lines) -> None:
    """Add what the representative lines say of the side between cell (r, c) and the one `above` it, or right of it."""
    row_strip, col_strip, face, room, edge_above, edge_right, reach = lines
    covered = 0.0
    if above:
        n, m = row_strip[max(r - reach, 0)], col_strip[c]
        far_n, far_m = row_strip[min(r + 1 + reach, len(row_strip) - 1)], m
        for k in range(n, far_n):
            covered = max(covered, edge_above[k, m])
    else:
        n, m = row_strip[r], col_strip[max(c - reach, 0)]
        far_n, far_m = n, col_strip[min(c + 1 + reach, len(col_strip) - 1)]
        for k in range(m, far_m):
            covered = max(covered, edge_right[n, k])
    if face[n, m] != face[far_n, far_m]:
        edge[PARTED] += 1
        edge[COVERED] += covered
    if room[n, m] != room[far_n, far_m]:
        edge[APART] += 1


@njit(cache=True, nogil=True)
def _add_contact(
    edge: NDArray[np.float64],
    r: int,
    c: int,
    above: bool,
    free: NDArray[np.bool_],
    distance: NDArray[np.float32],
    gap: NDArray[np.int32],
    gaps: NDArray[np.float64],
    walls: tuple[NDArray[np.uint64], NDArray[np.uint64], int, int],
) -> None:
    """Add the side between cell (r, c) and the one `above` it, or right of it, to a contact."""
    rr, cc = (r + 1, c) if above else (r, c + 1)
    along_rows, along_cols, near, far = walls
    edge[OPEN] += 1
    edge[SEEN] += free[r, c] & free[rr, cc]
    edge[PASS] = max(edge[PASS], min(distance[r, c], distance[rr, cc]))
    door = max(gap[r, c], gap[rr, cc])
    if door > 0:
        edge[DOOR] += 1
        edge[WIDTH] += gaps[door, 0]
        edge[LONG] += gaps[door, 1]
        edge[SHORT] += gaps[door, 2]
    if above:  # the contact runs along the row
        edge[ACROSS_ROWS] += 1
        _add_lines(edge, along_rows, distance.shape[1], r, c, near, far)
    else:
        _add_lines(edge, along_cols, distance.shape[0], c, r, near, far)


@njit(cache=True, nogil=True)
def _contacts(
    labels: NDArray[np.int32],
    spread: NDArray[np.int32],
    changes: NDArray[np.int64],
    free: NDArray[np.bool_],
    wall: NDArray[np.bool_],
    distance: NDArray[np.float32],
    gap: NDArray[np.int32],
    gaps: NDArray[np.float64],
    walls: tuple[NDArray[np.uint64], NDArray[np.uint64], int, int],
    lines: Lines,
    nodes: NDArray[np.float64],
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """The contacts; adds their sides to the nodes."""
    rows, cols = labels.shape
    # at most two contacts a change; grown arrays would be counted references in the loop
    ends = np.empty((2 * len(changes), 2), np.int32)
    edges = np.empty((2 * len(changes), EDGE_COLUMNS))
    links = np.empty(2 * len(changes), np.int32)
    heads = np.full(len(nodes), -1, np.int32)
    m, e, r = 0, -1, 0
    for i in changes:
        while i >= (r + 1) * cols:
            r += 1
        c = i - r * cols
        a, p = int(labels[r, c]), int(spread[r, c])
        for above in (True, False):
            rr, cc = (r + 1, c) if above else (r, c + 1)
            inside = rr < rows and cc < cols
            b = int(labels[rr, cc]) if inside else 0
            q = int(spread[rr, cc]) if inside else 0
            if a != b:
                _add_side(nodes, a, b, inside and wall[rr, cc])
                _add_side(nodes, b, a, wall[r, c])
            if p == q or p == 0 or q == 0:
                continue
            low, high = min(p, q), max(p, q)
            if e < 0 or ends[e, 0] != low or ends[e, 1] != high:  # mostly the contact of the side before
                e = find_edge(low, high, ends, heads, links)
            if e < 0:
                e = m
                m += 1
                ends[e, 0] = low
                ends[e, 1] = high
                links[e] = heads[low]
                heads[low] = e
                edges[e] = 0.0
            if a == 0 or b == 0:
                edges[e, THROUGH] += 1
            else:
                _add_contact(edges[e], r, c, above, free, distance, gap, gaps, walls)
                _add_evidence(edges[e], r, c, above, lines)
    return ends[:m].copy(), edges[:m].copy()


def piece_graph(
    labels: NDArray[np.int32],
    *,
    free: NDArray[np.bool_],
    clutter: NDArray[np.bool_],
    wall: NDArray[np.bool_],
    distance: NDArray[np.float32],
    openings: Openings,
    lines: LineEvidence,
    resolution: float,
) -> PieceGraph:
    """The graph of a map's pieces.

    Args:
        labels: int32 (rows, cols), the pieces, numbered from 1 without gaps, 0 for none.
        free: bool (rows, cols), known free cells.
        clutter: bool (rows, cols), occupied cells that are no walls.
        wall: bool (rows, cols), occupied cells that are.
        distance: float32 (rows, cols), distance to the edges of the walls' cells, in cells.
        openings: The candidate openings.
        lines: The representative lines.
        resolution: Metres a cell.
    """
    steps = max(round(WALL_THICKNESS / resolution), 1)
    slack, near, far, beside = (
        max(round(length / resolution), 1) for length in (SLACK, NEAR_REACH, FAR_REACH, BESIDE)
    )
    rows, cols = labels.shape
    wall_cells = true_cells(wall)
    along_rows, along_cols = set_bits(wall_cells, rows, cols, slack)
    spread = labels.copy()
    spread_in_place(spread, wall, steps)
    changes = true_cells(_changes(spread, wall))
    count = int(labels.max(initial=0))
    nodes = _nodes(labels, changes, free, clutter, distance.view(np.int32), count)
    ends, edges = _contacts(
        labels,
        spread,
        changes,
        free,
        wall,
        distance,
        openings.gap,
        openings.table.astype(np.float64) * resolution,
        (along_rows, along_cols, near, far),
        (lines.row_strip, lines.col_strip, lines.face, lines.room, lines.above, lines.right, beside),
        nodes,
    )
    return PieceGraph(nodes, ends, edges, count_rooms(labels, free, lines, count, beside=slack), resolution)
