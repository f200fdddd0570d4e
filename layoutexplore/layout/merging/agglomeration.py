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

BLOCK = 4096
"""The classifier is asked about at most so many pairs at once."""


class Rest(NamedTuple):
    """What is too small for a room joins the neighbour it most likely belongs to.

    Attributes:
        small: What is smaller than this always does [m2].
        nook: What is smaller than this does [m2] ...
        level: ... while the log-odds are at least this.
        questions: When the classifier has been asked about so many pairs, merging ends.
    """

    small: float = 0.0
    nook: float = 0.0
    level: float = 0.0
    questions: int = 2**60


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


class Contest(NamedTuple):
    """The contacts that may merge next, in trees whose node 1 is the surest, of equal ones the first.

    A tree is an array: node n has the children 2 n and 2 n + 1, the leaves are the contacts, -1 is nobody.

    Attributes:
        odds: float64 (m,), of each contact.
        gone: bool (m,), contacts that are not to be merged as things are.
        surest: int32, tree of the contacts that are not gone.
        rest: int32, tree of those of them that have a region too small to stay by itself.
    """

    odds: Floats
    gone: Mask
    surest: Ints32
    rest: Ints32


@njit(cache=True, nogil=True)
def _contest(edges: Floats) -> Contest:
    """One without entries; contacts across walls only never merge by themselves, but add up."""
    size = 1
    while size < len(edges):
        size *= 2
    return Contest(
        np.full(len(edges), -1e9),
        edges[:, EDGE.open] <= 0,
        np.full(2 * size, -1, np.int32),
        np.full(2 * size, -1, np.int32),
    )


@njit(cache=True, nogil=True)
def _play(tree: Ints32, odds: Floats, e: int, takes_part: bool) -> None:
    """Enter contact e, or take it out, and play its matches again."""
    node = len(tree) // 2 + e
    tree[node] = e if takes_part else -1
    node //= 2
    while node >= 1:
        one, other = tree[2 * node], tree[2 * node + 1]
        # of equal ones the left child wins, which has the lower indices
        tree[node] = one if other < 0 or (one >= 0 and odds[one] >= odds[other]) else other
        node //= 2


@njit(cache=True, nogil=True)
def _drop(contest: Contest, e: int) -> None:
    """Contact e is gone."""
    contest.gone[e] = True
    _play(contest.surest, contest.odds, e, False)
    _play(contest.rest, contest.odds, e, False)


@njit(cache=True, nogil=True)
def _enter(contest: Contest, e: int, odds: float, area: float, rest: Rest) -> None:
    """Enter contact e; the smaller of its regions has this many cells, and so are the areas of `rest`."""
    contest.odds[e] = odds
    _play(contest.surest, contest.odds, e, True)
    small = area < rest.small or (area < rest.nook and odds >= rest.level)
    _play(contest.rest, contest.odds, e, small)


class Chains(NamedTuple):
    """The contacts of each region, as chains of half-edges: 2 e and 2 e + 1 are contact e at its two ends.

    Attributes:
        first: int32 (k + 1,), of each region's chain, -1 for none.
        last: int32 (k + 1,), of each region's chain.
        links: int32 (2 m,), the half-edge behind each, -1 for none.
        dead: bool (m,), contacts that are no more: they are taken from a chain when it is followed.
        at: int32 (k + 1,), row of the contact with each region while two chains are compared, else -1.
    """

    first: Ints32
    last: Ints32
    links: Ints32
    dead: Mask
    at: Ints32


@njit(cache=True, nogil=True)
def _chains(ends: Ints32, count: int) -> Chains:
    """The chains of `count` regions."""
    first, last = np.full(count, -1, np.int32), np.full(count, -1, np.int32)
    links = np.full(2 * len(ends), -1, np.int32)
    for h in range(2 * len(ends)):
        k = ends[h // 2, h % 2]
        if first[k] < 0:
            first[k] = h
        else:
            links[last[k]] = h
        last[k] = h
    return Chains(first, last, links, np.zeros(len(ends), np.bool_), np.full(count, -1, np.int32))


@njit(cache=True, nogil=True)
def _mark(a: int, ends: Ints32, chains: Chains, clear: bool) -> None:
    """Write the contacts of region a to `at`, or -1 where they stand; dead ones leave the chain."""
    before, h = -1, chains.first[a]
    while h >= 0:
        e, behind = h // 2, chains.links[h]
        if chains.dead[e]:
            if before < 0:
                chains.first[a] = behind
            else:
                chains.links[before] = behind
        else:
            chains.at[ends[e, 0] + ends[e, 1] - a] = -1 if clear else e
            before = h
        h = behind
    chains.last[a] = before


@njit(cache=True, nogil=True)
def _move_contacts(a: int, b: int, ends: Ints32, edges: Floats, chains: Chains, contest: Contest) -> None:
    """Give the contacts of region b to region a, adding up those with one neighbour."""
    _mark(a, ends, chains, False)
    chains.dead[chains.at[b]] = True
    h = chains.first[b]
    while h >= 0:
        f = h // 2
        if not chains.dead[f]:
            n = ends[f, 0] + ends[f, 1] - b
            g = chains.at[n]
            # a neighbour of b alone keeps its row, now with a; one of both loses it
            if g < 0:
                ends[f, 0], ends[f, 1] = min(a, n), max(a, n)
                chains.at[n] = f
            else:
                add_edge(edges[g], edges[f])
                chains.dead[f] = True
                _drop(contest, f)
        h = chains.links[h]
    chains.at[b] = -1
    if chains.first[b] >= 0:
        if chains.last[a] < 0:
            chains.first[a] = chains.first[b]
        else:
            chains.links[chains.last[a]] = chains.first[b]
        chains.last[a] = chains.last[b]
    _mark(a, ends, chains, True)


@njit(cache=True, nogil=True)
def _stale_contacts(a: int, edges: Floats, chains: Chains, gone: Mask, out: Ints32) -> int:
    """Write the contacts of region a that are to be asked about again to `out`; returns how many."""
    count = 0
    h = chains.first[a]
    while h >= 0:
        f = h // 2
        if not chains.dead[f] and edges[f, EDGE.open] > 0:
            gone[f] = False
            out[count] = f
            count += 1
        h = chains.links[h]
    return count


class Samples(NamedTuple):
    """What is noted while merging by the truth, else empty.

    Attributes:
        truth: float64 (k + 1, rooms + 1), known free cells of each region in each true room; changed.
        rows: float64 (n, features + 2), takes the samples.
    """

    truth: Floats
    rows: Floats


class Asking(NamedTuple):
    """What a pair of regions is asked about with, and where the answers go.

    Attributes:
        resolution: Metres a cell.
        forest: The classifier.
        rest: What is too small (areas in cells).
        size: float64 (r + 1,), known free cells in each room of the lines.
        features: float64 (n, features), of as many pairs as are asked about at once.
        odds: float64 (n,), their log-odds.
    """

    resolution: float
    forest: Numbers
    rest: Rest
    size: Floats
    features: Floats
    odds: Floats


@njit(cache=True, nogil=True)
def _enter_all(
    stale: Ints32,
    ends: Ints32,
    tables: GraphTables,
    asking: Asking,
    contest: Contest,
    samples: Samples,
    n: int,
) -> int:
    """Ask about contacts and enter them; samples go to row n and those behind. Returns the row after them."""
    x, nodes = asking.features, tables.nodes
    for begin in range(0, len(stale), len(x)):
        fresh = stale[begin : begin + len(x)]
        describe_pairs(fresh, ends, tables, asking.resolution, asking.size, x)
        log_odds(x, asking.forest, asking.odds[: len(fresh)])
        for k in range(len(fresh)):
            e = fresh[k]
            a, b = ends[e, 0], ends[e, 1]
            area = min(nodes[a, NODE.area], nodes[b, NODE.area])
            _enter(contest, e, asking.odds[k], area, asking.rest)
            if n < len(samples.rows):
                _add_sample(x[k], samples.truth[a], samples.truth[b], samples.rows[n])
                n += 1
    return n


@njit(cache=True, nogil=True)
def _agglomerate(
    ends: Ints32, tables: GraphTables, asking: Asking, level: float, samples: Samples
) -> tuple[Ints32, int, bool]:
    """Merge in place; with a truth only where it is right, each pair asked about a sample.

    Returns the region that each one ends up in, the samples written, and whether the questions have sufficed.
    """
    truth, count = samples.truth, len(tables.nodes)
    into = np.arange(count).astype(np.int32)
    learning = truth.shape[0] > 0
    chains, contest = _chains(ends, count), _contest(tables.edges)
    describe_map(tables.nodes, asking.resolution, asking.features)
    # all are to be asked about at first, then those of the region that grew
    stale = np.flatnonzero(~contest.gone).astype(np.int32)
    near = np.empty(count, np.int32)
    written = questions = 0
    done = False
    while questions + len(stale) <= asking.rest.questions:
        questions += len(stale)
        written = _enter_all(stale, ends, tables, asking, contest, samples, written)
        stale = near[:0]
        best = contest.surest[1]
        if not learning and best >= 0 and contest.odds[best] < level:
            best = contest.rest[1]
        done = best < 0
        if done:
            break
        a, b = ends[best, 0], ends[best, 1]
        _drop(contest, best)
        if learning:
            # a wrong pair is not asked about again until one of the two grows
            if not _same_room(truth[a], truth[b]):
                continue
            truth[a] += truth[b]
        into[b] = a
        _unite(best, ends, tables)
        _move_contacts(a, b, ends, tables.edges, chains, contest)
        stale = near[: _stale_contacts(a, tables.edges, chains, contest.gone, near)]
        if learning:
            stale.sort()
    for k in range(count):
        into[k] = root_of(into, k)
    return into, written, done


def _asking(graph: RegionGraph, forest: Forest, rest: Rest) -> Asking:
    rows = min(max(len(graph.ends), len(graph.nodes)), BLOCK) + 1
    return Asking(
        graph.resolution,
        forest.numbers,
        rest,
        graph.rooms.sum(axis=0),
        np.empty((rows, FEATURE_COUNT)),
        np.empty(rows),
    )


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
    return merge_within(graph, forest, level, rest)[0]


def merge_within(graph: RegionGraph, forest: Forest, level: float, rest: Rest) -> tuple[Ints32, bool]:
    """`merge_regions`, and whether the questions have sufficed.

    With r rooms of the lines a question counts as 1 + r / 1000: all rooms of both regions are compared.
    """
    nothing, cell = np.zeros((0, 0)), graph.resolution**2
    most = int(rest.questions / (1 + graph.rooms.shape[1] / 1000))
    asking = _asking(graph, forest, Rest(rest.small / cell, rest.nook / cell, rest.level, most))
    into, _, done = _agglomerate(graph.ends.copy(), _tables(graph), asking, level, Samples(nothing, nothing))
    return into, done


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
    _, n, _ = _agglomerate(
        graph.ends.copy(), tables, _asking(graph, forest, NO_REST), 0.0, Samples(truth, samples)
    )
    later = np.linspace(pairs, n - 1, min(pairs, max(n - pairs, 0))).astype(np.int64)
    chosen = np.concatenate([np.arange(min(pairs, n)), later])
    return np.asarray(samples[chosen])
