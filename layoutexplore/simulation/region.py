"""A part of a building that an exploration keeps to: a polygon in metres, as a mask, and from a file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from layoutexplore.errors import ConfigError, checks_arguments, shortened
from layoutexplore.files import naming, read_json
from layoutexplore.frontiers.detection import FrontierClusters
from layoutexplore.grids.arrays import Mask
from layoutexplore.grids.polygons import fill, polygons_of
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.options import Rule

Region = tuple[tuple[float, float], ...]
"""Corners (x, y) in metres of a simple polygon, three or more."""

MOST_CORNERS = 10_000
"""More corners are no outline that somebody drew, and take long to check and to fill."""

_CORNER = Rule(count=2, low=-1e6, high=1e6)


def check_region(value: Any) -> Region | None:
    """The corners as a tuple of pairs of numbers; None stays None.

    Raises:
        ConfigError: They are not the corners of a polygon that has an area and does not cross itself.
    """
    if value is None:
        return None
    if not isinstance(value, (tuple, list)) or len(value) < 3:
        raise ConfigError(
            f"region must be a list of three corners [x, y] or more, in metres, got {shortened(value)}"
        )
    if len(value) > MOST_CORNERS:
        raise ConfigError(
            f"region has {len(value)} corners, and may have {MOST_CORNERS}: simplify its outline"
        )
    corners = tuple(_CORNER.convert(f"corner {k + 1} of region", corner) for k, corner in enumerate(value))
    polygon = shapely.Polygon(corners)
    if not polygon.is_valid or polygon.area == 0.0:
        raise ConfigError(
            f"region must be a polygon with an area that does not cross itself, got {shortened(value)}"
        )
    return tuple((float(x), float(y)) for x, y in corners)


@checks_arguments
def read_region(text: str) -> Region:
    """A region from a text "X,Y X,Y X,Y ..." or from a GeoJSON file that holds one polygon.

    Args:
        text: Corners in metres, or the path of a file whose name ends in .geojson or .json.

    Raises:
        ConfigError: It is neither.

    Example:
        >>> read_region("0,0 4,0 4,3")
        ((0.0, 0.0), (4.0, 0.0), (4.0, 3.0))
    """
    if text.lower().endswith((".geojson", ".json")):
        return _from_file(Path(text))
    try:
        corners = [tuple(float(part) for part in corner.split(",")) for corner in text.split()]
    except ValueError:
        corners = []
    if len(corners) < 3:
        raise ConfigError(
            "a region is a GeoJSON file, or three corners X,Y in metres or more in one text, as "
            f'"0,0 4,0 4,3", got {shortened(text)}'
        )
    region = check_region(corners)
    assert region is not None
    return region


def _from_file(path: Path) -> Region:
    """The outline of the only polygon in a file."""
    data = read_json(path, error=ConfigError, what="region")
    try:
        geometry = shapely.from_geojson(json.dumps(data))
    except (ValueError, shapely.errors.ShapelyError) as error:
        raise ConfigError(f"{path} is no GeoJSON: {shortened(str(error))}") from error
    polygons = polygons_of(geometry)
    if len(polygons) != 1 or polygons[0].interiors:
        raise ConfigError(
            f"{path}: a region is one polygon without holes, got {len(polygons)} polygons"
            + (" with holes" if any(polygon.interiors for polygon in polygons) else "")
        )
    with naming(path, ConfigError):
        region = check_region([list(corner[:2]) for corner in polygons[0].exterior.coords[:-1]])
    assert region is not None
    return region


def region_mask(raster: PlanRaster, region: Region) -> Mask:
    """Bool (rows, cols): the cells of a raster whose centres lie in a region."""
    cells = np.zeros(raster.shape, np.int32)
    fill(cells, shapely.Polygon(region), 1, raster.resolution, (raster.origin.x, raster.origin.y))
    return cells > 0


def clusters_inside(clusters: FrontierClusters, region: Mask) -> FrontierClusters:
    """Clusters without the cells outside of a region; those that are empty then fall away.

    Args:
        clusters: Of a grid.
        region: bool (rows, cols), of the same grid.

    Example:
        >>> cells = np.array([[0, 0], [0, 1], [0, 3]], np.int32)
        >>> clusters = FrontierClusters(cells, np.array([0, 2, 3]))
        >>> inside = clusters_inside(clusters, np.array([[False, True, True, False]]))
        >>> inside.cells.tolist(), inside.offsets.tolist()
        ([[0, 1]], [0, 1])
    """
    return clusters.chosen(region[clusters.cells[:, 0], clusters.cells[:, 1]])
