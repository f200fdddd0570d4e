"""Scales from known lengths."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from layoutexplore.errors import ConfigError
from layoutexplore.grids.scale import METRES, metres_per_pixel


@given(st.floats(0.1, 1000), st.integers(1, 5000), st.sampled_from(sorted(METRES)), st.booleans())
def test_any_unit_in_any_order(length: float, pixels: int, unit: str, turned: bool) -> None:
    sides = [f"{length} {unit}", f"{pixels}px"]
    assert metres_per_pixel(" = ".join(sides[::-1] if turned else sides)) == pytest.approx(
        length * METRES[unit] / pixels
    )


@pytest.mark.parametrize(
    "text",
    [
        "",
        "3.2 m",
        "3 m = 2 m",
        "3 px = 4 px",
        "0 m = 5 px",
        "3 m = 0 px",
        "-3 m = 5 px",
        "3 yd = 5 px",
        "1.2.3 m = 5 px",
    ],
)
def test_what_is_no_scale_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="118 px"):
        metres_per_pixel(text)
