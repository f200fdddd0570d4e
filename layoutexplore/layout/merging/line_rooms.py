"""The rooms of the lines fall apart where the regions in them do.

Lines without a wall seen between them leave two rooms in one: a wall that was never looked at, or one that
furniture hides. ROSE2 splits a room whose topological graph is not connected inside it (section III-D). Here
the graph is that of the regions: those that lie mostly in one room of the lines stay together only as far as
wide passes between them reach.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Floats, Ints32
from layoutexplore.grids.components import join, root_of
from layoutexplore.layout.merging.graph_tables import EDGE, NODE, RegionGraph


@njit(cache=True, nogil=True)
def _split(nodes: Floats, ends: Ints32, edges: Floats, rooms: Floats, share: float) -> Floats:
    """The table of rooms (k + 1, parts + 1), a column for each part that wide passes hold together."""
    count = len(nodes)
    # the room most of a region lies in; 0 for none, and of equal ones the first
    own = np.empty(count, np.int64)
    for k in range(count):
        own[k] = rooms[k].argmax()
    parent = np.arange(count).astype(np.int32)
    for e in range(len(ends)):
        a, b = ends[e, 0], ends[e, 1]
        if (
            own[a] == own[b]
            and edges[e, EDGE.open] > 0
            and edges[e, EDGE.clearance] >= share * min(nodes[a, NODE.peak], nodes[b, NODE.peak])
        ):
            join(parent, a, b)
    column = np.zeros(count, np.int64)
    parts = 0
    for k in range(1, count):
        # no member of a set comes before the one that stands for it: parts are numbered by first region
        root = root_of(parent, k)
        if own[k] > 0 and root == k:
            parts += 1
            column[k] = parts
        else:
            column[k] = column[root]
    out = np.zeros((count, parts + 1))
    for k in range(1, count):
        for room in range(rooms.shape[1]):
            out[k, column[k] if room == own[k] else 0] += rooms[k, room]
    return out


def split_line_rooms(graph: RegionGraph, share: float) -> RegionGraph:
    """Part the rooms of the lines where no wide pass connects the regions in them.

    Args:
        graph: The regions; not changed.
        share: A pass is wide if it is at least this share of the smaller of the two regions' largest
            distances to obstacles.

    Returns:
        The graph with other `rooms`: each region counts for the part of the room it mostly lies in, its other
            cells in none.
    """
    return replace(graph, rooms=_split(graph.nodes, graph.ends, graph.edges, graph.rooms, share))
