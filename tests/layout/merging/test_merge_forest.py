"""The forest that classifies pairs of regions, against walking its trees."""

from __future__ import annotations

import numpy as np

from layoutexplore.layout.merging.merge_forest import PAIR_FOREST
from layoutexplore.layout.merging.pair_features import FEATURES
from layoutexplore.models.forest import log_odds


def test_the_forest_walks_every_tree_to_its_leaf() -> None:
    forest = PAIR_FOREST.load()
    x = np.random.default_rng(0).normal(size=(7, len(FEATURES)))
    found = np.empty(7)
    log_odds(x, forest.numbers, found)
    for sample, odds in zip(x, found, strict=True):
        total = forest.bias
        for root in forest.roots:
            i = int(root)
            while forest.feature[i] >= 0:
                i = int(
                    (forest.left if sample[forest.feature[i]] <= forest.threshold[i] else forest.right)[i]
                )
            total += forest.threshold[i]
        assert odds == total
