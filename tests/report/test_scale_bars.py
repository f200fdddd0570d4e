"""Scale bars of maps: where they stand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from layoutexplore.report.scale_bars import place_scale_bar, scale_bar


@given(st.integers(300, 900), st.integers(300, 900), st.integers(0, 3), st.floats(0.02, 0.5))
def test_it_stands_in_the_empty_corner(rows: int, cols: int, corner: int, resolution: float) -> None:
    weight = np.ones((rows, cols))
    below, right = corner < 2, corner % 2
    weight[(rows // 2 if below else 0) : (rows if below else rows // 2),
           (cols // 2 if right else 0) : (cols if right else cols // 2)] = 0.0  # fmt: skip
    bar = place_scale_bar(scale_bar(cols, resolution), weight, (400.0, 300.0))
    assert (bar.y > rows / 2 - bar.high) == below and (bar.x + bar.wide / 2 > cols / 2) == bool(right)
    assert bar.y >= 0 and bar.y + bar.high <= rows + 0.01
    assert bar.wide >= bar.width and bar.high == pytest.approx(24.0 * bar.pixel, rel=0.01)


def test_it_stands_below_on_the_left_where_all_corners_are_alike() -> None:
    bar = place_scale_bar(scale_bar(400, 0.1), np.ones((400, 400)), (400.0, 400.0))
    assert (bar.x, bar.y + bar.high) == (2.0, 398.0)
