"""Regions merge into rooms, the surest pair first, as a forest of trees says from readable features."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import ZERO, Floats, Ints32
from layoutexplore.grids.components import root_of
from layoutexplore.layout.merging.graph_tables import NODE, RegionGraph, add_node, enclose_edge
from layoutexplore.layout.merging.merge_tree.contact_chains import chains_of, move_contacts, stale_contacts
from layoutexplore.layout.merging.merge_tree.contest import (
    Contest,
    Rest,
    contest_of,
    drop_contact,
    enter_contact,
)
from layoutexplore.layout.merging.merge_tree.features import MergeTree, describe_merges, tree_of
from layoutexplore.layout.merging.merge_tree.record import (
    TreeRecord,
    empty_record,
    record_merge,
    record_wholes,
)
from layoutexplore.layout.merging.pair_features import FEATURES, GraphTables, describe_map, describe_pairs
from layoutexplore.models.forest import Forest, Numbers, log_odds
from layoutexplore.models.quickscorer import NO_MASKS, LeafMasks, log_odds_by_masks

FEATURE_COUNT = len(FEATURES)

BLOCK = 4096
"""The classifier is asked about at most so many pairs at once."""


MANY = 16
"""Pairs from which on the classifier's masks are quicker than descending its trees."""

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
    for k in range(FEATURE_COUNT):
        sample[k] = x[k]
    sample[FEATURE_COUNT] = 1.0 if _same_room(a, b) else 0.0
    ra, rb = a.argmax(), b.argmax()
    pure = min(a[ra] / max(a.sum(), 1.0), b[rb] / max(b.sum(), 1.0))
    sample[FEATURE_COUNT + 1] = pure * (0.2 if ra == 0 and rb == 0 else 1.0)


@njit(cache=True, nogil=True)
def _unite(best: int, ends: Ints32, tables: GraphTables) -> None:
    """Add the second region of a contact to the first one."""
    a, b = ends[best, 0], ends[best, 1]
    add_node(tables.nodes[a], tables.nodes[b])
    enclose_edge(tables.nodes[a], tables.edges[best])
    tables.rooms[a] += tables.rooms[b]


class Samples(NamedTuple):
    """What is noted while merging by the truth, else empty.

    Attributes:
        truth: float64 (k + 1, rooms + 1), known free cells of each region in each true room; changed.
        rows: float64 (n, features + 2), takes the samples.
    """

    truth: Floats
    rows: Floats


NO_SAMPLES = Samples(np.zeros((0, 0)), np.zeros((0, 0)))


class Asking(NamedTuple):
    """What a pair of regions is asked about with, and where the answers go.

    Attributes:
        resolution: Metres a cell.
        forest: The classifier.
        masks: The same for many pairs at once; of no tree where there are none.
        rest: What is too small (areas in cells).
        size: float64 (r + 1,), known free cells in each room of the lines.
        features: float64 (n, features), of as many pairs as are asked about at once.
        odds: float64 (n,), their log-odds.
    """

    resolution: float
    forest: Numbers
    masks: LeafMasks
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
        # both give the same sums: masks take as long for one pair as for all of their lanes
        if len(fresh) >= MANY and len(asking.masks.starts) > 1:
            log_odds_by_masks(x[: len(fresh)], asking.masks, asking.odds)
        else:
            log_odds(x, asking.forest, asking.odds[: len(fresh)])
        for k in range(len(fresh)):
            e = fresh[k]
            a, b = ends[e, 0], ends[e, 1]
            area = min(nodes[a, NODE.area], nodes[b, NODE.area])
            enter_contact(contest, e, asking.odds[k], area, asking.rest)
            if n < len(samples.rows):
                _add_sample(x[k], samples.truth[a], samples.truth[b], samples.rows[n])
                n += 1
    return n


@njit(cache=True, nogil=True)
def _agglomerate(
    ends: Ints32, tables: GraphTables, asking: Asking, level: float, samples: Samples, record: TreeRecord
) -> tuple[Ints32, int, int, bool]:
    """Merge in place; with a truth only where it is right, each pair asked about a sample.

    Returns the region that each one ends up in, the samples written, the merges, and whether the questions
    have sufficed.
    """
    truth, count, nodes = samples.truth, len(tables.nodes), len(record.node)
    into = np.arange(count).astype(np.int32)
    learning, beyond = truth.shape[0] > 0, False
    chains, contest = chains_of(ends, count), contest_of(tables.edges)
    describe_map(tables.nodes, asking.resolution, asking.features)
    # all are to be asked about at first, then those of the region that grew
    stale = np.flatnonzero(~contest.gone).astype(np.int32)
    near = np.empty(count, np.int32)
    written = questions = merges = a = ZERO
    done = False
    while questions + len(stale) <= asking.rest.questions:
        questions += len(stale)
        written = _enter_all(stale, ends, tables, asking, contest, samples, written)
        if nodes:
            # every region at first, then the one that grew
            begin, end = (a, a + 1) if merges else (ZERO, count)
            record_wholes(record, begin, end, tables, chains, contest.odds, asking.size, asking.resolution)
        stale = near[:0]
        best = contest.surest[1]
        if not learning and not beyond and (best < 0 or contest.odds[best] < level):
            best = contest.rest[1]
            # what is too small has a place: the tree grows on from there
            beyond = best < 0
            best = contest.surest[1] if beyond else best
        done = best < 0 or (beyond and contest.odds[best] < record.low)
        if done:
            break
        a, b = ends[best, 0], ends[best, 1]
        drop_contact(contest, best)
        if learning:
            # a wrong pair is not asked about again until one of the two grows
            if not _same_room(truth[a], truth[b]):
                continue
            truth[a] += truth[b]
        if nodes:
            odds, size = contest.odds[best], asking.size
            record_merge(record, best, count + merges, odds, ends, tables, size, asking.resolution)
        into[b] = a
        merges += 1
        _unite(best, ends, tables)
        move_contacts(a, b, ends, tables.edges, chains, contest)
        stale = near[: stale_contacts(a, tables.edges, chains, contest.gone, near)]
        if learning:
            stale.sort()
    for k in range(count):
        into[k] = root_of(into, k)
    return into, written, merges, done


def _asking(graph: RegionGraph, forest: Forest, rest: Rest) -> Asking:
    rows = min(max(len(graph.ends), len(graph.nodes)), BLOCK) + 1
    return Asking(
        graph.resolution,
        forest.numbers,
        forest.masks or NO_MASKS,
        rest,
        graph.rooms.sum(axis=0),
        np.empty((rows, FEATURE_COUNT)),
        np.empty(rows),
    )


def merge_within(
    graph: RegionGraph, forest: Forest, level: float = 0.0, rest: Rest = NO_REST
) -> tuple[Ints32, bool]:
    """Which regions become one.

    With r rooms of the lines a question counts as 1 + r / 1000: all rooms of both regions are compared.

    Args:
        graph: The regions; not changed.
        forest: The classifier.
        level: Merge while the log-odds of the surest pair are at least this.
        rest: What is too small to stay by itself then.

    Returns:
        int32 (k + 1,), the region that each region is merged into (itself for the first of each room); and
        whether the questions have sufficed.
    """
    into, _, _, done = _agglomerate(
        graph.ends.copy(), _tables(graph), _bounded(graph, forest, rest), level, NO_SAMPLES, empty_record()
    )
    return into, done


def grow_tree(
    graph: RegionGraph, forest: Forest, level: float, rest: Rest, low: float
) -> tuple[MergeTree, Floats, bool]:
    """The tree of merges: those of `merge_within`, then further ones while the log-odds are at least `low`.

    Returns:
        The tree, the features of its merges float64 (merges, features), and whether the questions have
        sufficed.
    """
    record, asking = empty_record(len(graph.nodes), low), _bounded(graph, forest, rest)
    _, _, merges, done = _agglomerate(graph.ends.copy(), _tables(graph), asking, level, NO_SAMPLES, record)
    tree = tree_of(record, merges)
    return tree, describe_merges(tree, asking.features[0]), done


def _bounded(graph: RegionGraph, forest: Forest, rest: Rest) -> Asking:
    """With the areas of `rest` in cells, and fewer questions where each takes longer."""
    cell, most = graph.resolution**2, int(rest.questions / (1 + graph.rooms.shape[1] / 1000))
    return _asking(graph, forest, Rest(rest.small / cell, rest.nook / cell, rest.level, most))


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
    asking, noted = _asking(graph, forest, NO_REST), Samples(truth, samples)
    _, n, _, _ = _agglomerate(graph.ends.copy(), tables, asking, 0.0, noted, empty_record())
    later = np.linspace(pairs, n - 1, min(pairs, max(n - pairs, 0))).astype(np.int64)
    chosen = np.concatenate([np.arange(min(pairs, n)), later])
    return np.asarray(samples[chosen])
