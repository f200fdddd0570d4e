"""Degrees as metres."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from layoutexplore.maps.formats.geographic import LocalFrame, looks_geographic


@given(st.floats(-179, 179), st.floats(-75, 75), st.floats(-200, 200), st.floats(-200, 200))
def test_metres_are_those_of_the_sphere(lon: float, lat: float, x: float, y: float) -> None:
    """Against the great-circle distance, to a few per mille within a building."""
    frame = LocalFrame(lon, lat)
    point = frame.origin + np.array([x, y]) / frame.scale
    a, b = np.radians(frame.origin), np.radians(point)
    h = np.sin((b - a)[1] / 2) ** 2 + np.cos(a[1]) * np.cos(b[1]) * np.sin((b - a)[0] / 2) ** 2
    metres = 2 * 6_378_137.0 * np.arcsin(np.sqrt(h))
    assert abs(np.hypot(*frame.to_metres(point[None])[0]) - metres) <= 0.01 + 0.003 * metres


def test_buildings_in_metres_are_not_taken_for_degrees() -> None:
    assert not looks_geographic(shapely.box(0, 0, 3, 2))
    assert not looks_geographic(shapely.box(500_000.1, 5_000_000.1, 500_000.3, 5_000_000.2))
    assert not looks_geographic(shapely.Polygon())
    assert looks_geographic(shapely.box(-0.1281, 51.5, -0.1279, 51.5001))


@pytest.mark.parametrize("longitude", [-0.0001, 13.4, 179.9999, -180.0])
def test_a_building_on_the_date_line_is_as_wide_as_elsewhere(longitude: float) -> None:
    frame = LocalFrame(longitude, -17.0)
    building = shapely.box(0, 0, 40, 9)
    points = shapely.get_coordinates(building) / frame.scale + frame.origin
    points[:, 0] = (points[:, 0] + 180.0) % 360.0 - 180.0
    assert looks_geographic(shapely.LineString(points))
    projected = LocalFrame.around(points).to_metres(points)
    np.testing.assert_allclose(projected, shapely.get_coordinates(building), atol=1e-3)
