"""The few geometric helpers that shapely lacks: exact polygon fill on a grid, and walls that cannot leak.

One rule makes rasters of walls trustworthy at any resolution: *no step between the centres of two
neighbouring cells crosses a wall*. A polygon is scanned along the lines through the cell centres, rows and
columns. Where a line runs through the polygon, every cell whose centre lies inside is filled (the usual
even-odd rule, holes included); where it crosses a part so thin that no centre lies inside, the cell that
holds the middle of the crossing is filled. Thick walls keep their exact area, thin ones become one cell, and
openings do not shrink. `seal_diagonals` then removes the spots where two solid cells touch at a corner only,
so that not even a diagonal step or a ray slips through.

Grid coordinates follow the house: row 0 at the lowest y, `origin` is the lower left corner of cell (0, 0).
"""

from __future__ import annotations

from numbers import Real
from typing import Any

import numpy as np
import shapely
from numba import njit
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry import shape as as_shape
from shapely.geometry.base import BaseGeometry

from layoutexplore.errors import shortened
from layoutexplore.grids.arrays import Floats, Mask

Point = tuple[float, float]
"""World point (x, y) in metres."""


def polygons_of(geometry: BaseGeometry) -> list[Polygon]:
    """The non-empty polygons of a geometry of any kind; lines and points are left out.

    Example:
        >>> pair = shapely.MultiPolygon([shapely.box(0, 0, 1, 1), shapely.box(2, 0, 4, 1)])
        >>> [p.area for p in polygons_of(pair)]
        [1.0, 2.0]
    """
    if isinstance(geometry, Polygon):
        return [] if geometry.is_empty else [geometry]
    return [polygon for part in getattr(geometry, "geoms", ()) for polygon in polygons_of(part)]


class NearbyPolygons:
    """Thousands of polygons with thousands of holes, of which an overlay with something small needs few.

    Args:
        whole: Polygons of any kind.
    """

    def __init__(self, whole: BaseGeometry) -> None:
        self._whole = polygons_of(whole)
        self._tree = shapely.STRtree(self._whole)
        self._holes = [
            (np.array(polygon.interiors, object), shapely.STRtree(polygon.interiors))
            for polygon in self._whole
        ]

    def around(self, shape: BaseGeometry) -> BaseGeometry:
        """The polygons that a shape meets, without the holes that its box does not: within it the same."""
        parts = []
        for k in np.sort(self._tree.query(shape, "intersects")).tolist():
            polygon, (holes, tree) = self._whole[k], self._holes[k]
            met = holes[np.sort(tree.query(shape))]
            parts.append(polygon if len(met) == len(holes) else Polygon(polygon.exterior, met))
        return parts[0] if len(parts) == 1 else shapely.MultiPolygon(parts)


def shape_of(data: Any) -> BaseGeometry:
    """The shape of a GeoJSON geometry; shapely alone takes flags and texts for numbers.

    Raises:
        Exception: Of any kind, as shapely does: its coordinates are no nested lists of numbers, or no shape.

    Example:
        >>> shape_of({"type": "Point", "coordinates": [1, True]})
        Traceback (most recent call last):
        ...
        ValueError: a coordinate must be a number, got True
    """
    waiting = [data]
    while waiting:
        part = waiting.pop()
        for inside in part.get("geometries") or [part["coordinates"]] if isinstance(part, dict) else part:
            if isinstance(inside, (dict, list, tuple)):
                waiting.append(inside)
            elif isinstance(inside, bool) or not isinstance(inside, Real):
                raise ValueError(f"a coordinate must be a number, got {shortened(inside)}")
    return as_shape(data)


def valid_polygons(polygons: Any) -> list[Polygon]:
    """Polygons object (k,), each whose boundary crosses or touches itself replaced by its largest valid part.

    Moved polygons need it too: a corner that lies on another side can lie across it once both are rounded.

    Example:
        >>> bow_tie = Polygon([(0, 0), (2, 2), (2, 0), (0, 2)])
        >>> valid_polygons(np.array([bow_tie], object))[0].area
        1.0
    """
    found: list[Polygon] = polygons.tolist()
    for k in np.flatnonzero(~shapely.is_valid(polygons)).tolist():
        parts = polygons_of(shapely.make_valid(found[k], method="structure", keep_collapsed=False))
        found[k] = max(parts, key=lambda p: float(p.area), default=Polygon())
    return found


def still_valid(moved: BaseGeometry) -> BaseGeometry:
    """A shape whose corners were moved and rounded, mended where its boundary crosses itself since then.

    A polygon stays one, the largest valid part; polygons of several stay together.

    Args:
        moved: A polygon or several, valid before all its corners were moved alike.

    Example:
        >>> still_valid(Polygon([(0, 0), (2, 2), (2, 0), (0, 2)])).is_valid
        True
    """
    if moved.is_valid:
        return moved
    if isinstance(moved, Polygon):
        return valid_polygons(np.array([moved], object))[0]
    mended: BaseGeometry = shapely.make_valid(moved, method="structure", keep_collapsed=False)
    return mended


class Nearness:
    """Distances of places from one shape that has thousands of corners: an index of its border is made once.

    Args:
        shape: A polygon or a line.

    Example:
        >>> Nearness(shapely.box(0, 0, 2, 1)).distances(shapely.points([(1, 0.5), (5, 5)])).tolist()
        [0.0, 5.0]
    """

    def __init__(self, shape: BaseGeometry) -> None:
        self._shape = shape
        self._border = shape.boundary if isinstance(shape, Polygon) else shape
        # GEOS looks for the nearest place by an index where lines are prepared, not where polygons are.
        shapely.prepare([self._shape, self._border])

    def distances(self, places: Any) -> Floats:
        """Metres float64 (n,) from points object (n,), 0 inside of the shape."""
        # GEOS divides by the square of each edge's length, heeds that this may be 0, and NumPy tells of it.
        with np.errstate(divide="ignore", invalid="ignore"):
            ways = shapely.length(shapely.shortest_line(self._border, places))
        return np.where(shapely.intersects(self._shape, places), 0.0, ways)


def fill(
    target: NDArray[np.integer[Any]],
    geometry: BaseGeometry,
    value: int,
    resolution: float,
    origin: Point,
    *,
    sealed: bool = False,
) -> None:
    """Write `value` into the cells whose centre lies in the geometry's polygons, in place.

    Args:
        target: Integers (rows, cols), C-contiguous.
        geometry: Valid polygons in metres; overlapping parts are fine.
        value: What to write.
        resolution: Side of a cell in metres.
        origin: World point of the lower left corner of cell (0, 0).
        sealed: Parts thinner than a cell also get the cells they pass through, so that no step between the
            centres of neighbouring cells crosses them (for walls).

    Example:
        >>> target = np.zeros((2, 3), np.int32)
        >>> fill(target, shapely.box(0.1, 0.0, 2.0, 1.0), 7, 1.0, (0.0, 0.0))
        >>> target.tolist()
        [[7, 7, 0], [0, 0, 0]]
    """
    for polygon in polygons_of(geometry):
        edges = _edges(polygon, resolution, origin)
        _fill(edges, target, value, False, sealed)
        if sealed:
            _fill(edges[:, [1, 0, 3, 2]].copy(), target, value, True, True)


def _in_cells(points: Floats, resolution: float, origin: Point) -> Floats:
    """Points (n, 2) in cells, so that whole numbers are the centres of cells."""
    # 1e-6 of a cell: a wall that was drawn on the centre line counts as on it, whatever the rounding
    return np.asarray(np.round((points - np.asarray(origin)) / resolution - 0.5, 6))


def _edges(polygon: Polygon, resolution: float, origin: Point) -> Floats:
    """Edges float64 (n, 4) as (u0, v0, u1, v1) in cells, so that whole numbers are the centres of cells."""
    rings = [polygon.exterior, *polygon.interiors]
    pieces = []
    for ring in rings:
        points = _in_cells(shapely.get_coordinates(ring), resolution, origin)
        pieces.append(np.hstack([points[:-1], points[1:]]))
    return np.ascontiguousarray(np.vstack(pieces))


@njit(cache=True, nogil=True)
def _fill(edges: Floats, target: NDArray[Any], value: int, transposed: bool, thin: bool) -> None:
    """Even-odd scan along the lines v = 0, 1, ...; transposed: only the thin crossings, of the columns."""
    lines, cells = target.shape
    if transposed:
        cells, lines = lines, cells
    # Only the lines between the lowest and the highest corner are looked at.
    lowest, highest = np.inf, -np.inf
    for k in range(edges.shape[0]):
        lowest = min(lowest, edges[k, 1], edges[k, 3])
        highest = max(highest, edges[k, 1], edges[k, 3])
    low = max(0, int(np.ceil(lowest)))
    high = max(low, min(lines, int(np.ceil(highest))))
    # First count the crossings of each line, then write them line by line. An edge crosses v0 <= line < v1,
    # half open, so that a corner on a line counts once and horizontal edges not at all.
    start = np.zeros(high - low + 1, np.int64)
    for k in range(edges.shape[0]):
        v0, v1 = min(edges[k, 1], edges[k, 3]), max(edges[k, 1], edges[k, 3])
        for line in range(max(low, int(np.ceil(v0))), min(high, int(np.ceil(v1)))):
            start[line - low + 1] += 1
    for line in range(high - low):
        start[line + 1] += start[line]
    crossings = np.empty(start[-1], np.float64)
    end = start[:-1].copy()
    for k in range(edges.shape[0]):
        u0, v0, u1, v1 = edges[k, 0], edges[k, 1], edges[k, 2], edges[k, 3]
        if v0 > v1:
            u0, v0, u1, v1 = u1, v1, u0, v0
        for line in range(max(low, int(np.ceil(v0))), min(high, int(np.ceil(v1)))):
            crossings[end[line - low]] = u0 + (line - v0) * (u1 - u0) / (v1 - v0)
            end[line - low] += 1
    for line in range(low, high):
        row = crossings[start[line - low] : start[line - low + 1]]
        if row.size > 2:
            row.sort()  # takes far longer than all else, where there are two
        elif row.size == 2 and row[0] > row[1]:
            row[0], row[1] = row[1], row[0]
        # Between an even crossing and the next one lies the inside.
        for k in range(0, row.size - 1, 2):
            first, last = int(np.ceil(row[k])), int(np.ceil(row[k + 1])) - 1
            if first > last:
                if thin and row[k] < row[k + 1]:
                    middle = int(np.floor(0.5 * (row[k] + row[k + 1]) + 0.5))
                    if 0 <= middle < cells:
                        if transposed:
                            target[middle, line] = value
                        else:
                            target[line, middle] = value
            elif not transposed:
                target[line, max(first, 0) : max(min(last, cells - 1) + 1, 0)] = value
            elif 0 <= last < cells and not (target[max(first, 0) : last + 1, line] == value).any():
                # a centre on the edge lies inside along the columns, and along the rows it did not
                target[last, line] = value


def seal_diagonals(occupied: Mask) -> Mask:
    """A copy in which no two solid cells touch at a corner only: one of the free cells beside it is filled.

    Args:
        occupied: bool (rows, cols).

    Example:
        >>> seal_diagonals(np.array([[True, False], [False, True]])).sum()
        np.int64(3)
    """
    sealed = np.ascontiguousarray(occupied, np.bool_).copy()
    while _seal_pass(sealed):
        pass
    return sealed


@njit(cache=True, nogil=True)
def _solid_sides(solid: Mask, r: int, c: int) -> int:
    """How many of the four neighbours are solid; outside the grid counts as solid."""
    rows, cols = solid.shape
    up, down = r + 1 >= rows or solid[r + 1, c], r == 0 or solid[r - 1, c]
    left, right = c == 0 or solid[r, c - 1], c + 1 >= cols or solid[r, c + 1]
    return int(up) + int(down) + int(left) + int(right)


@njit(cache=True, nogil=True)
def _seal_pass(solid: Mask) -> int:
    """Fill the free cell of each checkerboard that has more solid neighbours; how many were filled."""
    rows, cols = solid.shape
    filled = 0
    for r in range(rows - 1):
        for c in range(cols - 1):
            here = solid[r, c]
            if here == solid[r + 1, c + 1] and solid[r, c + 1] == solid[r + 1, c] and here != solid[r, c + 1]:
                low = c + 1 if here else c  # the free cell of row r; the other one lies in row r + 1
                high = c if here else c + 1
                if _solid_sides(solid, r, low) >= _solid_sides(solid, r + 1, high):
                    solid[r, low] = True
                else:
                    solid[r + 1, high] = True
                filled += 1
    return filled


def resample_solid(occupied: Mask, ratios: Point, offset: Point, shape: tuple[int, int]) -> Mask:
    """Solid cells of a raster at another resolution, by the same rule as `fill` with `sealed`.

    A cell is solid where its centre lies in a solid cell of the source, or outside of it; a run of solid
    source cells along a centre line that holds no centre makes the cell solid that holds its middle.

    Args:
        occupied: bool (rows, cols), the source.
        ratios: New resolution over the source's resolution, along (x, y).
        offset: (x, y) of the new lower left corner in source cells from the source's.
        shape: New (rows, cols).
    """
    source = np.ascontiguousarray(np.pad(occupied, 1, constant_values=True))
    target = np.ones(shape, np.bool_)
    x, y = offset[0] + 1.0, offset[1] + 1.0
    _resample_lines(source, ratios, (x, y), target, False)
    _resample_lines(np.ascontiguousarray(source.T), ratios[::-1], (y, x), target, True)
    return target


@njit(cache=True, nogil=True)
def _resample_lines(source: Mask, ratios: Point, corner: Point, target: Mask, transposed: bool) -> None:
    """Along every centre line: copy the centres (first pass only), then mark the runs that hold no centre."""
    (ratio, line_ratio), (x, y) = ratios, corner
    lines, cells = target.shape
    if transposed:
        cells, lines = lines, cells
    rows, cols = source.shape
    # 1e-9: a centre on the border of two source cells belongs to the upper one, however it is rounded.
    for line in range(lines):
        row = int(np.floor(y + (line + 0.5) * line_ratio + 1e-9))
        if row < 0 or row >= rows:
            continue
        if not transposed:
            for cell in range(cells):
                col = int(np.floor(x + (cell + 0.5) * ratio + 1e-9))
                if 0 <= col < cols:
                    target[line, cell] = source[row, col]
        col = 0
        while col < cols:
            if not source[row, col]:
                col += 1
                continue
            begin = col
            while col < cols and source[row, col]:
                col += 1
            u0, u1 = (begin - x) / ratio - 0.5 - 1e-9, (col - x) / ratio - 0.5 - 1e-9
            if int(np.ceil(u0)) > int(np.ceil(u1)) - 1:
                middle = int(np.floor(0.5 * (u0 + u1) + 0.5))
                if 0 <= middle < cells:
                    if transposed:
                        target[middle, line] = True
                    else:
                        target[line, middle] = True
