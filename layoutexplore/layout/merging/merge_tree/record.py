"""The tree of merges as it grows: what merges into what, and what each whole region is like by then."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Floats, Ints32
from layoutexplore.layout.merging.graph_tables import EDGE, NODE
from layoutexplore.layout.merging.merge_tree.contact_chains import Chains
from layoutexplore.layout.merging.pair_features import DOUBT, FEATURES, GraphTables, describe_pairs

LEAST_ODDS, LEAST_ALIKE = -20.0, -5.0
"""Log-odds that stand for "never": of a region without neighbours."""


class WholeFeatures(NamedTuple):
    """Columns of what a whole region is like when it comes to be.

    Attributes:
        log_area: Logarithm of the known free area [m2].
        fill: Its space over that of its bounding box.
        aspect: The box's shorter side over the longer one.
        radius: Largest distance to obstacles [m].
        length: Its space over that of the square around its largest free circle.
        unknown: Share of its sides towards unknown space.
        wall: Share towards walls.
        clutter: Share of its space with clutter.
        unseen: Share of its space that is neither free nor clutter.
        open: Sides in contact with other regions, over all sides.
        through: The same of contact across walls.
        door: Share of the open contact that lies in door gaps.
        line_near: Share of wall in line with the open contact, on the side that has less.
        widest_pass: Largest distance to obstacles on any contact [m].
        widest_pass_ratio: The same over the radius.
        longest_contact: Length of the longest open contact [m].
        neighbours: Regions that it is open to.
        best_odds: Largest log-odds of being one room with a neighbour.
        room_share: Share of its known cells in the room of the lines that has most of them.
        room_fit: Largest intersection over union with a room of the lines.
        room_entropy: Of its cells over the rooms of the lines [nat].
        alike: Mean log-odds that two of its squares, far from each other, share a room.
        alike_out: The largest mean of those of pairs with one square in a neighbour.
        border: Mean probability on its open contact that a room's border passes there.
        outside: Mean probability of its squares to lie in no room.
        ruggedness: Square of the sides over the space, 1 for a square.
    """

    log_area: int
    fill: int
    aspect: int
    radius: int
    length: int
    unknown: int
    wall: int
    clutter: int
    unseen: int
    open: int
    through: int
    door: int
    line_near: int
    widest_pass: int
    widest_pass_ratio: int
    longest_contact: int
    neighbours: int
    best_odds: int
    room_share: int
    room_fit: int
    room_entropy: int
    alike: int
    alike_out: int
    border: int
    outside: int
    ruggedness: int


W = WholeFeatures(*range(len(WholeFeatures._fields)))
"""The index of each column, constants to the compiler."""


class TreeRecord(NamedTuple):
    """Takes the tree of `n` regions (the first is none) and all that come of them; empty to record nothing.

    Attributes:
        low: Beyond the level of the fixed merging the tree grows while the log-odds are at least this.
        node: int32 (n,), node of the tree that each region has become.
        children: int32 (2 n, 2), the two nodes that became one; -1 for regions.
        odds: float64 (2 n,), log-odds by which they merged.
        wholes: float64 (2 n, columns of `WholeFeatures`).
        pairs: float64 (2 n, `PairFeatures`), of the two before they merged.
    """

    low: float
    node: Ints32
    children: Ints32
    odds: Floats
    wholes: Floats
    pairs: Floats


def empty_record(regions: int = 0, low: float = np.inf) -> TreeRecord:
    """A record for so many regions, of which the first is none."""
    return TreeRecord(
        low,
        np.arange(regions).astype(np.int32),
        np.full((2 * regions, 2), -1, np.int32),
        np.zeros(2 * regions),
        np.zeros((2 * regions, len(W))),
        np.zeros((2 * regions, len(FEATURES))),
    )


@njit(cache=True, nogil=True)
def _describe_shape(node: Floats, resolution: float, out: Floats) -> None:
    """What a region is like by itself."""
    sides, space = max(node[NODE.sides], 1.0), max(node[NODE.space], 1.0)
    height = max(node[NODE.row1] - node[NODE.row0], 1.0)
    width = max(node[NODE.col1] - node[NODE.col0], 1.0)
    out[W.log_area] = np.log(max(node[NODE.area], 1.0) * resolution**2)
    out[W.fill] = space / (height * width)
    out[W.aspect] = min(height, width) / max(height, width)
    out[W.radius] = node[NODE.peak] * resolution
    out[W.length] = space / (4 * node[NODE.peak] ** 2 + 1)
    out[W.unknown] = node[NODE.open_end] / sides
    out[W.wall] = node[NODE.wall_sides] / sides
    out[W.clutter] = node[NODE.clutter] / space
    out[W.unseen] = 1 - (node[NODE.area] + node[NODE.clutter]) / space
    out[W.alike] = node[NODE.alike] / (node[NODE.pairs] + DOUBT)
    out[W.outside] = node[NODE.outside] / max(node[NODE.squares], 1.0)
    out[W.ruggedness] = sides**2 / (16 * space)


@njit(cache=True, nogil=True)
def _describe_rooms(rooms: Floats, size: Floats, out: Floats) -> None:
    """What the rooms of the lines say of a region; `size` (r + 1,) is each room's."""
    total = max(rooms.sum(), 1.0)
    share = fit = entropy = 0.0
    # column 0 is no room: cells in none lower the share
    for k in range(1, len(rooms)):
        if rooms[k] > 0:
            part = rooms[k] / total
            share = max(share, part)
            fit = max(fit, rooms[k] / (total + size[k] - rooms[k]))
            entropy -= part * np.log(part)
    out[W.room_share], out[W.room_fit], out[W.room_entropy] = share, fit, entropy


@njit(cache=True, nogil=True)
def _describe_border(
    region: int, node: Floats, edges: Floats, chains: Chains, odds: Floats, resolution: float, out: Floats
) -> None:
    """What lies between a region and its neighbours."""
    opened = through = door = near = widest = longest = border = 0.0
    neighbours, best, alike = 0, LEAST_ODDS, LEAST_ALIKE
    h = chains.first[region]
    while h >= 0:
        e = h // 2
        if not chains.dead[e]:
            opened += edges[e, EDGE.open]
            through += edges[e, EDGE.through]
            door += edges[e, EDGE.door]
            near += edges[e, EDGE.near_min]
            border += edges[e, EDGE.border]
            widest = max(widest, edges[e, EDGE.clearance])
            longest = max(longest, edges[e, EDGE.open])
            # contacts across walls only have no odds: nobody asks about them
            if edges[e, EDGE.open] > 0:
                neighbours += 1
                best = max(best, odds[e])
                alike = max(alike, edges[e, EDGE.alike_far] / (edges[e, EDGE.pairs_far] + DOUBT))
        h = chains.links[h]
    sides = max(node[NODE.sides], 1.0)
    out[W.open], out[W.through] = opened / sides, through / sides
    out[W.door], out[W.line_near] = door / max(opened, 1.0), near / max(opened, 1.0)
    out[W.widest_pass] = widest * resolution
    out[W.widest_pass_ratio] = widest / max(node[NODE.peak], 0.5)
    out[W.longest_contact] = longest * resolution
    out[W.neighbours], out[W.best_odds] = neighbours, best
    out[W.border], out[W.alike_out] = border / max(opened, 1.0), alike


@njit(cache=True, nogil=True)
def record_wholes(
    record: TreeRecord,
    begin: int,
    end: int,
    tables: GraphTables,
    chains: Chains,
    odds: Floats,
    size: Floats,
    resolution: float,
) -> None:
    """Describe the regions `begin` to `end`, as they are now; `odds` are those of all contacts."""
    for k in range(begin, end):
        row, node = record.wholes[record.node[k]], tables.nodes[k]
        _describe_shape(node, resolution, row)
        _describe_rooms(tables.rooms[k], size, row)
        _describe_border(k, node, tables.edges, chains, odds, resolution, row)


@njit(cache=True, nogil=True)
def record_merge(
    record: TreeRecord,
    contact: int,
    new: int,
    odds: float,
    ends: Ints32,
    tables: GraphTables,
    size: Floats,
    resolution: float,
) -> None:
    """The two regions of a contact become node `new`: to be called before they do."""
    a, b = ends[contact, 0], ends[contact, 1]
    describe_pairs(np.full(1, contact, np.int32), ends, tables, resolution, size, record.pairs[new : new + 1])
    record.children[new, 0], record.children[new, 1] = record.node[a], record.node[b]
    record.odds[new] = odds
    record.node[a] = new
