"""The best cut of the tree of merges: which merges stand, so that what they make are rooms."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Floats, Ints32
from layoutexplore.layout.merging.merge_forest import PAIR_FOREST
from layoutexplore.layout.merging.merge_tree.features import TREE_FEATURES, MergeTree
from layoutexplore.models.forest import Forest
from layoutexplore.models.forest_files import ForestKind

CUT_FOREST = ForestKind("stands", TREE_FEATURES, Path(__file__).with_name("cut_model.json"))
"""The classifier of merges; `layoutexplore.training.merge_trees` makes it."""

ASKEW_PREFIX, RAGGED_PREFIX = "askew_", "ragged_"
"""Begin the names of the files of the models for maps on which a wing is turned against the others, and for
other maps with ragged walls."""


@dataclass(frozen=True, eq=False)
class MergingModels:
    """The classifiers that turn regions into rooms.

    Attributes:
        pairs: Which of two touching regions are one room: the order of merging, and its end.
        cut: Which merges stand; None for all of those that end at `merge_level`.
        askew: Those for maps on which a wing is turned against the others; None for the same.
        ragged: Those for other maps with ragged walls, of which the separator network is asked; None for the
            same.
    """

    pairs: Forest
    cut: Forest | None = None
    askew: MergingModels | None = None
    ragged: MergingModels | None = None


def load_models() -> MergingModels:
    """The shipped models; those of unchanged files are read only once."""
    return replace(_load(""), askew=_load(ASKEW_PREFIX), ragged=_load(RAGGED_PREFIX))


def _load(prefix: str) -> MergingModels:
    pairs, cut = (
        kind.load(kind.shipped.with_name(prefix + kind.shipped.name)) for kind in (PAIR_FOREST, CUT_FOREST)
    )
    return MergingModels(pairs, cut)


MOST_ODDS = 3.0
"""A pair's log-odds count up to this much for or against a merge: the tree's top is all but impossible."""


def standing_odds(tree: MergeTree, wholes: Floats, level: float, weight: float) -> Floats:
    """Log-odds that each merge stands, by what it makes and by the pair it was made of: float64 (merges,).

    Args:
        tree: The tree.
        wholes: float64 (merges,), log-odds by what the merges make.
        level: Log-odds at which a pair speaks neither for its merge nor against it.
        weight: Of the pair's log-odds, where those of what it makes weigh 1.
    """
    pairs = np.clip(tree.odds[tree.regions :], -MOST_ODDS, MOST_ODDS)
    return np.asarray(wholes + weight * (pairs - level))


def best_cut(tree: MergeTree, odds: Floats) -> Ints32:
    """The region that each region becomes one with, itself for the first of each: int32 (regions,).

    A merge can only stand if all those in it do. Of all such sets of merges, the one with the largest sum of
    log-odds stands.

    Args:
        tree: The tree.
        odds: float64 (merges,), log-odds that a merge stands.
    """
    return _cut(tree.children, tree.parent, tree.regions, odds)


@njit(cache=True, nogil=True)
def _cut(children: Ints32, parent: Ints32, regions: int, odds: Floats) -> Ints32:
    """`best_cut` of the arrays of a tree."""
    n = len(parent)
    whole, best = np.zeros(n), np.zeros(n)
    stands = np.ones(n, np.bool_)
    # children come before what they become: all of a node's parts are known when its turn comes
    for k in range(regions, n):
        a, b = children[k, 0], children[k, 1]
        whole[k] = odds[k - regions] + whole[a] + whole[b]
        best[k] = max(whole[k], best[a] + best[b])
        stands[k] = whole[k] >= best[a] + best[b]
    # from the top: a node whose parent is in a room is in that room, else it is one itself if it stands
    room = np.full(n, -1, np.int32)
    first = np.full(n, -1, np.int32)
    into = np.zeros(regions, np.int32)
    for k in range(n - 1, -1, -1):
        above = parent[k]
        if above >= 0 and room[above] >= 0:
            room[k] = room[above]
        elif stands[k]:
            room[k] = k
    for k in range(regions):
        if first[room[k]] < 0:
            first[room[k]] = k
        into[k] = first[room[k]]
    return into
