"""What the separator network sees of a map."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.layout.merging.separator.planes import DEPTH, FINE, KINDS, PATCH, network_input


@settings(max_examples=40, deadline=None)
@given(
    st.integers(1, 40), st.integers(1, 40), st.sampled_from([0.03, 0.05, 0.07, 0.1]), st.integers(0, 10**6)
)
def test_every_fine_square_holds_the_shares_of_its_cells(
    rows: int, cols: int, resolution: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    cells = rng.choice(np.array([-1, 0, 100], np.int8), (rows, cols))
    wall = (cells == 100) & (rng.random((rows, cols)) < 0.5)
    gap = rng.integers(0, 2, (rows, cols)).astype(np.int32)
    seen = network_input(cells, wall, gap, resolution)
    high, wide = seen.shape[:2]
    assert high % DEPTH == wide % DEPTH == 0 and seen.shape[2] == PATCH * PATCH * KINDS
    fine = seen.reshape(high, wide, PATCH, PATCH, KINDS).transpose(0, 2, 1, 3, 4)
    fine = fine.reshape(high * PATCH, wide * PATCH, KINDS)
    of_row, of_col = (((np.arange(n) + 0.5) * (resolution / FINE)).astype(int) for n in (rows, cols))
    kinds = np.stack([cells == 0, wall, (cells == 100) & ~wall, gap > 0], axis=2)
    expected = np.zeros(fine.shape)
    for r, c in np.ndindex(fine.shape[:2]):
        part = kinds[of_row == r][:, of_col == c].reshape(-1, KINDS)
        if len(part):
            expected[r, c] = part.mean(axis=0)
    np.testing.assert_allclose(fine, expected, rtol=0, atol=1e-6)


def test_cells_larger_than_the_squares_fill_several() -> None:
    cells = np.array([[0, 100, -1]], np.int8)
    seen = network_input(cells, cells == 100, np.zeros((1, 3), np.int32), 0.2)
    fine = seen.reshape(*seen.shape[:2], PATCH, PATCH, KINDS)
    assert (fine[0, 0, :2, :2, 0] == 1).all() and (fine[0, 0, :2, 2:, 1] == 1).all()
    assert fine.sum() == 8
