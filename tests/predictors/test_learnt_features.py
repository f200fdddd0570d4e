"""Features are those that the trees and networks that ship have learnt from."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from layoutexplore.frontiers.detection import find_frontiers
from layoutexplore.layout.doorways import doorway_regions
from layoutexplore.predictors.cell_model import features as cells_of_rooms
from layoutexplore.predictors.frontier_model import features as frontiers
from tests.learnt import RESOLUTION, check_features, partly_seen

LEARNT_FROM = Path(__file__).with_name("learnt_features.csv")
FLOORS = (("office-01", 3), ("apartment-02", 2))


def test_features_of_frontiers() -> None:
    rows = []
    for name, left_out in FLOORS:
        cells, _ = partly_seen(name, left_out)
        clusters = find_frontiers(cells)
        around = frontiers.look_around(cells, clusters, doorway_regions(cells, RESOLUTION), RESOLUTION)
        rows.append(frontiers.frontier_features(around, np.arange(len(clusters)) % 7.0))
    check_features(LEARNT_FROM, "frontier", frontiers.FEATURES, np.concatenate(rows).astype(np.float64))


def test_features_of_cells_that_a_room_may_be_completed_with() -> None:
    rows = []
    for name, left_out in FLOORS:
        cells, _ = partly_seen(name, left_out)
        found = cells_of_rooms.find_candidates(cells, doorway_regions(cells, RESOLUTION), RESOLUTION)
        inside = np.arange(len(found.cells)) % 5 / 4.0
        rows.append(cells_of_rooms.add_first_estimate(found, inside, RESOLUTION))
    check_features(LEARNT_FROM, "cell", cells_of_rooms.FEATURES, np.concatenate(rows).astype(np.float64))
