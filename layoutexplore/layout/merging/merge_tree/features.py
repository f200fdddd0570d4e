"""What is known of a merge in the tree: the inputs of the classifier that says whether it stands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Floats, Ints32
from layoutexplore.layout.merging.merge_tree.record import TreeRecord, W, WholeFeatures
from layoutexplore.layout.merging.pair_features import FEATURES, OF_NETWORK, F

MAP = (F.map_clutter, F.map_unknown, F.map_radius)
PAIR = tuple(k for k in range(len(FEATURES)) if k not in MAP)
NEXT = (
    *(W.log_area, W.fill, W.aspect, W.radius, W.unknown, W.wall, W.best_odds),
    *(W.room_share, W.room_fit, W.alike, W.alike_out, W.outside, W.ruggedness),
)
SIBLING = (
    *(W.log_area, W.fill, W.radius, W.unknown, W.wall, W.best_odds, W.room_fit),
    *(W.alike, W.alike_out, W.outside),
)
SMALLER = (W.log_area, W.fill, W.radius, W.best_odds, W.room_fit, W.alike, W.alike_out, W.outside)
"""Columns of the features of a map, a pair, and of the whole region that a merge's result merges into next,
of that which it merges with then, and of the smaller one of the two that it is made of."""

OF_WHOLE = WholeFeatures._fields
TREE_FEATURES = (
    *OF_WHOLE,
    *("regions", "relative_area"),
    *(FEATURES[k] for k in MAP),
    *("odds", "weakest_odds", "next_odds"),
    *(f"merge_{FEATURES[k]}" for k in PAIR),
    *(f"next_{FEATURES[k]}" for k in PAIR),
    *(f"parent_{OF_WHOLE[k]}" for k in NEXT),
    *(f"sibling_{OF_WHOLE[k]}" for k in SIBLING),
    *(f"smaller_{OF_WHOLE[k]}" for k in SMALLER),
)
"""Their names in the files of models, in their order."""

OF_NETWORK_WHOLE = ("alike", "alike_out", "border", "outside")
TREE_OF_NETWORK = tuple(
    name
    for name in TREE_FEATURES
    if name.removeprefix("merge_").removeprefix("next_") in OF_NETWORK
    or name.removeprefix("parent_").removeprefix("sibling_").removeprefix("smaller_") in OF_NETWORK_WHOLE
)
"""Those that come from the separator network."""

REGIONS, RELATIVE = len(W), len(W) + 1
"""Where the number of regions and the relative area stand in the features."""

NOTHING = -10.0
"""Stands for what there is not: the next merge of a region that merges no more."""

LEAST_ROOM = 2.0
"""Regions of at least so much area say how large a map's regions are [m2]."""


@dataclass(frozen=True, eq=False)
class MergeTree:
    """The tree of a map's merges: first its regions (row 0 is none), then what they became, in that order.

    Attributes:
        regions: Number of regions and none.
        children: int32 (n, 2), the two nodes each one is made of, -1 for regions.
        parent: int32 (n,), the node that each one is part of, -1 for none.
        odds: float64 (n,), log-odds by which its two merged.
        wholes: float64 (n, columns of `WholeFeatures`).
        pairs: float64 (n, `PairFeatures`), of the two.
    """

    regions: int
    children: Ints32
    parent: Ints32
    odds: Floats
    wholes: Floats
    pairs: Floats


def tree_of(record: TreeRecord, merges: int) -> MergeTree:
    """The tree with so many merges in a record."""
    regions = len(record.node)
    n = regions + merges
    children, parent = record.children[:n], np.full(n, -1, np.int32)
    for side in (0, 1):
        parent[children[regions:, side]] = np.arange(regions, n)
    return MergeTree(regions, children, parent, record.odds[:n], record.wholes[:n], record.pairs[:n])


def describe_merges(tree: MergeTree, about_map: Floats) -> Floats:
    """The features of every merge: float64 (merges, features).

    Args:
        tree: The tree.
        about_map: float64 (`PairFeatures`,), of which those of the map count.
    """
    sizes = tree.wholes[1 : tree.regions, W.log_area]
    large = sizes[sizes > np.log(LEAST_ROOM)]
    typical = max(float(np.median(np.exp(large))) if len(large) else 1.0, 1.0)
    out = np.full((len(tree.parent) - tree.regions, len(TREE_FEATURES)), NOTHING)
    _describe(tree.children, tree.parent, tree.odds, tree.wholes, tree.pairs, about_map, out)
    out[:, RELATIVE] = out[:, W.log_area] - np.log(typical)
    return out


@njit(cache=True, nogil=True)
def _copy(row: Floats, columns: tuple[int, ...], out: Floats, k: int) -> int:
    """Write some columns to `out` from k on; returns the place behind them."""
    for column in columns:
        out[k] = row[column]
        k += 1
    return k


@njit(cache=True, nogil=True)
def _describe(
    children: Ints32,
    parent: Ints32,
    odds: Floats,
    wholes: Floats,
    pairs: Floats,
    about_map: Floats,
    out: Floats,
) -> None:
    """Write the features of the merges but their relative area; what there is not stays as it is in `out`."""
    n, regions = len(parent), len(parent) - len(out)
    counts, weakest = np.ones(n), np.full(n, np.inf)
    # parts come before what they become: their counts are known, and regions have no features here
    for node in range(regions, n):
        one, other = children[node, 0], children[node, 1]
        after = parent[node]
        counts[node] = counts[one] + counts[other]
        weakest[node] = min(odds[node], weakest[one], weakest[other])
        row = out[node - regions]
        row[: len(W)] = wholes[node]
        row[REGIONS] = counts[node]
        k = _copy(about_map, MAP, row, RELATIVE + 1)
        row[k], row[k + 1] = odds[node], weakest[node]
        # the top of a tree merges no more: those places keep what stands for nothing
        if after >= 0:
            row[k + 2] = odds[after]
        k = _copy(pairs[node], PAIR, row, k + 3)
        if after >= 0:
            sibling = children[after, 0] + children[after, 1] - node
            following = _copy(pairs[after], PAIR, row, k)
            following = _copy(wholes[after], NEXT, row, following)
            _copy(wholes[sibling], SIBLING, row, following)
        k += len(PAIR) + len(NEXT) + len(SIBLING)
        smaller = other if wholes[one, W.log_area] >= wholes[other, W.log_area] else one
        _copy(wholes[smaller], SMALLER, row, k)
