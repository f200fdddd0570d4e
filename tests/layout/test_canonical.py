"""The canonical orientation of a map, applied and inverted."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from layoutexplore.layout.canonical import Orientation

maps = hnp.arrays(
    np.int8, st.tuples(st.integers(1, 9), st.integers(1, 11)), elements=st.sampled_from([-1, 0, 100])
)


@settings(max_examples=40, deadline=None)
@given(maps, st.booleans(), st.booleans(), st.booleans())
def test_an_orientation_is_inverted(cells: np.ndarray, rows: bool, cols: bool, swap: bool) -> None:
    orientation = Orientation(mirror_rows=rows, mirror_cols=cols, swap=swap)
    oriented = cells[:: -1 if rows else 1, :: -1 if cols else 1]
    assert (orientation.apply(cells) == (oriented.T if swap else oriented)).all()
    assert (orientation.invert(orientation.apply(cells)) == cells).all()
    assert (orientation.invert(orientation.apply(cells == 0)) == (cells == 0)).all()
