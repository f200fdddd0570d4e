"""Drawn walls are straight, recorded ones ragged."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from layoutexplore.layout.alignment import surfaces
from layoutexplore.layout.merging.walls.raggedness import is_ragged, straight_share
from tests.layout.merging.cases import office, rough

maps = hnp.arrays(
    np.int8, st.tuples(st.integers(1, 9), st.integers(1, 11)), elements=st.sampled_from([-1, 0, 100])
)


@settings(max_examples=60, deadline=None)
@given(maps, st.sampled_from([0.25, 0.4, 1.0, 2.0]))
def test_the_share_is_that_of_cells_in_long_runs(cells: np.ndarray, resolution: float) -> None:
    surface, length = surfaces(cells), max(round(1.0 / resolution), 1)
    found = 0
    for r, c in np.argwhere(surface):
        runs = []
        for line, at in ((surface[r], c), (surface[:, c], r)):
            low = high = int(at)
            while low > 0 and line[low - 1]:
                low -= 1
            while high + 1 < len(line) and line[high + 1]:
                high += 1
            runs.append(high - low + 1)
        found += max(runs) >= length
    expected = found / surface.sum() if surface.any() else 1.0
    assert straight_share(cells, resolution) == pytest.approx(expected)


def test_walls_in_pieces_are_ragged() -> None:
    grid = office()
    assert not is_ragged(grid.cells, grid.resolution)
    assert is_ragged(rough(grid.cells), grid.resolution)
