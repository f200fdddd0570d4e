"""Degrees of longitude and latitude as metres around a place: enough for a building."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from shapely import get_coordinates, transform
from shapely.geometry.base import BaseGeometry

from layoutexplore.errors import checks_arguments, checks_making
from layoutexplore.grids.arrays import Floats

METRES_PER_DEGREE = 111_320.0
"""Of latitude, and of longitude at the equator."""


@checks_making
class LocalFrame:
    """Metres east (x) and north (y) of a place on the earth.

    Args:
        longitude: Of the origin, in degrees (WGS84).
        latitude: Of the origin, in degrees.

    Example:
        >>> [round(float(v), 3) for v in LocalFrame(13.7, 60.0).to_metres(np.array([[13.701, 60.001]]))[0]]
        [55.66, 111.32]
    """

    def __init__(self, longitude: float, latitude: float) -> None:
        self.origin = np.array([longitude, latitude])
        self.scale = METRES_PER_DEGREE * np.array([math.cos(math.radians(latitude)), 1.0])

    @classmethod
    def around(cls, degrees: Floats) -> LocalFrame:
        """The frame with its origin at the lower left corner of points (n, 2) as (longitude, latitude)."""
        longitude, latitude = _unbroken(degrees).min(axis=0)
        return cls(float(longitude), float(latitude))

    def to_metres(self, degrees: Floats) -> Floats:
        """Points float64 (n, 2) as (x, y) in metres, of (longitude, latitude), to a tenth of a millimetre."""
        away = degrees - self.origin
        away[:, 0] -= 360.0 * np.round(away[:, 0] / 360.0)  # the short way round the earth
        return np.asarray(np.round(away * self.scale, 4), np.float64)

    def project(self, shape: BaseGeometry) -> Any:
        """A shape of (longitude, latitude) in metres."""
        return transform(shape, self.to_metres)


@checks_arguments
def looks_geographic(shape: BaseGeometry) -> bool:
    """Whether coordinates are degrees: a building of half a metre, near the origin of the earth's grid.

    Example:
        >>> import shapely
        >>> looks_geographic(shapely.box(30.37, 60.007, 30.373, 60.009))
        True
        >>> looks_geographic(shapely.box(0, 0, 20, 9))
        False
    """
    points = get_coordinates(shape)
    if not len(points):
        return False
    on_earth = np.abs(points[:, 0]).max() <= 180 and np.abs(points[:, 1]).max() <= 90
    return bool(on_earth and np.ptp(_unbroken(points), axis=0).max() < 0.5)


def _unbroken(degrees: Floats) -> Floats:
    """Points (longitude, latitude), those west of the date line beyond 180 where it runs between them."""
    broken = np.ptp(degrees[:, 0]) > 180
    return np.where(broken & (degrees < 0) & [True, False], degrees + 360.0, degrees)
