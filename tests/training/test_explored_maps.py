"""Training examples of maps that are explored in part."""

from __future__ import annotations

import numpy as np

from layoutexplore.grids.grid import FREE, UNKNOWN
from layoutexplore.training.explored_maps import explore_map, explored_examples
from tests.layout.merging.cases import plan, rooms_of


def test_explored_maps_show_the_map_itself() -> None:
    cells = plan()
    for dense in (True, False):
        seen = explore_map(cells, 0.05, np.random.default_rng(0), dense=dense)
        known = seen != UNKNOWN
        assert (seen[known] == cells[known]).all()
        assert 0 < np.count_nonzero(seen == FREE) <= np.count_nonzero(cells == FREE)
    examples = explored_examples(
        cells, rooms_of(cells), 0.05, building="a", kind="x", rng=np.random.default_rng(1)
    )
    assert examples and {e.kind for e in examples} == {"x, explored"}
