"""Sets of cells as bits of words, against slow, obvious versions."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from layoutexplore.grids.bitsets import count_bits, ones, set_bits, true_cells

masks = hnp.arrays(np.bool_, st.tuples(st.integers(1, 12), st.integers(1, 150)), elements=st.booleans())


@settings(deadline=None)
@given(st.integers(0, 2**64 - 1))
def test_ones_are_the_set_bits_of_a_word(word: int) -> None:
    assert ones(np.uint64(word)) == word.bit_count()


@settings(max_examples=60, deadline=None)
@given(masks, st.integers(0, 3), st.integers(0, 10**6))
def test_bits_of_rows_and_columns_count_the_cells_of_a_stretch(
    mask: np.ndarray, slack: int, seed: int
) -> None:
    rows, cols = mask.shape
    rng = np.random.default_rng(seed)
    of_rows, of_cols = set_bits(np.flatnonzero(mask), rows, cols, slack)
    for bits, cells in ((of_rows, mask), (of_cols, mask.T)):
        for _ in range(5):
            row = int(rng.integers(len(cells)))
            begin, end = (int(v) for v in rng.integers(-20, cells.shape[1] + 20, 2))
            thick = cells[max(row - slack, 0) : row + slack + 1].any(axis=0)
            assert count_bits(bits, row, len(thick), begin, end) == np.count_nonzero(
                thick[max(begin, 0) : max(end, 0)]
            )


@settings(max_examples=80, deadline=None)
@given(hnp.arrays(np.bool_, st.tuples(st.integers(1, 5), st.integers(1, 40))))
def test_true_cells_are_where_the_mask_is_true(mask: np.ndarray) -> None:
    mask.flags.writeable = False
    for part in (mask, mask[:, ::2]):
        assert true_cells(part).tolist() == np.flatnonzero(part).tolist()
