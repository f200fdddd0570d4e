"""Regions merge into rooms, the surest pair first, as a forest of trees says from readable features."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Floats, Ints32, Mask
from layoutexplore.grids.components import root_of
from layoutexplore.layout.merging.graph_tables import EDGE, NODE, RegionGraph, add_edge, add_node
from layoutexplore.layout.merging.pair_features import FEATURES, GraphTables, describe_map, describe_pairs
from layoutexplore.models.forest import Forest, Numbers, log_odds

FEATURE_COUNT = len(FEATURES)


class Rest(NamedTuple):
    """What is too small for a room joins the neighbour it most likely belongs to.

    Attributes:
        small: What is smaller than this always does [m2].
        nook: What is smaller than this does [m2] ...
        level: ... while the log-odds are at least this.
    """

    small: float = 0.0
    nook: float = 0.0
    level: float = 0.0


NO_REST = Rest()


@njit(cache=True, nogil=True)
def _same_room(a: Floats, b: Floats) -> bool:
    """Whether most of two regions lies in one true room."""
    return int(a.argmax()) == int(b.argmax())


@njit(cache=True, nogil=True)
def _add_sample(x: Floats, a: Floats, b: Floats, sample: Floats) -> None:
    """Write features, answer and weight of a pair of regions, given what each has in the true rooms.

    Room 0 is none: two regions in no room are one, but that teaches little.
    """
    sample[:FEATURE_COUNT] = x
    sample[FEATURE_COUNT] = 1.0 if _same_room(a, b) else 0.0
    ra, rb = a.argmax(), b.argmax()
    pure = min(a[ra] / max(a.sum(), 1.0), b[rb] / max(b.sum(), 1.0))
    sample[FEATURE_COUNT + 1] = pure * (0.2 if ra == 0 and rb == 0 else 1.0)


@njit(cache=True, nogil=True)
def _unite(best: int, ends: Ints32, tables: GraphTables) -> None:
    """Add the second region of a contact to the first one."""
    a, b = ends[best, 0], ends[best, 1]
    add_node(tables.nodes[a], tables.nodes[b])
    # both regions counted the sides between them
    tables.nodes[a, NODE.sides] -= 2 * tables.edges[best, EDGE.open]
    tables.rooms[a] += tables.rooms[b]


@njit(cache=True, nogil=True)
def _move_contacts(a: int, b: int, ends: Ints32, edges: Floats, slots: Ints32, gone: Mask) -> None:
    """Give the contacts of region b to region a, adding up those with one neighbour."""
    slots[a, b] = slots[b, a] = -1
    for n in range(1, len(slots)):
        f = slots[b, n]
        if f < 0:
            continue
        slots[b, n] = slots[n, b] = -1
        g = slots[a, n]
        # a neighbour of b alone keeps its row, now with a; one of both loses it
        if g < 0:
            ends[f, 0], ends[f, 1] = min(a, n), max(a, n)
            slots[a, n] = slots[n, a] = f
        else:
            add_edge(edges[g], edges[f])
            gone[f] = True


@njit(cache=True, nogil=True)
def _stale_contacts(a: int, edges: Floats, slots: Ints32, gone: Mask, out: Ints32) -> int:
    """Write the contacts of region a that are to be asked about again to `out`, rising, and return how many.

    Those that were refused before region a grew are among them.
    """
    count = 0
    for n in range(1, len(slots)):
        f = slots[a, n]
        if f >= 0 and edges[f, EDGE.open] > 0:
            gone[f] = False
            out[count] = f
            count += 1
    out[:count].sort()
    return count


@njit(cache=True, nogil=True)
def _surest(odds: Floats, gone: Mask) -> int:
    """The first of the contacts with the highest odds, -1 when all are gone.

    A plain search: a heap would have to forget the odds of every contact that moves.
    """
    best, best_odds = -1, -1e9
    for e in range(len(odds)):
        if not gone[e] and odds[e] > best_odds:
            best, best_odds = e, odds[e]
    return best


@njit(cache=True, nogil=True)
def _surest_of_rest(odds: Floats, gone: Mask, ends: Ints32, nodes: Floats, rest: Rest) -> int:
    """The same among the contacts of regions that are too small (areas in cells)."""
    best, best_odds = -1, -1e9
    for e in range(len(odds)):
        if not gone[e] and odds[e] > best_odds:
            area = min(nodes[ends[e, 0], NODE.area], nodes[ends[e, 1], NODE.area])
            if area < rest.small or (area < rest.nook and odds[e] >= rest.level):
                best, best_odds = e, odds[e]
    return best


@njit(cache=True, nogil=True)
def _slots(ends: Ints32, count: int) -> Ints32:
    """int32 (count, count): row of the contact of two regions, -1 for none."""
    slots = np.full((count, count), -1, np.int32)
    for e in range(len(ends)):
        slots[ends[e, 0], ends[e, 1]] = slots[ends[e, 1], ends[e, 0]] = e
    return slots


@njit(cache=True, nogil=True)
def _agglomerate(
    ends: Ints32,
    tables: GraphTables,
    resolution: float,
    forest: Numbers,
    level: float,
    rest: Rest,
    truth: Floats,
    samples: Floats,
) -> tuple[Ints32, int]:
    """Merge in place; with `truth` (k + 1, rooms + 1) only where it is right, each pair asked about a sample.

    Returns the region that each one ends up in, and how many samples were written.
    """
    nodes, edges = tables.nodes, tables.edges
    count = len(nodes)
    into = np.arange(count).astype(np.int32)
    learning = truth.shape[0] > 0
    slots = _slots(ends, count)
    odds = np.full(len(ends), -1e9)
    # contacts across walls only never merge by themselves, but add up
    gone = edges[:, EDGE.open] <= 0
    # the first rows of `stale` are to be asked about: all at first, then those of the region that grew
    stale = np.flatnonzero(~gone).astype(np.int32)
    stale_count = len(stale)
    stale = np.concatenate((stale, np.empty(count, np.int32)))
    x, asked = np.empty((len(stale), FEATURE_COUNT)), np.empty(len(stale))
    describe_map(nodes, resolution, x)
    size = tables.rooms.sum(axis=0)
    written = 0
    while True:
        fresh = stale[:stale_count]
        describe_pairs(fresh, ends, tables, resolution, size, x)
        log_odds(x, forest, asked[:stale_count])
        for n in range(stale_count):
            odds[fresh[n]] = asked[n]
            if learning and written < len(samples):
                _add_sample(x[n], truth[ends[fresh[n], 0]], truth[ends[fresh[n], 1]], samples[written])
                written += 1
        stale_count = 0
        best = _surest(odds, gone)
        if not learning and best >= 0 and odds[best] < level:
            best = _surest_of_rest(odds, gone, ends, nodes, rest)
        if best < 0:
            break
        a, b = ends[best, 0], ends[best, 1]
        gone[best] = True
        if learning:
            # a wrong pair is not asked about again until one of the two grows
            if not _same_room(truth[a], truth[b]):
                continue
            truth[a] += truth[b]
        into[b] = a
        _unite(best, ends, tables)
        _move_contacts(a, b, ends, edges, slots, gone)
        stale_count = _stale_contacts(a, edges, slots, gone, stale)
    for k in range(count):
        into[k] = root_of(into, k)
    return into, written


def merge_regions(graph: RegionGraph, forest: Forest, *, level: float = 0.0, rest: Rest = NO_REST) -> Ints32:
    """Which regions become one.

    Args:
        graph: The regions; not changed.
        forest: The classifier.
        level: Merge while the log-odds of the surest pair are at least this.
        rest: What is too small to stay by itself then.

    Returns:
        int32 (k + 1,), the region that each region is merged into (itself for the first of each room).
    """
    nothing, cell = np.zeros((0, 0)), graph.resolution**2
    rest = Rest(rest.small / cell, rest.nook / cell, rest.level)
    into, _ = _agglomerate(
        graph.ends.copy(), _tables(graph), graph.resolution, forest.numbers, level, rest, nothing, nothing
    )
    return into


def _tables(graph: RegionGraph) -> GraphTables:
    """Copies of the nodes, edges and rooms of a graph."""
    return GraphTables(graph.nodes.copy(), graph.edges.copy(), graph.rooms.copy())


def training_samples(graph: RegionGraph, forest: Forest, rooms: Floats) -> Floats:
    """Samples for training: merge as the forest would, but only where it is right.

    Args:
        graph: The regions; not changed.
        forest: The classifier that gives the order.
        rooms: float64 (k + 1, rooms + 1), known free cells of each region in each true room; column 0: in
            none.

    Returns:
        float64 (n, features + 2): the features of a pair, 1 where both belong to one room, and the sample's
        weight; the first look at each pair and as many of the later ones, evenly spaced.
    """
    pairs = len(graph.ends)
    samples = np.zeros((min(80 * pairs + 100, 400_000), FEATURE_COUNT + 2))
    tables, truth = _tables(graph), rooms.copy()
    _, n = _agglomerate(
        graph.ends.copy(), tables, graph.resolution, forest.numbers, 0.0, NO_REST, truth, samples
    )
    later = np.linspace(pairs, n - 1, min(pairs, max(n - pairs, 0))).astype(np.int64)
    chosen = np.concatenate([np.arange(min(pairs, n)), later])
    return np.asarray(samples[chosen])
