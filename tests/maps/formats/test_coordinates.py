"""What coordinates measure in, by the coordinate system that a file declares."""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from layoutexplore.errors import MapError, MapWarning
from layoutexplore.maps.formats.coordinates import declared_crs, in_metres, measure_of, mercator_to_degrees

FILE = Path("gis.geojson")


@pytest.mark.parametrize(
    ("crs", "name", "measure"),
    [
        ({"properties": {"name": "EPSG:3857"}}, "EPSG:3857", "mercator"),
        ({"properties": {"name": "urn:ogc:def:crs:EPSG::900913"}}, None, "mercator"),
        ({"properties": {"name": "urn:ogc:def:crs:EPSG:6.9:25832"}}, None, "metres"),
        ({"properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}, None, "degrees"),
        ({"properties": {"name": "http://www.opengis.net/def/crs/EPSG/0/2263"}}, None, "feet"),
        ({"properties": {"name": "EPSG:6418"}}, None, "feet"),
        ({"properties": {"name": "EPSG:6419"}}, None, "unknown"),
        ({"type": "EPSG", "properties": {"code": 4326}}, "EPSG:4326", "degrees"),
        ("ESRI:102100", "ESRI:102100", "mercator"),
        ({"properties": {"name": "a drawing of 1999"}}, None, "unknown"),
        (None, "", "unknown"),
        ({"properties": {"name": None}}, "", "unknown"),
        ({"properties": ["EPSG:3857"]}, "", "unknown"),
        (3857, "", "unknown"),
    ],
)
def test_names_of_coordinate_systems(crs: Any, name: str | None, measure: str) -> None:
    told = declared_crs({"type": "FeatureCollection", "crs": crs, "features": []})
    assert told == (crs["properties"]["name"] if name is None else name)
    assert measure_of(told) == measure


@pytest.mark.parametrize(
    "name",
    [
        "http://www.opengis.net/def/crs/EPSG/0/3857",
        "http://www.opengis.net/def/crs/EPSG/9.9.1/3857/",
        "http://spatialreference.org/ref/epsg/3857/proj4/",
        "https://spatialreference.org/ref/epsg/3857/",
        "https://epsg.io/3857.json",
        "http://www.opengis.net/gml/srs/epsg.xml#3857",
        "urn:ogc:def:crs,crs:EPSG::3857,crs:EPSG::5773",
        "EPSG:3857+5773",
        "epsg:3857 ",
        "WGS 84 / Pseudo-Mercator",
        "WGS_1984_Web_Mercator_Auxiliary_Sphere",
    ],
)
def test_names_of_web_mercator(name: str) -> None:
    assert measure_of(name) == "mercator"


def test_other_names_with_numbers_are_no_codes() -> None:
    for name in ("http://plans.org/3857/floor", "EPSG:38570", "NAD83 / Mercator", "EPSG:385"):
        assert measure_of(name) == "unknown"
    assert measure_of("http://www.opengis.net/def/crs/OGC/1.3/CRS84/") == "degrees"


def test_state_planes_in_feet_are_told_from_their_neighbours_in_metres() -> None:
    """Between them lie grids of Oman, Belgium and Jamaica, and the same state planes in metres."""
    metres = {3439, 3440, 3447, 3448, 3449, 3450}
    assert {code for code in range(3417, 3459) if measure_of(f"EPSG:{code}") != "feet"} == metres
    for code in (3734, 3735, 3560, 2965, 3089, 3481, 3612, 3670, 3700, 26847, 9748, 6515):
        assert measure_of(f"EPSG:{code}") == "feet"
    for code in (3480, 3488, 3489, 3513, 3514, 3555, 3591, 3594, 3637, 3666, 3701, 3740, 3752, 2993, 6514):
        assert measure_of(f"EPSG:{code}") != "feet"


def mercator(lon: float, lat: float) -> tuple[float, float]:
    """The textbook's formula."""
    radius = 6_378_137.0
    return radius * math.radians(lon), radius * math.log(math.tan(math.pi / 4 + math.radians(lat) / 2))


@given(st.floats(-179.0, 179.0), st.floats(-80.0, 80.0))
def test_web_mercator_is_unrolled(lon: float, lat: float) -> None:
    assert mercator_to_degrees(np.array([mercator(lon, lat)]))[0] == pytest.approx([lon, lat], abs=1e-9)


@given(st.floats(-170.0, 170.0), st.floats(-75.0, 75.0), st.floats(4.0, 90.0), st.floats(4.0, 90.0))
def test_web_mercator_and_degrees_give_the_same_metres(
    lon: float, lat: float, width: float, depth: float
) -> None:
    wide, high = width / (111_320 * math.cos(math.radians(lat))), depth / 111_320
    hall = shapely.box(lon, lat, lon + wide, lat + high)
    stretched = shapely.transform(hall, lambda p: np.array([mercator(x, y) for x, y in p.tolist()]))
    with pytest.warns(MapWarning, match="projected to metres"):
        (one,), (two,) = in_metres([hall], FILE), in_metres([stretched], FILE, "EPSG:3857")
    assert shapely.get_coordinates(two) == pytest.approx(shapely.get_coordinates(one), abs=1e-3)
    assert two.area == pytest.approx(width * depth, rel=1e-3)


@pytest.mark.parametrize(
    ("crs", "far", "said"),
    [
        ("EPSG:4326", 0.0, "too large for the degrees of 'EPSG:4326'"),
        ("EPSG:5514", 0.0, "units of 'EPSG:5514' are not known"),
        ("", 5e6, "declares no coordinate system"),
        ("", 4e5, ""),
        ("EPSG:25833", 5e6, ""),
    ],
)
def test_doubts_about_metres_are_told(crs: str, far: float, said: str) -> None:
    hall = shapely.box(far, far, far + 9, far + 5)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert in_metres([hall], FILE, crs)[0].equals(hall)
    assert [said in str(warning.message) for warning in caught] == [True] * bool(said)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # Who gives the unit knows.
        assert in_metres([hall], FILE, crs, 0.5)[0].area == pytest.approx(hall.area / 4)


def test_feet_are_refused_unless_the_unit_is_given() -> None:
    hall = shapely.box(985_000, 200_000, 985_030, 200_020)
    with pytest.raises(MapError, match=r"coordinates are feet .*--scale-by '1 ft = 1 unit'"):
        in_metres([hall], FILE, "urn:ogc:def:crs:EPSG::2263")
    (scaled,) = in_metres([hall], FILE, "urn:ogc:def:crs:EPSG::2263", 0.3048)
    assert scaled.area == pytest.approx(hall.area * 0.3048**2)


def test_no_place_on_the_earth_and_nothing_at_all() -> None:
    with pytest.raises(MapError, match="no place on the earth in 'EPSG:3857'"):
        in_metres([shapely.box(9e7, 0, 9e7 + 9, 9)], FILE, "EPSG:3857")
    with pytest.warns(MapWarning), pytest.raises(MapError, match="no size of a building"):
        in_metres([shapely.box(0, 0, 9e4, 9)], FILE, "EPSG:3857")
    assert in_metres([], FILE) == []


def test_web_mercator_with_a_unit_is_taken_as_it_is() -> None:
    hall = shapely.box(1_527_000, 6_622_000, 1_527_010, 6_622_020)
    (found,) = in_metres([hall], Path("hall.geojson"), "EPSG:3857", 0.5)
    width, height = np.diff(np.reshape(found.bounds, (2, 2)), axis=0)[0]
    assert (width, height) == pytest.approx((5.0, 10.0))
