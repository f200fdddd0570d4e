"""Features of regions, and of two that touch, are those that the trees that ship have learnt from."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from layoutexplore.grids.grid import FREE, OCCUPIED
from layoutexplore.layout.merging.agglomeration import training_samples
from layoutexplore.layout.merging.merge_forest import PAIR_FOREST
from layoutexplore.layout.merging.pair_features import FEATURES
from layoutexplore.layout.merging.ray_fans.features import RegionFeatures
from layoutexplore.training.merging_examples import make_example
from tests.learnt import RESOLUTION, check_features, partly_seen

LEARNT_FROM = Path(__file__).with_name("learnt_features.csv")


def test_features_of_regions_and_pairs() -> None:
    regions, pairs = [], []
    for name, left_out in (("office-01", 3), ("school-01", 2)):
        cells, rooms = partly_seen(name, left_out)
        row, col = np.indices(cells.shape)
        cells[(cells == FREE) & (row % 23 < 3) & (col % 31 < 4)] = OCCUPIED  # furniture
        example = make_example(cells, rooms, RESOLUTION, building=name, kind="made up")
        regions.append(example.features[1:])
        samples = training_samples(example.graph, PAIR_FOREST.load(), example.rooms)
        pairs.append(samples[: len(example.graph.ends)])  # as they are before anything is merged
    check_features(LEARNT_FROM, "region", RegionFeatures._fields, np.concatenate(regions))
    check_features(LEARNT_FROM, "pair", (*FEATURES, "one room", "weight"), np.concatenate(pairs))
