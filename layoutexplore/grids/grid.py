"""Occupancy grids: what the robot knows about the world, cell by cell.

The conventions are those of `nav_msgs/OccupancyGrid`: metres, x to the right, y up, row 0 at the LOWEST y, -1
unknown, 0 free, 100 occupied, and an origin that is the pose of the lower left corner of cell (0, 0).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from layoutexplore.errors import MapError, checks_calls, shortened
from layoutexplore.grids.arrays import Cells, Floats, Ints, Mask, shows_shapes

UNKNOWN, FREE, OCCUPIED = -1, 0, 100

FREE_UP_TO, OCCUPIED_FROM = 19, 65
"""Of a cell that holds a probability in per cent: up to this one it is free, from that one occupied (ROS)."""


class Pose(NamedTuple):
    """Position in metres and heading in radians, counter-clockwise from x."""

    x: float
    y: float
    theta: float = 0.0


class Cell(NamedTuple):
    """A grid cell; row 0 has the lowest y."""

    row: int
    col: int


@checks_calls
@shows_shapes
@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """A grid of int8 cells with a resolution and an origin.

    Attributes:
        cells: int8 (rows, cols); -1 unknown, 0 free, 100 occupied, between them a probability in per cent,
            which `trinary` decides. An array int8 is shared, not copied, and not searched for other values,
            which would take long on a large map: `check_cell_range` does.
        resolution: Side of a cell in metres.
        origin: Pose of the lower left corner of cell (0, 0) in the world.

    Raises:
        MapError: The array is empty, not two-dimensional or not integer, a value is outside -1..100 (where
            they are not int8), or the resolution or the origin is not a usable number.

    Example:
        >>> grid = OccupancyGrid(np.array([[0, 100], [-1, 0]], np.int8), resolution=0.5)
        >>> grid.world_to_cell(0.7, 0.1)
        Cell(row=0, col=1)
        >>> grid.cell_to_world(1, 0)
        (0.25, 0.75)
        >>> grid.free_area
        0.5
    """

    cells: Cells
    resolution: float
    origin: Pose = field(default=Pose(0.0, 0.0, 0.0))

    def __post_init__(self) -> None:
        cells = np.asarray(self.cells)
        if cells.ndim != 2 or cells.size == 0:
            raise MapError(f"a grid needs a non-empty two-dimensional array, got shape {cells.shape}")
        if not np.issubdtype(cells.dtype, np.integer):
            raise MapError(f"grid cells must be integers in -1..100, got dtype {cells.dtype}")
        if cells.dtype != np.int8:
            check_cell_range(cells)
            cells = cells.astype(np.int8)
        check_resolution(self.resolution)
        if len(self.origin) != 3 or not all(math.isfinite(v) for v in self.origin):
            raise MapError(f"the origin must be three finite numbers (x, y, yaw), got {tuple(self.origin)}")
        object.__setattr__(self, "cells", cells)
        # Of a number of NumPy's, kernels would be compiled once more, and count with the digits that it has.
        object.__setattr__(self, "resolution", float(self.resolution))
        object.__setattr__(self, "origin", Pose(*(float(v) for v in self.origin)))

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, cols)."""
        rows, cols = self.cells.shape
        return rows, cols

    @property
    def free(self) -> Mask:
        """Bool (rows, cols): cells known to be free (value 0)."""
        return np.equal(self.cells, FREE)

    @property
    def occupied(self) -> Mask:
        """Bool (rows, cols): cells known to be occupied (value 100)."""
        return np.equal(self.cells, OCCUPIED)

    @property
    def unknown(self) -> Mask:
        """Bool (rows, cols): cells of which nothing is known (value -1)."""
        return np.equal(self.cells, UNKNOWN)

    @property
    def trinary(self) -> OccupancyGrid:
        """The grid with nothing but -1, 0 and 100; itself where it holds nothing else.

        Cells of probabilities are decided as by ROS's map_server: up to 19 per cent they are free, from 65
        occupied, in between unknown.
        """
        if not ((self.cells > FREE) & (self.cells < OCCUPIED)).any():
            return self
        low = np.where(self.cells <= FREE_UP_TO, np.minimum(self.cells, FREE), UNKNOWN)
        cells = np.where(self.cells >= OCCUPIED_FROM, OCCUPIED, low).astype(np.int8)
        return OccupancyGrid(cells, self.resolution, self.origin)

    @property
    def free_area(self) -> float:
        """Area known to be free, in square metres."""
        return float(np.count_nonzero(self.free)) * self.resolution**2

    def world_to_cell(self, x: float, y: float) -> Cell:
        """The cell that holds a world point; it may lie outside the grid (see `contains`)."""
        dx, dy = x - self.origin.x, y - self.origin.y
        if self.origin.theta:
            c, s = math.cos(self.origin.theta), math.sin(self.origin.theta)
            dx, dy = c * dx + s * dy, c * dy - s * dx
        return Cell(math.floor(dy / self.resolution), math.floor(dx / self.resolution))

    def nearest_cell(self, x: float, y: float) -> Cell:
        """The cell of the grid nearest to a world point: the one that holds it, for a point inside."""
        cell, (rows, cols) = self.world_to_cell(x, y), self.shape
        return Cell(min(max(cell.row, 0), rows - 1), min(max(cell.col, 0), cols - 1))

    def cell_to_world(self, row: float, col: float) -> tuple[float, float]:
        """World coordinates (x, y) of a cell's centre."""
        dx, dy = (col + 0.5) * self.resolution, (row + 0.5) * self.resolution
        if self.origin.theta:
            c, s = math.cos(self.origin.theta), math.sin(self.origin.theta)
            dx, dy = c * dx - s * dy, s * dx + c * dy
        return self.origin.x + dx, self.origin.y + dy

    def cells_to_world(self, cells: ArrayLike) -> Floats:
        """World points float64 (n, 2) as (x, y) of the centres of cells (n, 2) as (row, col)."""
        rc = _pairs(cells)
        local = (rc[:, ::-1] + 0.5) * self.resolution
        c, s = math.cos(self.origin.theta), math.sin(self.origin.theta)
        points: Floats = local @ np.array([[c, s], [-s, c]]) + np.array([self.origin.x, self.origin.y])
        return points

    def world_to_cells(self, points: ArrayLike) -> Ints:
        """Cells int64 (n, 2) as (row, col) that hold world points (n, 2) as (x, y)."""
        local = _pairs(points) - np.array([self.origin.x, self.origin.y])
        c, s = math.cos(self.origin.theta), math.sin(self.origin.theta)
        cells: Ints = np.floor(local @ np.array([[c, -s], [s, c]]) / self.resolution).astype(np.int64)[
            :, ::-1
        ]
        return cells

    def contains(self, row: int, col: int) -> bool:
        """Whether the cell lies inside the grid."""
        rows, cols = self.shape
        return 0 <= row < rows and 0 <= col < cols


def _pairs(values: ArrayLike) -> Floats:
    """float64 (n, 2) of one pair, of many, or of none."""
    if isinstance(values, range):
        raise MapError(f"expected rows of two numbers, got {values}")
    array = np.asarray(values, np.float64)
    if array.size and array.shape[-1:] != (2,):
        raise MapError(f"expected rows of two numbers, got an array of shape {array.shape}")
    return array.reshape(-1, 2)


def check_cell_range(cells: NDArray[np.generic]) -> None:
    """Raise `MapError` where a cell lies outside -1..100, naming the first one."""
    values = np.asarray(cells)
    bad = (values < -1) | (values > 100)
    if bad.any():
        row, col = np.argwhere(bad)[0]
        raise MapError(
            f"cell ({row}, {col}) holds {values[row, col]}: grid cells must be -1 (unknown) or 0..100"
        )


def in_cells(metres: float, resolution: float) -> int:
    """A length in whole cells, one at least.

    Example:
        >>> in_cells(0.15, 0.05), in_cells(0.15, 0.025), in_cells(0.02, 0.1)
        (3, 6, 1)
    """
    return max(round(metres / resolution), 1)


CELL_SIZES = (1e-5, 1e4)
"""Metres; with cells outside of these, coordinates leave what numbers can tell apart."""


def check_resolution(resolution: float) -> None:
    """Raise `MapError` unless the resolution is a number of metres above 0, and of the size of some cell."""
    low, high = CELL_SIZES
    if not isinstance(resolution, (int, float, np.number)) or not low <= resolution <= high:
        raise MapError(
            f"the resolution must be a number of metres above 0, from {low:g} to {high:g}, "
            f"got {shortened(resolution)}"
        )
