"""The region adjacency graph as tables: a row for each region (superpixel), a row for each contact of two.

All counts are in cells or sides of cells, so that the rows of regions and contacts can be added up when
regions merge. Columns are addressed by name: `nodes[k, NODE.area]`, `edges[e, EDGE.door]`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Floats, Ints32, Mask


class NodeColumns(NamedTuple):
    """Columns of the table of regions.

    Attributes:
        area: Known free cells.
        space: All cells.
        clutter: Cells with obstacles that are no walls.
        sides: Sides shared with anything else.
        open_end: Those towards unknown space.
        wall_sides: Those towards walls.
        row0: First row of the bounding box.
        row1: Row behind its last.
        col0: Its first column.
        col1: Column behind its last.
        peak: Largest distance to the obstacles' edges [cells].
        squares: Squares of the separator network.
        outside: Sum of their probabilities to lie in no room.
        alike: Sum of the log-odds that pairs of squares in it, far from each other, share a room.
        pairs: Those pairs.
    """

    area: int
    space: int
    clutter: int
    sides: int
    open_end: int
    wall_sides: int
    row0: int
    row1: int
    col0: int
    col1: int
    peak: int
    squares: int
    outside: int
    alike: int
    pairs: int


class EdgeColumns(NamedTuple):
    """Columns of the table of contacts.

    Attributes:
        open: Sides in direct contact.
        across_rows: Those between two rows.
        door: Those in a door gap.
        width: Sum of the widths of these gaps [m].
        long: Sum of the longer runs of wall beside them [m].
        short: Sum of the shorter runs [m].
        clearance: Largest distance to the obstacles on the contact [cells].
        near: Sum of the share of wall in line with the contact, near it.
        near_min: Sum of that share on the side that has less.
        far: Sum of that share, farther out.
        through: Contact across a wall.
        parted: Sides near which lies an edge between two faces of the representative lines.
        covered: Sum of the covered shares of these edges.
        apart: Sides near which two rooms of the lines meet.
        seen: Sides between two known free cells.
        border: Sum of the probabilities that a room's border passes there.
        alike_near: Sum of the log-odds that pairs of squares near to each other, one in each, share a room.
        pairs_near: Those pairs.
        alike_far: The same of pairs far from each other.
        pairs_far: Those pairs.
    """

    open: int
    across_rows: int
    door: int
    width: int
    long: int
    short: int
    clearance: int
    near: int
    near_min: int
    far: int
    through: int
    parted: int
    covered: int
    apart: int
    seen: int
    border: int
    alike_near: int
    pairs_near: int
    alike_far: int
    pairs_far: int


NODE = NodeColumns(*range(len(NodeColumns._fields)))
EDGE = EdgeColumns(*range(len(EdgeColumns._fields)))
"""The index of each column, constants to the compiler."""


@dataclass(frozen=True, eq=False)
class RegionGraph:
    """Regions and their contacts.

    Attributes:
        nodes: float64 (k + 1, columns of `NODE`), row 0 is empty.
        ends: int32 (m, 2), the two regions of each contact, the lower first.
        edges: float64 (m, columns of `EDGE`).
        rooms: float64 (k + 1, r + 1), known free cells of each region in each room of the lines, column 0 in
            none.
        resolution: Metres a cell.
    """

    nodes: Floats
    ends: Ints32
    edges: Floats
    rooms: Floats
    resolution: float


@njit(cache=True, nogil=True)
def add_node(whole: Floats, part: Floats) -> None:
    """Add a region to another one (rows of the table); the sides between them still count."""
    for column in (NODE.area, NODE.space, NODE.clutter, NODE.sides, NODE.open_end, NODE.wall_sides):
        whole[column] += part[column]
    for column in (NODE.squares, NODE.outside, NODE.alike, NODE.pairs):
        whole[column] += part[column]
    whole[NODE.row0] = min(whole[NODE.row0], part[NODE.row0])
    whole[NODE.col0] = min(whole[NODE.col0], part[NODE.col0])
    whole[NODE.row1] = max(whole[NODE.row1], part[NODE.row1])
    whole[NODE.col1] = max(whole[NODE.col1], part[NODE.col1])
    whole[NODE.peak] = max(whole[NODE.peak], part[NODE.peak])


@njit(cache=True, nogil=True)
def enclose_edge(whole: Floats, edge: Floats) -> None:
    """A contact lies within a region now: both of its ends had counted its sides, none its pairs."""
    whole[NODE.sides] -= 2 * edge[EDGE.open]
    whole[NODE.alike] += edge[EDGE.alike_far]
    whole[NODE.pairs] += edge[EDGE.pairs_far]


@njit(cache=True, nogil=True)
def add_edge(whole: Floats, part: Floats) -> None:
    """Add a contact to another one between the same two regions (rows of the table)."""
    widest = max(whole[EDGE.clearance], part[EDGE.clearance])
    whole += part
    # the only column that is no sum
    whole[EDGE.clearance] = widest


@njit(cache=True, nogil=True)
def edge_slots(most: int) -> Ints32:
    """An empty hash table for at most so many contacts: int32 of a power of two, at least half of it free."""
    size = 16
    while size < 2 * most:
        size *= 2
    return np.full(size, -1, np.int32)


@njit(cache=True, nogil=True)
def find_slot(a: int, b: int, ends: Ints32, slots: Ints32) -> int:
    """Where the row of contact (a, b) stands in the hash table, or has to be written: `slots` is -1 there."""
    mask = len(slots) - 1
    slot = (a * 73856093 ^ b * 19349663) & mask
    # a table that is never full has a free place behind every contact
    while slots[slot] >= 0 and (ends[slots[slot], 0] != a or ends[slots[slot], 1] != b):
        slot = (slot + 1) & mask
    return int(slot)


class HalfEdges(NamedTuple):
    """Chains of the half-edges that start at one region, in the order of the contacts; -1 ends a chain.

    Half-edge 2 e starts at the first end of contact e, 2 e + 1 at its second.

    Attributes:
        first: int32 (k + 1,), of each region's chain.
        last: int32 (k + 1,), of each region's chain.
        links: int32 (2 m,), the half-edge behind each.
    """

    first: Ints32
    last: Ints32
    links: Ints32


@njit(cache=True, nogil=True)
def half_edges(ends: Ints32, wanted: Mask, count: int) -> HalfEdges:
    """The chains of `count` regions, of those contacts that are wanted, bool (m,)."""
    first, last = np.full(count, -1, np.int32), np.full(count, -1, np.int32)
    links = np.full(2 * len(ends), -1, np.int32)
    for h in range(2 * len(ends)):
        if wanted[h // 2]:
            k = ends[h // 2, h % 2]
            if first[k] < 0:
                first[k] = h
            else:
                links[last[k]] = h
            last[k] = h
    return HalfEdges(first, last, links)
