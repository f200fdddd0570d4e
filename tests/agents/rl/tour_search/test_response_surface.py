"""Response surfaces: found behind noise, and their lowest place."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.agents.rl.tour_search.response_surface import (
    RELUCTANCE,
    ResponseSurface,
    fit_surface,
    lowest,
)


@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    slope=st.floats(-0.05, 0.05),
    curvature=st.floats(0.0, 0.03),
    offset=st.floats(-3, 3),
)
def test_a_surface_is_found_whatever_the_groups_have_in_common(
    seed: int, slope: float, curvature: float, offset: float
) -> None:
    rng = np.random.default_rng(seed)
    z = rng.normal(size=(500, 4, 2))
    offsets = offset + rng.normal(size=(500, 1))
    values = offsets + slope * z[..., 0] + curvature * z[..., 0] ** 2 + 0.001 * rng.normal(size=(500, 4))
    found = fit_surface(z, values, noise=0.001)
    np.testing.assert_allclose(found.slope, [slope, 0.0], atol=5e-4)
    np.testing.assert_allclose(found.curvature, [curvature, 0.0], atol=5e-4)


def test_noise_alone_says_nothing() -> None:
    rng = np.random.default_rng(0)
    found = fit_surface(rng.normal(size=(3, 2, 1)), rng.normal(size=(3, 2)), noise=1.0)
    assert abs(found.slope[0]) < 0.01 and abs(found.curvature[0]) < 1e-3 and found.deviation[0] < 0.03


def height(k: int, z: Any, surface: ResponseSurface, centre: Any) -> Any:
    return surface.slope[k] * z + surface.curvature[k] * z**2 + RELUCTANCE * (z - centre[k]) ** 2


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 10_000), trust=st.floats(0.1, 2.0))
def test_the_lowest_place_against_a_fine_raster(seed: int, trust: float) -> None:
    rng = np.random.default_rng(seed)
    surface = ResponseSurface(rng.normal(size=3), rng.normal(size=3), np.zeros(3))
    centre, least = rng.normal(size=3), rng.normal(size=3) - 1.0
    found = lowest(surface, centre, trust, least)
    for k in range(3):
        low, high = max(centre[k] - trust, least[k]), max(centre[k] + trust, least[k])
        raster = np.linspace(low, high, 501)
        assert low <= found[k] <= high
        assert height(k, found[k], surface, centre) <= height(k, raster, surface, centre).min() + 1e-9
