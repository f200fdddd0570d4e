"""What the separator network says is added up region by region and contact by contact."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.layout.merging.graph_tables import EDGE, NODE
from layoutexplore.layout.merging.separator.evidence import MOST, add_separator, border_map
from layoutexplore.layout.merging.separator.network import BORDER, NEAR, OFFSETS, OUTPUTS, OUTSIDE


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([0.05, 0.08, 0.1]))
def test_pairs_of_squares_count_for_their_regions_or_their_contact(seed: int, resolution: float) -> None:
    rng = np.random.default_rng(seed)
    labels = rng.integers(0, 4, (6, 7)).astype(np.int32).repeat(24, axis=0).repeat(20, axis=1)
    odds = rng.normal(0, 3, (int(144 * resolution / 0.2) + 9, int(140 * resolution / 0.2) + 3, OUTPUTS))
    odds = odds.astype(np.float32)
    # regions 2 and 3 do not touch: nobody asks about pairs of them
    ends = np.array([[1, 2], [1, 3]], np.int32)
    nodes, edges = np.zeros((4, len(NODE))), np.zeros((2, len(EDGE)))
    add_separator(labels, odds, ends, edges, nodes, resolution)

    def region(row: int, col: int) -> int:
        r, c = (int((v + 0.5) * (0.2 / resolution)) for v in (row, col))
        return int(labels[r, c]) if r < labels.shape[0] and c < labels.shape[1] else 0

    expected_nodes, expected_edges = np.zeros_like(nodes), np.zeros_like(edges)
    regions = [[region(row, col) for col in range(odds.shape[1])] for row in range(odds.shape[0])]
    said = odds.tolist()
    for row, col in np.ndindex(odds.shape[:2]):
        a = regions[row][col]
        if not a:
            continue
        expected_nodes[a, NODE.squares] += 1
        expected_nodes[a, NODE.outside] += 1 / (1 + np.exp(-said[row][col][OUTSIDE]))
        for k, (up, right) in enumerate(OFFSETS):
            r, c = row + up, col + right
            if not (r < odds.shape[0] and 0 <= c < odds.shape[1]):
                continue
            b, value = regions[r][c], min(max(said[row][col][3 + k], -MOST), MOST)
            if a == b and k >= NEAR:
                expected_nodes[a, [NODE.alike, NODE.pairs]] += value, 1
            elif a != b and {a, b} in ({1, 2}, {1, 3}):
                columns = [EDGE.alike_near, EDGE.pairs_near] if k < NEAR else [EDGE.alike_far, EDGE.pairs_far]
                expected_edges[max(a, b) - 2, columns] += value, 1
    assert nodes == pytest.approx(expected_nodes, abs=1e-6)
    assert edges == pytest.approx(expected_edges, abs=1e-6)


def test_cells_know_the_square_they_lie_in() -> None:
    odds = np.zeros((4, 4, OUTPUTS), np.float32)
    odds[1, 2, BORDER] = 20.0
    border = border_map(odds, (8, 12), 0.05)
    assert border.row.tolist() == [0, 0, 0, 0, 1, 1, 1, 1]
    assert border.likely[border.row[5], border.col[9]] == pytest.approx(1.0)
    assert border.likely[border.row[3], border.col[9]] == 0.5
    nothing = border_map(odds[:0, :0], (8, 12), 0.05)
    assert nothing.likely[nothing.row[7], nothing.col[11]] == 0.0
