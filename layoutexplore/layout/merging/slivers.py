"""Slivers join a neighbour before any pair is classified: most basins of a noisy map are slivers.

A sliver lies between furniture or along a rough wall. It joins the neighbour it opens to most widely, the
smallest sliver first; one that is open to nothing is left out. On mapped buildings this loses none of what
merging the regions by the truth would reach, and leaves the classifier a third of the pairs, all of which
matter.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Floats, Ints32
from layoutexplore.grids.components import root_of
from layoutexplore.layout.merging.graph_tables import (
    EDGE,
    NODE,
    HalfEdges,
    RegionGraph,
    add_edge,
    add_node,
    edge_slots,
    enclose_edge,
    find_slot,
    half_edges,
)


@njit(cache=True, nogil=True)
def _widest_neighbour(
    k: int, parent: Ints32, ends: Ints32, edges: Floats, halves: HalfEdges, contact: Floats, near: Ints32
) -> int:
    """The region that one opens to most widely, of equal ones over most sides, then the first met; 0 if none.

    `contact` (k + 1, columns of `EDGE`) is zero between calls; `near` takes the neighbours.
    """
    n = 0
    h = halves.first[k]
    while h >= 0:
        other = root_of(parent, ends[h // 2, 1 - h % 2])
        edge = edges[h // 2]
        if other != k:
            if contact[other, EDGE.open] == 0:
                near[n] = other
                n += 1
            add_edge(contact[other], edge)
        h = halves.links[h]
    best, best_pass, best_sides = 0, -1.0, -1.0
    for other in near[:n]:
        sides, through = contact[other, EDGE.open], contact[other, EDGE.clearance]
        # what lies behind a door gap is rather another room
        if contact[other, EDGE.door] > 0.5 * sides:
            through *= 0.5
        if through > best_pass or (through == best_pass and sides > best_sides):
            best, best_pass, best_sides = other, through, sides
        contact[other] = 0.0
    return best


@njit(cache=True, nogil=True)
def _unite(nodes: Floats, ends: Ints32, edges: Floats, limit: float) -> Ints32:
    """The region each region ends up in, 0 for a sliver that is open to nothing."""
    count = len(nodes)
    parent = np.arange(count).astype(np.int32)
    halves = half_edges(ends, edges[:, EDGE.open] > 0, count)
    space = nodes[:, NODE.space].copy()
    contact, near = np.zeros((count, len(EDGE))), np.empty(count, np.int32)
    # the smallest first, of equal ones the first; one that has grown to the limit stays
    for k in np.argsort(nodes[:, NODE.space], kind="mergesort"):
        if k == 0 or space[k] >= limit:
            continue
        best = _widest_neighbour(k, parent, ends, edges, halves, contact, near)
        # the neighbour takes over the sliver's half-edges: one chain is hung to the other's end
        if best > 0:
            parent[k] = best
            space[best] += space[k]
            halves.links[halves.last[best]] = halves.first[k]
            halves.last[best] = halves.last[k]
    into = np.zeros(count, np.int32)
    for k in range(1, count):
        root = root_of(parent, k)
        into[k] = root if space[root] >= limit or _is_open(root, parent, ends, halves) else 0
    return into


@njit(cache=True, nogil=True)
def _is_open(k: int, parent: Ints32, ends: Ints32, halves: HalfEdges) -> bool:
    """Whether a region is open to another one than itself."""
    h = halves.first[k]
    while h >= 0:
        if root_of(parent, ends[h // 2, 1 - h % 2]) != k:
            return True
        h = halves.links[h]
    return False


@njit(cache=True, nogil=True)
def _coarsen(nodes: Floats, ends: Ints32, edges: Floats, into: Ints32) -> tuple[Floats, Ints32, Floats]:
    """Add up nodes and edges; numbers `into` from 1 without gaps, in place, 0 for what is left out."""
    # only a region that stands for others ends up in itself
    count = 1
    number = np.zeros(len(nodes), np.int32)
    for k in range(1, len(nodes)):
        if into[k] == k:
            number[k] = count
            count += 1
    out = np.zeros((count, len(NODE)))
    for k in range(1, len(nodes)):
        whole = into[k]
        into[k] = number[whole]
        if into[k] == 0:
            continue
        # the bounding box of an empty row is no box to widen
        if out[into[k], NODE.space] == 0:
            out[into[k]] = nodes[k]
        else:
            add_node(out[into[k]], nodes[k])
    new_ends = np.empty((len(ends), 2), np.int32)
    new_edges = np.zeros((len(ends), len(EDGE)))
    slots = edge_slots(len(ends))
    m = 0
    for e in range(len(ends)):
        a, b = into[ends[e, 0]], into[ends[e, 1]]
        # sides between two that are one now were counted by both
        if a == b:
            enclose_edge(out[a], edges[e])
        if a == b or a == 0 or b == 0:
            continue
        low, high = min(a, b), max(a, b)
        slot = find_slot(low, high, new_ends, slots)
        f = slots[slot]
        if f < 0:
            f = slots[slot] = m
            m += 1
            new_ends[f, 0], new_ends[f, 1] = low, high
        add_edge(new_edges[f], edges[e])
    out[0] = 0.0
    return out, new_ends[:m].copy(), new_edges[:m].copy()


def absorb_slivers(graph: RegionGraph, area: float) -> tuple[RegionGraph, Ints32]:
    """Let small regions join their widest neighbour.

    Args:
        graph: The regions; not changed.
        area: Regions with less space are slivers [m2].

    Returns:
        The graph of what is left, and int32 (k + 1,), its region that each region belongs to, 0 for none.
    """
    into = _unite(graph.nodes, graph.ends, graph.edges, area / graph.resolution**2)
    nodes, ends, edges = _coarsen(graph.nodes, graph.ends, graph.edges, into)
    rooms = np.zeros((len(nodes), graph.rooms.shape[1]))
    np.add.at(rooms, into, graph.rooms)
    rooms[0] = 0.0
    return RegionGraph(nodes, ends, edges, rooms, graph.resolution), into
