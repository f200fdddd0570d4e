"""Edges of walls that may be closed doors, and their features."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from layoutexplore.closed_doors.doors import DOOR_FEATURES, door_features, find_edges
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN
from tests.closed_doors.cases import WALL, WIDTH, office


@given(arrays(np.int8, (9, 40), elements=st.sampled_from([FREE, FREE, FREE, UNKNOWN, OCCUPIED])))
def test_edges_by_a_slow_search(cells: NDArray[np.int8]) -> None:
    cells[:3], cells[3, 5:30] = UNKNOWN, OCCUPIED
    cells[4, 5:30] = FREE
    slow = []
    for row in range(1, 8):
        edge = [
            cells[row + 1, c] == FREE and cells[row, c] != FREE and cells[row - 1, c] == UNKNOWN
            for c in range(40)
        ]
        for start in range(40):
            if edge[start] and (start == 0 or not edge[start - 1]):
                stop = next((c for c in range(start, 40) if not edge[c]), 40)
                slow += [(row, start, stop)] if stop - start >= 12 else []
    assert [tuple(edge) for edge in find_edges(cells, 0.05).tolist()] == slow


def test_an_edge_in_numbers() -> None:
    seen, _ = office((2,))
    edges = find_edges(seen, 0.05)
    left = 10 + 2 * (WIDTH + WALL)
    (leaf,) = (k for k, edge in enumerate(edges.tolist()) if edge[1:] == [left + 25, left + 45])
    known = dict(zip(DOOR_FEATURES, door_features(seen, 0.05, edges)[leaf].tolist(), strict=True))
    assert known["length"] == pytest.approx(1.0)
    assert known["occupied"] == 1
    assert known["behind"] == pytest.approx(3.0)
    assert known["recess"] == known["recess_other"] == pytest.approx(0.15)
    assert known["loose"] == known["loose_other"] == 0
