"""Polygons as files hold them: mended where they cross themselves, with what was mended counted."""

from __future__ import annotations

import warnings
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from layoutexplore.errors import MapWarning, checks_arguments
from layoutexplore.grids.polygons import polygons_of, shape_of
from layoutexplore.maps.sizes import MOST_METRES, check_count, check_outlines

LEAST_AREA = 0.05
"""Square metres; smaller parts of a polygon are slips of a hand."""

LEAST_ROOM = 1.0
"""Square metres; smaller parts of a room that fell apart are no rooms of their own."""

MOST_KINDS = 20
"""Of what is left out or mended, that one warning names: a file may have made up thousands."""


class Dropped:
    """Counts what a reader leaves out or mends, and says it once at the end.

    Args:
        path: The file.

    Example:
        >>> dropped = Dropped(Path("a.osm"))
        >>> dropped.add("rooms without an outline")
        >>> dropped.counts
        Counter({'rooms without an outline': 1})
    """

    def __init__(self, path: Path | str) -> None:
        self.path = str(path)
        self.counts: Counter[str] = Counter()
        self.crossings = 0

    def add(self, what: str) -> None:
        """Count one of these."""
        self.counts[what] += 1

    def warn(self) -> None:
        """Say what was left out or mended, if anything was."""
        if self.counts:
            said = [f"{count} {what}" for what, count in self.counts.items()]
            more = [f"and {len(said) - MOST_KINDS} other kinds"] if len(said) > MOST_KINDS else []
            text = ", ".join(said[:MOST_KINDS] + more)
            warnings.warn(f"{self.path}: {text}", MapWarning, stacklevel=3)


@checks_arguments
def geometry_of(feature: Any) -> BaseGeometry:
    """The flat geometry of a GeoJSON feature; an empty polygon where it has none that can be read.

    Example:
        >>> geometry_of({"geometry": {"type": "Point", "coordinates": [1, 2, 3]}}).wkt
        'POINT (1 2)'
    """
    try:
        with np.errstate(invalid="ignore"):  # shapely warns about NaN; without it there is no geometry
            whole: BaseGeometry = shapely.force_2d(shape_of(feature["geometry"]))
    except Exception:  # whatever shapely, GEOS and NumPy say of coordinates that are none
        return Polygon()
    return whole if (np.abs(shapely.get_coordinates(whole)) <= MOST_METRES).all() else Polygon()


@checks_arguments
def mended(shape: BaseGeometry, dropped: Dropped) -> list[Polygon]:
    """The valid polygons of a shape in metres, the largest first; without area, none.

    Args:
        shape: Polygons, valid or not.
        dropped: Is told of shapes that cross themselves or have no area.

    Raises:
        MapError: Its corners are too many or too far away, or it crosses itself too often.
    """
    found = check_outlines(dropped.path, [shape])
    if not shape.is_valid:
        dropped.crossings += found
        check_count(dropped.path, "places where outlines cross themselves", dropped.crossings, "crossings")
        dropped.add("polygons crossed themselves and are mended")
        shape = shapely.make_valid(shape, method="structure", keep_collapsed=False)
    parts = [part for part in polygons_of(shape) if part.area >= LEAST_AREA]
    if not parts:
        dropped.add("polygons without area are left out")
    return sorted(parts, key=lambda part: -part.area)


@checks_arguments
def room_parts(shape: BaseGeometry, dropped: Dropped) -> list[Polygon]:
    """The rooms that the shape of one is, the largest first: several where it falls apart, as a bow tie does.

    Args:
        shape: Polygons in metres, valid or not.
        dropped: Is told of shapes that cross themselves or have no area, and of parts too small for a room.

    Raises:
        MapError: As of `mended`.

    Example:
        >>> bow = Polygon([(0, 0), (4, 3), (4, 0), (0, 3)])
        >>> [part.area for part in room_parts(bow, Dropped("a.geojson"))]
        [3.0, 3.0]
    """
    parts = mended(shape, dropped)
    rooms = [part for k, part in enumerate(parts) if k == 0 or part.area >= LEAST_ROOM]
    for _ in parts[len(rooms) :]:
        dropped.add("parts of rooms are left out")
    return rooms
