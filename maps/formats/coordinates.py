"""What the coordinates of a GeoJSON measure in, by the coordinate system (`crs`) that the file declares.

A building in degrees shows itself by its size. Web Mercator is stretched by 1 / cos(latitude), 1.6 in Central
Europe, and feet are no metres: neither shows, so that the code of EPSG or Esri has to tell.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from layoutexplore.errors import MapError, MapWarning, checks_arguments, shortened
from layoutexplore.grids.arrays import Floats
from layoutexplore.grids.ros_map import RESOLUTIONS
from layoutexplore.maps.formats.geographic import LocalFrame, looks_geographic

Measure = Literal["degrees", "mercator", "feet", "metres", "unknown"]

LARGEST_EXTENT = 5_000.0
"""Metres; a building this large is measured in something else than metres."""

FAR_AWAY = 1e6
"""Coordinates from which on a file without a coordinate system is of a country's or of Web Mercator."""

EARTH_RADIUS = 6_378_137.0
"""Metres; the sphere that Web Mercator unrolls."""

_DEGREES = (4326, 4258, 4267, 4269, 4283, 4979, 6318, 7844)
_MERCATOR = (3857, 3785, 900913, 102100, 102113)
_FEET = (
    *(range(2222, 2290), range(2867, 2931)),  # state planes of the United States by NAD83 and its HARN,
    *(range(3417, 3439), range(3441, 3447), range(3451, 3460), range(3560, 3571), range(3734, 3740)),
    *(range(2964, 2969), range(3753, 3761), range(26847, 26859), (2992, 2994, 3089, 3091)),
    *(range(3359, 3366, 2), (3404,)),
    *(range(26729, 26800), range(32001, 32059), (2204, 3080, 32099)),  # by NAD27,
    *(range(3479, 3488, 2), range(3490, 3513, 2), range(3515, 3554, 2), range(3582, 3591, 2), (3593,)),
    *((3598, 3600, 3605, 3608), range(3610, 3637, 2), range(3640, 3665, 2), range(3668, 3677, 2)),
    *((3677, 3679, 3680, 3682, 3683), range(3686, 3693, 2), range(3696, 3701, 2), range(3728, 3734)),
    range(26859, 26871),  # by NAD83(NSRS2007),
    *(range(6405, 6414, 2), range(6416, 6439, 2), range(6441, 6480, 2), range(6484, 6497, 2)),
    *(range(6499, 6508, 2), range(6519, 6566, 2), range(6568, 6579, 2), range(6582, 6591, 2)),
    *(range(6593, 6610, 2), range(6612, 6619, 2), range(6625, 6628), (6510, 6515, 6517, 9748, 9749)),
    # ... and by NAD83(2011). Blocks of the Gulf of Mexico.
    *(range(32064, 32068), range(32074, 32078), range(32164, 32168), range(32664, 32668)),
)
_METRES = (
    *(range(32601, 32661), range(32701, 32761), range(25828, 25838)),  # UTM by WGS84 and ETRS89,
    *(range(26901, 26924), range(26701, 26723), range(23028, 23039)),  # by NAD83, NAD27 and ED50.
    *(range(31254, 31260), range(31466, 31470), range(28348, 28359)),  # Austria, Germany, Australia.
    *((2056, 21781), (2154,), (27700,), (28992,), (3035,)),  # Switzerland, France, Britain, the Netherlands.
    *((3006,), (3067,), (2180,), (2193,)),  # Sweden, Finland, Poland, New Zealand.
)


@checks_arguments
def declared_crs(data: Any) -> str:
    """The name of the coordinate system that a FeatureCollection declares; "" where it declares none.

    Example:
        >>> declared_crs({"crs": {"type": "name", "properties": {"name": "EPSG:25833"}}})
        'EPSG:25833'
        >>> declared_crs({"crs": {"type": "EPSG", "properties": {"code": 3857}}}), declared_crs({"crs": None})
        ('EPSG:3857', '')
    """
    crs = data.get("crs") if isinstance(data, dict) else None
    told = crs.get("properties", crs) if isinstance(crs, dict) else crs
    if not isinstance(told, dict):
        return told if isinstance(told, str) else ""
    code = told.get("code")
    return str(told.get("name") or told.get("href") or (f"EPSG:{code}" if code else ""))


@checks_arguments
def measure_of(crs: str) -> Measure:
    """What coordinates of a system measure in; "unknown" of those whose code is not kept here.

    Args:
        crs: Its name, as "EPSG:3857", "urn:ogc:def:crs:EPSG::3857" or "urn:ogc:def:crs:OGC:1.3:CRS84".

    Example:
        >>> [measure_of(f"urn:ogc:def:crs:EPSG::{code}") for code in (4326, 900913, 2263, 32633, 1)]
        ['degrees', 'mercator', 'feet', 'metres', 'unknown']
        >>> measure_of("urn:ogc:def:crs:OGC:1.3:CRS84"), measure_of("EPSG:25833")
        ('degrees', 'metres')
    """
    if re.search(r"\bCRS(84|83|27)h?/*$", crs.strip()):
        return "degrees"
    code = _code(crs.strip())
    if not code and re.search(r"\b(?:web|pseudo)[ _-]?mercator", crs.replace("_", " "), re.IGNORECASE):
        return "mercator"
    if code in _DEGREES:
        return "degrees"
    if code in _MERCATOR:
        return "mercator"
    if any(code in codes for codes in _FEET):
        return "feet"
    return "metres" if any(code in codes for codes in _METRES) else "unknown"


def _code(crs: str) -> int:
    """The code in the name of a system; 0 without one. Of several, of place and height, it is the first."""
    named = r"(?:epsg|esri)(?:\.io|\.xml)?[:/#]+\s*(?:[\d.]+[:/]+)?(\d{4,6})(?!\d)"
    match = re.search(named, crs, re.IGNORECASE) or re.search(r"(?:^|[:/#])(\d{4,6})/*$", crs)
    return int(match[1]) if match else 0


@checks_arguments
def mercator_to_degrees(points: Floats) -> Floats:
    """Points float64 (n, 2) of Web Mercator as (longitude, latitude) in degrees.

    Example:
        >>> np.round(mercator_to_degrees(np.array([[1_527_670.0, 6_622_000.0]])), 3).tolist()
        [[13.723, 51.004]]
    """
    turns = np.asarray(points, np.float64) / EARTH_RADIUS
    radians = np.stack([turns[:, 0], np.arctan(np.sinh(turns[:, 1]))], axis=1)
    return np.asarray(np.degrees(radians), np.float64)


@checks_arguments
def in_metres(
    shapes: Sequence[BaseGeometry], path: Path, crs: str = "", unit: float | None = None
) -> list[BaseGeometry]:
    """The shapes of a file in metres: degrees and Web Mercator projected, others as they are.

    Args:
        shapes: All of the file: together they show whether they are in degrees.
        path: The file, for messages.
        crs: The coordinate system that it declares; "" for none.
        unit: Metres of what it measures in, Web Mercator as well; degrees, which are projected, are as many
            times as large. 1 when None.

    Raises:
        MapError: They measure in feet and no unit is given, or are no building in metres or degrees; the
            unit is none of a drawing.

    Warns:
        MapWarning: They were projected, or that they are metres is a guess.
    """
    everything = shapely.GeometryCollection(list(shapes))
    degrees = looks_geographic(everything)
    measure = measure_of(crs)
    if degrees or (measure == "mercator" and unit is None):
        shapes = _projected(shapes, path, "" if degrees else crs)
    elif unit is None:
        _check_unit(everything, path, crs, measure)
    if unit is not None:
        if not RESOLUTIONS[0] <= unit <= RESOLUTIONS[1]:
            raise MapError(f"{path}: {unit:g} m is no unit of a drawing: see --scale-by or --resolution")
        shapes = [shapely.transform(shape, lambda points: points * unit) for shape in shapes]
    x0, y0, x1, y1 = shapely.total_bounds(list(shapes)) if len(shapes) else np.zeros(4)
    if not degrees and max(x1 - x0, y1 - y0) > LARGEST_EXTENT:
        raise MapError(
            f"{path}: {x1 - x0:.0f} x {y1 - y0:.0f} is no size of a building in metres: export it in metres "
            "(a UTM zone) or as longitude and latitude (WGS84)"
        )
    return list(shapes)


def _projected(shapes: Sequence[BaseGeometry], path: Path, mercator: str) -> list[BaseGeometry]:
    """Shapes in degrees, or of the Web Mercator of that name, in metres of a frame around them."""
    if mercator:
        shapes = [shapely.transform(shape, mercator_to_degrees) for shape in shapes]
    points = shapely.get_coordinates(list(shapes))
    if mercator and len(points) and np.abs(points).max(axis=0)[0] > 180:
        raise MapError(f"{path}: its coordinates are no place on the earth in {shortened(mercator)}")
    said = f"{shortened(mercator)} (Web Mercator) is" if mercator else "longitude and latitude are"
    warnings.warn(f"{path}: {said} projected to metres", MapWarning, stacklevel=4)
    frame = LocalFrame.around(points) if len(points) else LocalFrame(0.0, 0.0)
    return [frame.project(shape) for shape in shapes]


def _check_unit(everything: BaseGeometry, path: Path, crs: str, measure: Measure) -> None:
    """Raise `MapError` for feet, and warn where nothing says that coordinates are metres."""
    if measure == "feet":
        raise MapError(
            f"{path}: its coordinates are feet ({shortened(crs)}): import it with --scale-by "
            "'1 ft = 1 unit', or export it in metres (a UTM zone)"
        )
    doubt = ""
    if measure == "degrees":
        doubt = f"they are too large for the degrees of {shortened(crs)} that the file declares"
    elif crs and measure == "unknown":
        doubt = f"the units of {shortened(crs)} are not known here"
    elif not crs and np.abs(shapely.get_coordinates(everything)).max(initial=0.0) >= FAR_AWAY:
        doubt = (
            "the file declares no coordinate system (crs), and in Web Mercator (EPSG:3857) a building is "
            "too large"
        )
    if doubt:
        warnings.warn(
            f"{path}: its coordinates are taken for metres: {doubt}; --scale-by says what they are",
            MapWarning,
            stacklevel=4,
        )
