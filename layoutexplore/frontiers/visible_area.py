"""The visible unknown area of a place: what a robot could see from there, as far as it knows."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit

from layoutexplore.errors import ConfigError, checks_making
from layoutexplore.frontiers.detection import check_grid
from layoutexplore.grids.arrays import Cells, Floats, Ints, Ints32
from layoutexplore.grids.boxes import Box
from layoutexplore.grids.grid import OCCUPIED, UNKNOWN, check_resolution
from layoutexplore.grids.rays import ray_frame


def visible_unknown_area(
    cells: Cells, viewpoints: Ints32, resolution: float, range_max: float, rays: int = 120
) -> Floats:
    """Unknown area that rays from viewpoints would cross, through unknown and free cells alike.

    Equally spaced rays leave the viewpoint's centre and end at an occupied cell, at the range or at the edge
    of the grid. A run of unknown cells from distance a to b on a ray stands for the piece of ring that
    the ray's share of the full turn cuts out there: (b^2 - a^2) * pi / rays.

    Args:
        cells: int8 (rows, cols).
        viewpoints: int32 (n, 2) as (row, col), inside the grid.
        resolution: Side of a cell in metres.
        range_max: How far to look, in metres.
        rays: Number of rays.

    Returns:
        float64 (n,) in square metres.

    Raises:
        ConfigError: A viewpoint lies outside of the grid, or range or rays are not above 0.

    Example:
        >>> cells = np.full((101, 101), -1, np.int8)
        >>> area = visible_unknown_area(cells, np.array([[50, 50]], np.int32), 0.1, 3.0)
        >>> area.round(1).tolist()  # pi * 3.0 ** 2
        [28.3]
    """
    cells = check_grid(cells)
    check_resolution(resolution)
    if not (math.isfinite(range_max) and range_max > 0 and rays >= 1):
        raise ConfigError(f"range_max and rays must be above 0, got {range_max} and {rays}")
    points = np.ascontiguousarray(np.asarray(viewpoints).reshape(-1, 2), np.int32)
    if points.size and ((points < 0).any() or (points >= cells.shape).any()):
        raise ConfigError(f"a viewpoint lies outside of the grid of shape {cells.shape}")
    # Of numbers of NumPy's, the kernel would be compiled once more, and count with the digits that they have.
    view = VisibleUnknownArea(cells.shape, float(resolution), float(range_max), rays)
    return view.areas(cells, points, (0, 0, 0, 0))


@checks_making
class VisibleUnknownArea:
    """The visible unknown area of places, as `visible_unknown_area` has it, on a grid that changes.

    The rays from a place read cells of a small box. As long as nothing in it changes, the area is kept.

    Args:
        shape: (rows, cols) of the grid.
        resolution: Side of a cell in metres.
        range_max: How far to look, in metres.
        rays: Number of rays.
    """

    def __init__(self, shape: tuple[int, ...], resolution: float, range_max: float, rays: int) -> None:
        reach = range_max / resolution
        self._rays, self._end = ray_table(int(rays), reach), reach * reach
        self._offsets = _flat_offsets(int(rays), reach, shape[1])
        self._unit = math.pi / rays * resolution**2
        self._places, self._areas = np.empty((0, 2), np.int32), np.empty(0)
        self._boxes = np.empty((0, 4), np.int64)

    def areas(self, cells: Cells, places: Ints32, changed: Box) -> Floats:
        """Areas float64 (n,) in square metres for places int32 (n, 2), on a grid int8 (rows, cols).

        Args:
            cells: The grid.
            places: As (row, col), inside the grid.
            changed: (row0, row1, col0, col1), half open, around all cells that changed since the last call.
        """
        areas, boxes = np.empty(len(places)), np.empty((len(places), 4), np.int64)
        fresh = _still_valid(self._places, self._areas, self._boxes, places, np.array(changed), areas, boxes)
        _unknown_area(cells, places, fresh, self._rays, self._offsets, self._end, areas, boxes)
        self._places, self._areas, self._boxes = places, areas, boxes
        return areas * self._unit


class RayTable(NamedTuple):
    """The cells that rays from a cell's centre cross, ray after ray; numba kernels take it as it is.

    Attributes:
        rows: int64 (n,), row offsets of the cells.
        cols: int64 (n,), column offsets.
        entered: float64 (n,), squared distance in cells at which the ray enters the cell.
        starts: int64 (rays + 1,): ray i has the entries from `starts[i]` up to, but without, `starts[i + 1]`.
    """

    rows: Ints
    cols: Ints
    entered: Floats
    starts: Ints


@lru_cache(maxsize=8)
def ray_table(rays: int, reach: float) -> RayTable:
    """The table of equally spaced rays that reach so many cells; the same from every viewpoint, so kept."""
    rows, cols, entered, starts = [], [], [], [0]
    for ray in range(rays):
        # Half a step off the axes: a ray along the row of a cell's centre would stand for its whole share of
        # the turn.
        angle = (ray + 0.5) * (2 * math.pi / rays)
        dx, dy = math.cos(angle), math.sin(angle)
        along, across, slope, per_along, per_across, x_leads = ray_frame(0.5, 0.5, dx, dy)
        crossed, j = [(0, 0, 0.0)], 0
        for k in range(1, math.ceil(reach) + 2):
            n = int(across + slope * (k - along))
            if n != j:
                crossed.append((k - 1, n, (n - across) * per_across))
            crossed.append((k, n, (k - along) * per_along))
            j = n
        step_x, step_y = (1 if dx >= 0 else -1), (1 if dy >= 0 else -1)
        for k, n, at in crossed:
            if at < reach:
                rows.append(step_y * (n if x_leads else k))
                cols.append(step_x * (k if x_leads else n))
                entered.append(at * at)
        starts.append(len(rows))
    return RayTable(np.array(rows), np.array(cols), np.array(entered), np.array(starts))


@lru_cache(maxsize=8)
def _flat_offsets(rays: int, reach: float, width: int) -> Ints:
    """The offsets int64 (n,) of `ray_table` in a ravelled grid of that width."""
    table = ray_table(rays, reach)
    return table.rows * width + table.cols


@njit(cache=True, nogil=True)
def _still_valid(
    old_places: Ints32,
    old_areas: Floats,
    old_boxes: Ints,
    places: Ints32,
    changed: Ints,
    areas: Floats,
    boxes: Ints,
) -> Ints:
    """Take over the areas of places in whose boxes nothing changed; the numbers of the other places."""
    fresh = np.empty(len(places), np.int64)
    count = 0
    for k in range(len(places)):
        found = -1
        for j in range(len(old_places)):
            if old_places[j, 0] == places[k, 0] and old_places[j, 1] == places[k, 1]:
                found = j
                break
        if found >= 0:
            row0, row1, col0, col1 = old_boxes[found]
            # Both boxes are half open: where one ends as the other begins, no cell that was read changed.
            if row0 >= changed[1] or changed[0] >= row1 or col0 >= changed[3] or changed[2] >= col1:
                areas[k], boxes[k] = old_areas[found], old_boxes[found]
                continue
        fresh[count] = k
        count += 1
    return fresh[:count]


@njit(cache=True, nogil=True)
def _unknown_area(
    cells: Cells,
    places: Ints32,
    numbers: Ints,
    rays: RayTable,
    offsets: Ints,
    end: float,
    areas: Floats,
    boxes: Ints,
) -> None:
    """Sum over the rays of b^2 - a^2 for each unknown run from a to b, in cells; `end` is the squared range.

    Written for the places of these numbers, with the box (half open) of the cells that were read. The grid's
    edge ends a ray. `offsets` are those of the rays' cells in the ravelled grid.
    """
    flat, (rows, cols, entered, starts) = cells.ravel(), rays
    for k in numbers:
        row, col = np.int64(places[k, 0]), np.int64(places[k, 1])
        here = row * cells.shape[1] + col
        top, bottom, right, left = cells.shape[0] - row, -row, cells.shape[1] - col, -col
        low_row, high_row, low_col, high_col = np.int64(0), np.int64(0), np.int64(0), np.int64(0)
        total = 0.0
        for ray in range(starts.size - 1):
            unknown = False
            last = starts[ray + 1] - 1
            # Rows and columns of a ray only grow, or only shrink: where its end is inside, all of it is.
            inside = bottom <= rows[last] < top and left <= cols[last] < right
            for n in range(starts[ray], starts[ray + 1]):
                # Outside of the grid counts as occupied. The index is unsigned: then numba does not wrap it.
                if not inside and not (bottom <= rows[n] < top and left <= cols[n] < right):
                    value = np.int64(OCCUPIED)
                else:
                    value = np.int64(flat[np.uint64(here + offsets[n])])
                if value == OCCUPIED:
                    if unknown:
                        total += entered[n]
                    unknown = False
                    last = n
                    break
                if (value == UNKNOWN) != unknown:
                    unknown = not unknown
                    total += -entered[n] if unknown else entered[n]
            if unknown:
                total += end
            # The last cell read of a ray is the farthest: the box around the ends holds all that was read.
            low_row, high_row = min(low_row, rows[last]), max(high_row, rows[last])
            low_col, high_col = min(low_col, cols[last]), max(high_col, cols[last])
        areas[k] = total
        boxes[k] = (row + low_row, row + high_row + 1, col + low_col, col + high_col + 1)
