"""A map turned upright for predictors whose features look along rows and columns, and rooms turned back.

A robot's map lies in its world as the robot began, a plan with geographic coordinates as its street runs: the
walls of either seldom run along rows and columns. There the doorways are not found and the shapes of rooms
are not understood by models that have learnt from upright plans. What lies within `LEAST` of upright stays as
it is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.frontiers.decision import Decision
from layoutexplore.frontiers.detection import FrontierClusters
from layoutexplore.grids.arrays import Cells, Floats, Floats32, Ints, Ints32, Mask
from layoutexplore.grids.flood import grow_labels
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, in_cells
from layoutexplore.grids.morphology import with_neighbours
from layoutexplore.layout.alignment import Turned, places, turn, turn_back, turned_places
from layoutexplore.predictors.protocol import RoomLabels, RoomsOnGrid

LEAST = math.radians(3.0)
"""A map whose walls lie closer to the axes than this is left as it is."""

SHARPER = 1.2
"""A map is turned if its walls are in line so many times better when turned than as they are."""

STEP = 0.3
"""Metres: so short a break in a line of wall is filled, for a turned wall steps to and fro by a cell."""

CLEARER, _OTHER = 1.3, 9.0
"""And so many times better than in any direction that lies so many degrees away: where wings of a building
run in several directions, or walls bend, there is no upright."""

_HELD, _AS_SHARP = math.radians(2.5), 0.9
"""In an exploration the angle before is held while the sharpest one lies as near to it as this, and while it
is at least so many times as sharp: a view by another angle shares no cell with those before."""

_COARSE = 3.0
"""Degrees between the angles that are tried first; then every degree is."""

_POINTS = 1000
"""So many points of walls are looked at, or fewer, however large the map is."""

_STRIP = 0.2
"""Metres: what lies in a strip as wide as this is in line."""

T = TypeVar("T", np.int32, np.bool_, np.float32)


@dataclass(frozen=True, eq=False)
class UprightView:
    """A grid as predictors look at it.

    Attributes:
        grid: The grid, turned if need be.
        clusters: The frontiers' cells in it, free ones all.
        turned: How it was turned; None where it is the grid itself.
    """

    grid: OccupancyGrid
    clusters: FrontierClusters
    turned: Turned | None

    def rooms(self, found: RoomsOnGrid, name: str, grid: OccupancyGrid) -> RoomsOnGrid:
        """Rooms found in this view as rooms of the grid, for the predictor of that name."""
        return found if self.turned is None else UprightRooms(name, grid, found, self.turned)


class UprightViews:
    """The upright views of an exploration's decisions, turned by the same angle as long as that will do."""

    def __init__(self) -> None:
        self._held = 0.0, np.empty((0, 3))

    def __call__(self, decision: Decision) -> UprightView:
        """The view of a decision, which depends on earlier ones of the same exploration only."""
        grid, (held, track) = decision.grid, self._held
        angle = wall_angle(grid.cells, grid.resolution, held if _follows(decision, track) else 0.0)
        self._held = angle, decision.track.copy() if angle else track
        return upright_view(grid, decision.clusters, angle)


def _follows(decision: Decision, track: Floats) -> bool:
    """Whether the robot has come the way float64 (n, 3) that it had come when the angle was found."""
    before = len(track)
    return decision.step > 0 and before > 0 and np.array_equal(decision.track[:before], track)


def upright_view(grid: OccupancyGrid, clusters: FrontierClusters, angle: float) -> UprightView:
    """The grid with its walls along rows and columns.

    Args:
        grid: What is known.
        clusters: Cells of frontiers; there may be none.
        angle: As from `wall_angle`.
    """
    if not angle:
        return UprightView(grid, clusters, None)
    turned = turn(grid.cells, angle, (0, 0))
    fill_steps(turned.cells, places(turned.cells, OCCUPIED), in_cells(STEP, grid.resolution))
    rows, cols = turned.cells.shape
    members = turned_places(clusters.cells, angle, turned.shape, (rows, cols))
    # The frontiers stay where they are known to be free, also where a wall beside them was rounded onto them.
    turned.cells[members[:, 0], members[:, 1]] = FREE
    seen = OccupancyGrid(turned.cells, grid.resolution)
    return UprightView(seen, FrontierClusters(members, clusters.offsets), turned)


def wall_angle(cells: Cells, resolution: float, held: float = 0.0) -> float:
    """The angle in radians in (-pi/4, pi/4] by which the walls are turned against rows and columns; often 0.

    It is 0 for less than `LEAST`, and where no single other direction is sharper than that of the axes.

    Args:
        cells: int8 (rows, cols), as in `OccupancyGrid`.
        resolution: Metres a cell.
        held: The angle in radians that is kept where another is hardly sharper; 0 for none.

    Example:
        >>> cells = np.full((60, 60), UNKNOWN, np.int8)
        >>> for k in range(40):
        ...     cells[5 + k // 2, 10 + k] = OCCUPIED
        >>> 25 <= round(math.degrees(wall_angle(cells, 0.1))) <= 28, wall_angle(cells[:5], 0.1)
        (True, 0.0)
    """
    walls, strip = places(cells, OCCUPIED), max(_STRIP / resolution, 1.0)
    # Every n-th in raster order: the same map has always the same angle.
    points = walls[:: max(-(-len(walls) // _POINTS), 1)].astype(np.float64)
    coarse = _sharpness(points, np.arange(0.0, 90.0, _COARSE), 2 * strip)
    best = int(coarse.argmax()) * _COARSE
    away = np.abs(
        (np.arange(len(coarse)) - coarse.argmax() + len(coarse) / 2) % len(coarse) - len(coarse) / 2
    )
    if best == 0.0 or coarse.max() < CLEARER * coarse[away * _COARSE >= _OTHER].max():
        return 0.0
    tried = np.arange(best - _COARSE + 1.0, best + _COARSE)
    fine = _sharpness(points, np.append(tried, [0.0, math.degrees(held)]), strip)
    sharpest, (straight, as_held) = float(fine[:-2].max()), fine[-2:]
    degrees = float(tried[int(fine[:-2].argmax())])
    angle = math.radians(degrees - 90.0 if degrees > 45.0 else degrees)
    if abs(angle) < LEAST or sharpest <= SHARPER * straight:
        return 0.0
    near = abs(math.remainder(angle - held, math.pi / 2)) <= _HELD
    return held if held and near and as_held >= _AS_SHARP * sharpest else angle


def outlined(free: Mask) -> Cells:
    """A map int8 (rows, cols) of free space bool (rows, cols), with walls a cell thick around it."""
    around = with_neighbours(free)
    return np.where(free, FREE, np.where(around, OCCUPIED, UNKNOWN)).astype(np.int8)


@njit(cache=True, nogil=True)
def fill_steps(cells: Cells, walls: Ints, longest: int) -> None:
    """Occupy the breaks along rows and columns between walls that are shorter than so many cells.

    Args:
        cells: int8 (rows, cols), changed in place.
        walls: int64 (n, 2), the occupied cells in raster order.
        longest: In cells.
    """
    last_row = np.full(cells.shape[1], -longest - 1)
    for n in range(len(walls)):
        row, col = walls[n]
        if n > 0 and walls[n - 1, 0] == row and col - walls[n - 1, 1] <= longest:
            cells[row, walls[n - 1, 1] + 1 : col] = OCCUPIED
        if row - last_row[col] <= longest:
            cells[last_row[col] + 1 : row, col] = OCCUPIED
        last_row[col] = row


@njit(cache=True, nogil=True)
def _sharpness(points: Floats, degrees: Floats, wide: float) -> Floats:
    """How well points (k, 2) are in line at each of n angles, float64 (n,).

    The measure is the sum of the squares of the points in each strip, so many cells wide, along the angle and
    across it: it is largest where the strips lie on walls.
    """
    # Projections lie within the largest row and column together, on either side of 0: bins are shifted by it.
    reach = int((points[:, 0].max() + points[:, 1].max()) / wide) + 2 if len(points) else 1
    out = np.zeros(len(degrees))
    for k in range(len(degrees)):
        across, along = np.zeros(2 * reach + 1, np.int64), np.zeros(2 * reach + 1, np.int64)
        c, s = math.cos(math.radians(degrees[k])) / wide, math.sin(math.radians(degrees[k])) / wide
        for n in range(len(points)):
            across[math.floor(c * points[n, 0] - s * points[n, 1]) + reach] += 1
            along[math.floor(c * points[n, 1] + s * points[n, 0]) + reach] += 1
        for n in range(2 * reach + 1):
            out[k] += across[n] * across[n] + along[n] * along[n]
    return out


class UprightRooms(RoomsOnGrid):
    """Rooms of a grid that were predicted in its upright view.

    Args:
        name: Of the predictor.
        grid: What the robot knows.
        found: The rooms of the upright view.
        turned: How the grid was turned.
    """

    def __init__(self, name: str, grid: OccupancyGrid, found: RoomsOnGrid, turned: Turned) -> None:
        super().__init__(name, grid)
        self._found, self._turned = found, turned

    @cached_property
    def rooms(self) -> RoomLabels:
        """The rooms, every seen cell in one that it touches."""
        rooms, cells = self._found.rooms, self._grid.cells
        passable = self._back(rooms.passable) & (cells == UNKNOWN) | (cells == FREE)
        return RoomLabels(self._seen_kept(self._back(rooms.room_ids), rooms.rest), passable, rooms.rest)

    @cached_property
    def sketch(self) -> Ints32:
        """The sketch of the upright view."""
        return self._seen_kept(self._back(self._found.sketch), 0)

    @cached_property
    def inside(self) -> Floats32:
        """The probabilities of the upright view."""
        return np.where(self._grid.cells == UNKNOWN, self._back(self._found.inside), np.float32(0.0))

    def _back(self, values: NDArray[T]) -> NDArray[T]:
        return turn_back(values, self._turned, self._grid.shape)

    def _seen_kept(self, labels: Ints32, rest: int) -> Ints32:
        """Labels in which every free cell is of a seen room, also where it has looked up a wall beside it."""
        free = self._grid.cells == FREE
        if rest:
            labels[free & (labels == rest)] = 0
        grown = grow_labels(np.where(free, labels, np.int32(0)), free)
        return np.where(free, grown, labels)
