"""Shared cells of two labellings against a slow obvious version."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from layoutexplore.metrics.overlaps import most_shared, shared_cells

LABELS = st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), max_size=40)


@given(pairs=LABELS, count=st.integers(0, 8))
def test_pairs_are_counted_and_the_commonest_is_found(pairs: list[tuple[int, int]], count: int) -> None:
    first, second = np.array(pairs, np.int32).reshape(-1, 2).T
    table = shared_cells(first, second, count=count)
    assert table.shape == (max([a + 1 for a, _ in pairs] + [1, count]), max([b + 1 for _, b in pairs] + [1]))
    assert all(
        table[a, b] == pairs.count((a, b)) for a in range(table.shape[0]) for b in range(table.shape[1])
    )
    best, cells = most_shared(first, second, count=count)
    assert len(best) == len(cells) == len(table)
    for label in range(len(best)):
        shared = {other: pairs.count((label, other)) for other in range(1, 6)}
        assert cells[label] == max(shared.values())
        assert best[label] == (min(shared, key=lambda other: (-shared[other], other)) if cells[label] else 0)
