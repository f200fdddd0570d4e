"""The table of contacts: what lies between two regions that touch, side by side of their cells."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Floats, Floats32, Ints, Ints32, Mask, Words
from layoutexplore.grids.bitsets import count_bits
from layoutexplore.layout.merging.door_gaps import GAP
from layoutexplore.layout.merging.graph_tables import EDGE, edge_slots, find_slot
from layoutexplore.layout.merging.node_table import add_side

ASKEW_SLOPE = 0.2
"""A contact runs askew where it rises or falls by more than this share of its other extent."""


class BorderMap(NamedTuple):
    """How likely a room's border passes, float32 (squares, squares), and which square a cell lies in.

    Attributes:
        likely: Probabilities.
        row: int32 (rows,), row of squares of each row of cells.
        col: int32 (cols,), column of squares of each column of cells.
    """

    likely: Floats32
    row: Ints32
    col: Ints32


class RegionMaps(NamedTuple):
    """The map that the regions lie in, each (rows, cols).

    Attributes:
        labels: int32, the regions, from 1.
        spread: int32, the regions spread into the walls.
        free: bool, known free cells.
        wall: bool, occupied cells that are walls.
        distance: float32, to the obstacles' edges [cells].
        gap: int32, row of the table of door gaps for the cells of one, 0 elsewhere.
        border: How likely a room's border passes, by square.
    """

    labels: Ints32
    spread: Ints32
    free: Mask
    wall: Mask
    distance: Floats32
    gap: Ints32
    border: BorderMap


class WallBits(NamedTuple):
    """Walls, thickened by how far they may step aside, as bits; and how far they are looked at [cells].

    Attributes:
        along_rows: uint64, the rows of the map.
        along_cols: uint64, its columns.
        near: Reach on either side of a contact.
        far: The longer one.
        slack: How far walls may step aside beside a contact askew; -1 where none is looked for there.
    """

    along_rows: Words
    along_cols: Words
    near: int
    far: int
    slack: int


class LineStrips(NamedTuple):
    """The arrays of a `LineEvidence`, and in how many cells a line lies near a contact."""

    row_strip: Ints32
    col_strip: Ints32
    face: Ints32
    room: Ints32
    above: Floats
    right: Floats
    reach: int


class Side(NamedTuple):
    """The side between cell (row, col) and the one above it, or right of it."""

    row: int
    col: int
    above: bool


@njit(cache=True, nogil=True)
def _add_walls(edge: Floats, walls: Words, cols: int, r: int, c: int, near: int, far: int) -> None:
    """Add the walls in line with a contact between cells (r, c) and (r + 1, c); outside the grid is none.

    A wall counts in the row that has more of it: it may lie on either side of the contact.
    """
    before, after = c - near, c + 1 + near
    left = max(count_bits(walls, r, cols, before, c), count_bits(walls, r + 1, cols, before, c)) / near
    right = max(count_bits(walls, r, cols, c + 1, after), count_bits(walls, r + 1, cols, c + 1, after)) / near
    edge[EDGE.near] += left + right
    edge[EDGE.near_min] += min(left, right)
    first, last = c - far, c + 1 + far
    wide = max(count_bits(walls, r, cols, first, last), count_bits(walls, r + 1, cols, first, last))
    edge[EDGE.far] += wide / (2 * far + 1)


@njit(cache=True, nogil=True)
def _add_lines(edge: Floats, side: Side, lines: LineStrips) -> None:
    """Add what the lines say of a side: faces and rooms of the strips `reach` before and behind it."""
    r, c, reach = side.row, side.col, lines.reach
    covered = 0.0
    if side.above:
        n, m = lines.row_strip[max(r - reach, 0)], lines.col_strip[c]
        far_n, far_m = lines.row_strip[min(r + 1 + reach, len(lines.row_strip) - 1)], m
        for k in range(n, far_n):
            covered = max(covered, lines.above[k, m])
    else:
        n, m = lines.row_strip[r], lines.col_strip[max(c - reach, 0)]
        far_n, far_m = n, lines.col_strip[min(c + 1 + reach, len(lines.col_strip) - 1)]
        for k in range(m, far_m):
            covered = max(covered, lines.right[n, k])
    if lines.face[n, m] != lines.face[far_n, far_m]:
        edge[EDGE.parted] += 1
        edge[EDGE.covered] += covered
    if lines.room[n, m] != lines.room[far_n, far_m]:
        edge[EDGE.apart] += 1


@njit(cache=True, nogil=True)
def _add_contact(edge: Floats, side: Side, maps: RegionMaps, gaps: Floats, walls: WallBits) -> None:
    """Add a side to a contact; `gaps` are the door gaps in metres."""
    r, c = side.row, side.col
    rr, cc = (r + 1, c) if side.above else (r, c + 1)
    edge[EDGE.open] += 1
    edge[EDGE.seen] += maps.free[r, c] & maps.free[rr, cc]
    edge[EDGE.border] += maps.border.likely[maps.border.row[r], maps.border.col[c]]
    edge[EDGE.clearance] = max(edge[EDGE.clearance], min(maps.distance[r, c], maps.distance[rr, cc]))
    door = max(maps.gap[r, c], maps.gap[rr, cc])
    if door > 0:
        edge[EDGE.door] += 1
        edge[EDGE.width] += gaps[door, GAP.width]
        edge[EDGE.long] += gaps[door, GAP.long]
        edge[EDGE.short] += gaps[door, GAP.short]
    # a contact with the cell above runs along the row, the other one along the column
    if side.above:
        edge[EDGE.across_rows] += 1
        _add_walls(edge, walls.along_rows, maps.distance.shape[1], r, c, walls.near, walls.far)
    else:
        _add_walls(edge, walls.along_cols, maps.distance.shape[0], c, r, walls.near, walls.far)


@njit(cache=True, nogil=True)
def _wall_ahead(wall: Mask, row: float, col: float, step: tuple[float, float], reach: int, slack: int) -> int:
    """Steps of at most `reach` from a place on at which a wall lies, at most `slack` cells aside."""
    count = 0
    for k in range(1, reach + 1):
        # a line that has left the grid, or its border by more than the slack, does not come back
        if not (-slack <= row + k * step[0] < wall.shape[0] + slack):
            break
        if not (-slack <= col + k * step[1] < wall.shape[1] + slack):
            break
        found = False
        for aside in range(-slack, slack + 1):
            r = int(np.floor(row + k * step[0] - aside * step[1] + 0.5))
            c = int(np.floor(col + k * step[1] + aside * step[0] + 0.5))
            if 0 <= r < wall.shape[0] and 0 <= c < wall.shape[1]:
                found |= wall[r, c]
        count += found
    return count


@njit(cache=True, nogil=True)
def _look_along(edges: Floats, places: Floats, wall: Mask, walls: WallBits) -> None:
    """The walls in line with contacts askew, looked for from their ends on, for all of their sides.

    Side by side they would be looked for along rows and columns, where there is none.

    Args:
        edges: float64 (m, columns of `EDGE`), changed.
        places: float64 (m, 4), of each contact the sums of its sides' rows and columns, and its normal: sides
            up less those down, and right less left, as long as the straight line between its ends.
        wall: bool (rows, cols), occupied cells that are walls.
        walls: How far they are looked at.
    """
    for e in range(len(edges)):
        edge, up, right = edges[e], places[e, 2], places[e, 3]
        # one that runs along the rows or columns keeps what its sides have found, and so does a closed one
        if min(abs(up), abs(right)) <= ASKEW_SLOPE * max(abs(up), abs(right)):
            continue
        length, n = np.hypot(up, right), edge[EDGE.open]
        near = far = 0.0
        least = np.inf
        for sign in (-1.0, 1.0):
            step = (sign * right / length, -sign * up / length)
            r, c = places[e, 0] / n + 0.5 * length * step[0], places[e, 1] / n + 0.5 * length * step[1]
            share = _wall_ahead(wall, r, c, step, walls.near, walls.slack) / walls.near
            near, least = near + share, min(least, share)
            reach = max(walls.far - int(0.5 * length), 0)
            far += _wall_ahead(wall, r, c, step, reach, walls.slack) / (2 * walls.far + 1)
        edge[EDGE.near], edge[EDGE.near_min], edge[EDGE.far] = n * near, n * least, n * far


@njit(cache=True, nogil=True)
def contact_table(
    maps: RegionMaps, changes: Ints, gaps: Floats, walls: WallBits, lines: LineStrips, nodes: Floats
) -> tuple[Ints32, Floats]:
    """The ends and the rows of all contacts, as they are first met; adds their sides to the nodes.

    `changes` are the flat indices of `label_changes`, rising.
    """
    labels, spread, wall = maps.labels, maps.spread, maps.wall
    rows, cols = labels.shape
    # at most two contacts a change; grown arrays would be counted references in the loop
    ends = np.empty((2 * len(changes), 2), np.int32)
    edges, places = np.empty((2 * len(changes), len(EDGE))), np.empty((2 * len(changes), 4))
    slots = edge_slots(2 * len(changes))
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
                add_side(nodes, a, b, inside and wall[rr, cc])
                add_side(nodes, b, a, wall[r, c])
            if p == q or p == 0 or q == 0:
                continue
            low, high = min(p, q), max(p, q)
            # mostly the contact of the side before
            if e < 0 or ends[e, 0] != low or ends[e, 1] != high:
                slot = find_slot(low, high, ends, slots)
                e = slots[slot]
                if e < 0:
                    e = slots[slot] = m
                    m += 1
                    ends[e, 0], ends[e, 1] = low, high
                    edges[e], places[e] = 0.0, 0.0
            # regions that meet only once they are spread into a wall touch across it
            if a == 0 or b == 0:
                edges[e, EDGE.through] += 1
            else:
                side = Side(r, c, above)
                _add_contact(edges[e], side, maps, gaps, walls)
                _add_lines(edges[e], side, lines)
                if walls.slack >= 0:
                    places[e, 0] += r + 0.5 * above
                    places[e, 1] += c + 0.5 * (not above)
                    places[e, 2 if above else 3] += 1.0 if p < q else -1.0
    if walls.slack >= 0:
        _look_along(edges[:m], places, wall, walls)
    return ends[:m].copy(), edges[:m].copy()
