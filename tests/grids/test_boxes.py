"""The box around what is known."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numba.core import event

from layoutexplore.grids.boxes import box_around, known_box, true_box

grids = hnp.arrays(
    np.int8, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.sampled_from([-1, -1, -1, 0, 100])
)


@settings(deadline=None)
@given(grids, st.integers(0, 3))
def test_known_cells_lie_in_their_box(cells: np.ndarray, margin: int) -> None:
    rows, cols = np.nonzero(cells >= 0)
    if not len(rows):
        assert known_box(cells, margin) == (0, 0, 0, 0)
        return
    low = max(rows.min() - margin, 0), max(cols.min() - margin, 0)
    high = min(rows.max() + 1 + margin, cells.shape[0]), min(cols.max() + 1 + margin, cells.shape[1])
    assert known_box(cells, margin) == (low[0], high[0], low[1], high[1])
    assert known_box(np.asfortranarray(cells), margin) == known_box(cells, margin)


@settings(deadline=None)
@given(grids)
def test_true_cells_lie_in_their_box(cells: np.ndarray) -> None:
    known = known_box(cells)
    assert true_box(cells >= 0) == known
    assert true_box(np.asfortranarray(cells >= 0)) == known


def test_a_map_that_is_read_only_compiles_nothing_anew() -> None:
    cells = np.full((4, 4), -1, np.int8)
    cells[1, 2] = 0
    found = known_box(cells), true_box(cells == 0)
    mask = cells == 0
    for array in (cells, mask):
        array.setflags(write=False)
    with event.install_recorder("numba:compile") as compiled:
        assert (known_box(cells), true_box(mask)) == found
    assert not compiled.buffer


@given(hnp.arrays(np.int32, st.tuples(st.integers(1, 9), st.just(2)), elements=st.integers(0, 99)))
def test_cells_lie_in_the_box_around_them(members: np.ndarray) -> None:
    low, high = members.min(axis=0), members.max(axis=0) + 1
    assert box_around(members) == (low[0], high[0], low[1], high[1])
