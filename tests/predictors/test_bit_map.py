"""What is known, as bit masks, against a slow version."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from numpy.typing import NDArray

from layoutexplore.predictors.bit_map import ALONG_COLS, ALONG_ROWS, UNKNOWN_BIT, draw_bit_map
from tests.predictors.cases import grids, nothing_seen, wide


def test_walls_go_on_through_the_unknown() -> None:
    cells = np.full((9, 12), -1, np.int8)
    cells[4, 1:4] = 100
    cells[4, 8] = 0
    bit_map = draw_bit_map(cells, nothing_seen(cells.shape), 0.15, 0.3)
    code = bit_map.code[bit_map.margin : -bit_map.margin, bit_map.margin : -bit_map.margin]
    assert np.argwhere(code & ALONG_ROWS).tolist() == [[4, 0], [4, 4], [4, 5], [4, 6], [4, 7]]
    assert not (code & ALONG_COLS).any()


@settings(max_examples=40, deadline=None)
@given(cells=grids | wide)
def test_a_chart_against_a_slow_one(cells: NDArray[np.int8]) -> None:
    bit_map = draw_bit_map(cells, nothing_seen(cells.shape), 0.2, 0.4)
    padded = np.pad(cells, bit_map.margin, constant_values=-1)
    expected = np.zeros(padded.shape, np.uint8)
    for turned, bit in ((False, ALONG_ROWS), (True, ALONG_COLS)):
        lines, bits = (padded.T, expected.T) if turned else (padded, expected)
        for line, marked in zip(lines, bits, strict=True):
            text = "".join({-1: "?", 0: ".", 100: "#"}[int(v)] for v in line)
            for c, value in enumerate(text):
                left, right = text[:c].rstrip("?"), text[c + 1 :].lstrip("?")
                if value == "?" and (left.endswith("##") or right.startswith("##")):
                    marked[c] |= bit
    assert (bit_map.code & (ALONG_ROWS | ALONG_COLS) == expected).all()
    assert ((bit_map.code & UNKNOWN_BIT > 0) == (padded == -1)).all()
