"""What the classifier that cuts the tree of merges learns from a map whose rooms are known.

Of each merge in the tree the truth tells what its standing is worth: by how much the room it makes fits a
true one better than the best rooms that can be made of its parts, rooms weighing by their area. A merge that
is worth something stands.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from layoutexplore.grids.arrays import Floats
from layoutexplore.layout.merging.agglomeration import grow_tree
from layoutexplore.layout.merging.merge_tree.contest import Rest
from layoutexplore.layout.merging.merge_tree.features import MergeTree
from layoutexplore.layout.merging.method import MergingConfig
from layoutexplore.layout.merging.ray_fans.classifier import FAN_FOREST, outside_regions, without_regions
from layoutexplore.models.forest import Forest
from layoutexplore.training.merging_examples import Example

TREE_LEVEL = -4.0
"""Trees grow further than in use, where so unlikely merges never stand: they show what is wrong with one."""

WORTH_MOST, LARGE, LARGE_PART, LEAST_WEIGHT = 1.5, 20.0, 5.0, 0.15
"""A merge weighs what its standing is worth in units of a large room [m2], at most so much; and besides up to
the least weight, as its smaller part grows to a large one [m2]."""


@dataclass(frozen=True, eq=False)
class TreeSamples:
    """The merges of a map's tree: features (n, features), worth of their standing (n,) [m2], weights (n,)."""

    features: Floats
    worth: Floats
    weights: Floats


def worth_of_merges(tree: MergeTree, rooms: Floats, cell_area: float, room_area: float) -> Floats:
    """What it is worth that each merge stands, with the best rooms of its parts as the alternative [m2].

    A room is worth its known area times its intersection over union with the true room that it fits best,
    and nothing where it is too small for a room.

    Args:
        tree: The tree.
        rooms: float64 (regions, rooms + 1), known free cells of its regions in each true room, column 0 in
            none.
        cell_area: Of a cell [m2].
        room_area: Smallest room [m2].
    """
    counts = np.zeros((len(tree.parent), rooms.shape[1]))
    counts[: tree.regions] = rooms
    counts[0] = 0.0
    for k in range(tree.regions, len(counts)):
        counts[k] = counts[tree.children[k]].sum(axis=0)
    size, known = rooms.sum(axis=0), counts.sum(axis=1)
    fit = counts / np.maximum(known[:, None] + size - counts, 1.0)
    fit[:, 0] = 0.0
    value = np.where(known * cell_area >= room_area, fit.max(axis=1) * known * cell_area, 0.0)
    best, worth = value.copy(), np.zeros(len(value))
    for k in range(tree.regions, len(value)):
        parts = float(best[tree.children[k]].sum())
        worth[k] = value[k] - parts
        best[k] = max(value[k], parts)
    return worth[tree.regions :]


def tree_samples(example: Example, forest: Forest) -> TreeSamples:
    """What a map teaches, its pairs being judged by a classifier trained on other buildings."""
    config = MergingConfig()
    levels = {"level": config.fan_level, "spread": config.fan_spread}
    outside = outside_regions(example.graph, example.features, FAN_FOREST.load(), **levels)
    rest = Rest(config.room_area, config.nook_area, config.nook_level)
    graph, cell_area = without_regions(example.graph, outside), example.graph.resolution**2
    tree, features, _ = grow_tree(graph, forest, config.merge_level, rest, TREE_LEVEL)
    worth = worth_of_merges(tree, example.rooms, cell_area, config.room_area)
    known = np.zeros(len(tree.parent))
    known[: tree.regions] = example.rooms.sum(axis=1)
    for k in range(tree.regions, len(known)):
        known[k] = known[tree.children[k]].sum()
    smaller = known[tree.children[tree.regions :]].min(axis=1) * cell_area
    weights = np.minimum(np.abs(worth) / LARGE, WORTH_MOST)
    weights += LEAST_WEIGHT * np.minimum(smaller / LARGE_PART, 1.0) * (worth > 0)
    weights += 1e-6
    return TreeSamples(features, worth, weights / max(float(weights.sum()), 1.0))
