"""Cells that a room may be completed with."""

from __future__ import annotations

import numpy as np
import pytest

from layoutexplore.layout.doorways import doorway_regions
from layoutexplore.predictors.cell_model.features import FEATURES as CELL_FEATURES
from layoutexplore.predictors.cell_model.features import add_first_estimate, find_candidates


def test_cells_are_offered_to_two_regions_and_judged_by_their_neighbourhood() -> None:
    cells = np.full((40, 60), -1, np.int8)
    cells[:, :20], cells[:, 40:] = 0, 0
    regions = doorway_regions(cells, 0.1)
    candidates = find_candidates(cells, regions, 0.1)
    assert sorted(set(candidates.region.tolist())) == [1, 2] and set(candidates.rank.tolist()) == {0, 1}
    assert (cells[candidates.cells[:, 0], candidates.cells[:, 1]] == -1).all()
    inside = (candidates.region == 1).astype(float)
    features = add_first_estimate(candidates, inside, 0.1)
    at = CELL_FEATURES.index("judged_near")
    assert (features[candidates.region == 1, at] == 1.0).all() and (
        features[candidates.region == 2, at] == 0.0
    ).all()
    total = CELL_FEATURES.index("judged_total")
    assert features[candidates.region == 1, total] == pytest.approx(40 * 20 * 0.01, rel=0.3)
    some = find_candidates(cells, regions, 0.1, wanted=np.array([False, True, False]))
    np.testing.assert_array_equal(some.features, candidates.features[candidates.region == 1])
