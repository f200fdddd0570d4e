"""Where to look again before a noisy exploration is over.

Noise draws walls where there are none: a doorway can close itself, a robot can find itself inside a wall, a
frontier can stay because the beams towards it failed. Where no frontier is left that the robot can reach, it
looks around where it is, and then from the nearest place it can reach to each frontier that it cannot. Where
that opens nothing, it goes back the way it came to where it could reach more.
"""

from __future__ import annotations

import math
from itertools import groupby

import numpy as np

from layoutexplore.frontiers.detection import FrontierClusters
from layoutexplore.grids.arrays import Floats, Ints, Ints32
from layoutexplore.grids.grid import Cell, OccupancyGrid, Pose
from layoutexplore.planning.distance_fields import DistanceField
from layoutexplore.planning.traversability import Traversability

APART = 0.5
"""Metres: nearer to a place that was looked from, none is looked from again."""

SCANS = 3
"""So often the robot looks all around from a place: one free scan does not open a wall."""

SHUT_IN = 1.0
"""Square metres: where the robot can reach less than that, or so much less than from where it came, noise has
shut it in."""

WAYS_BACK = 10
"""So often a robot that noise has shut in goes back where it came from."""

SHUT_COST = 10.0
"""A metre between a frontier and where the robot can go counts as so many on the way there."""

TRIES = 3
"""So often the robot sets out for a place that a wall which it does not know keeps it from."""


class SecondLook:
    """The places of a run from which was looked again.

    Args:
        min_size: Metres; shorter frontiers are not worth the path.
    """

    def __init__(self, min_size: float) -> None:
        self._min_size = min_size
        self._places: list[tuple[float, float]] = []
        self._tries: list[tuple[float, float]] = []
        self._ways_back = 0

    @property
    def begun(self) -> bool:
        """Whether any place was looked from."""
        return bool(self._tries) or self._ways_back > 0

    def note(self, pose: Pose) -> None:
        """The robot has looked around from where it believes to be, wherever it set out for."""
        self._places.append((pose.x, pose.y))

    def next_path(
        self, grid: OccupancyGrid, track: Floats, clusters: FrontierClusters, traversability: Traversability
    ) -> Ints32 | None:
        """The path int32 (k, 2) to the next place to look from; None when all that is left was looked at.

        Args:
            grid: What the robot knows.
            track: float64 (n, 3), the robot's poses so far as (x, y, theta), as it believes them.
            clusters: All frontier clusters of the grid, those included that cannot be reached.
            traversability: Where the robot can plan to go on that grid.
        """
        here = grid.nearest_cell(float(track[-1, 0]), float(track[-1, 1]))
        back = way_back(grid, track, traversability)
        if len(back) and self._ways_back < WAYS_BACK:
            self._ways_back += 1
            return back
        near = _near_frontiers(grid, clusters, traversability.distances(grid.cells, here), self._min_size)
        for cell in (here, *near):
            x, y = grid.cell_to_world(cell.row, cell.col)
            if not _near((x, y), self._places) and _near((x, y), self._tries) < TRIES:
                self._tries.append((x, y))
                return traversability.path(grid.cells, here, cell)
        out = way_out(grid, track, traversability) if self._ways_back < WAYS_BACK else back
        if not len(out):
            return None
        self._ways_back += 1
        return out


def _near(place: tuple[float, float], others: list[tuple[float, float]]) -> int:
    """How many of the others are as near to a place (x, y) in metres as no two places are looked from."""
    return sum(math.hypot(place[0] - x, place[1] - y) < APART for x, y in others)


def way_back(grid: OccupancyGrid, track: Floats, traversability: Traversability) -> Ints32:
    """The cells int32 (k, 2) back along the robot's track to where it is not shut in; empty where it is not.

    Args:
        grid: What the robot knows.
        track: float64 (n, 3), the poses so far as (x, y, theta), as it believes them.
        traversability: Where it can plan to go on that grid.
    """

    def shut_in(cell: Cell) -> bool:
        reached = traversability.distances(grid.cells, cell).reached
        return bool(np.count_nonzero(reached) * grid.resolution**2 < SHUT_IN)

    back = _cells_back(grid, track)
    nowhere = np.empty((0, 2), np.int32)
    if not shut_in(back[0]):
        return nowhere
    free = next((k for k, cell in enumerate(back) if not shut_in(cell)), 0)
    return np.array(back[: free + 1], np.int32) if free else nowhere


def way_out(grid: OccupancyGrid, track: Floats, traversability: Traversability) -> Ints32:
    """The cells int32 (k, 2) back along the robot's track to where it can reach more; empty if nowhere.

    Args:
        grid: What the robot knows.
        track: float64 (n, 3), the poses so far as (x, y, theta), as it believes them.
        traversability: Where it can plan to go on that grid.
    """
    back = _cells_back(grid, track)
    known = np.array(traversability.distances(grid.cells, back[0]).reached)
    wanted = np.count_nonzero(known) + SHUT_IN / grid.resolution**2
    for k, cell in enumerate(back):
        # What was reached from a cell before can be reached no farther from here: one search an area.
        if known[cell]:
            continue
        reached = traversability.distances(grid.cells, cell).reached
        if np.count_nonzero(reached) >= wanted:
            return np.array(back[: k + 1], np.int32)
        known |= reached
    return np.empty((0, 2), np.int32)


def _cells_back(grid: OccupancyGrid, track: Floats) -> list[Cell]:
    """The cells of the robot's way, the last first, each stay in one of them once."""
    # A robot that touches a wall may not reach the centre of its own cell: nor does it try.
    return [cell for cell, _ in groupby(grid.nearest_cell(x, y) for x, y, _ in track[::-1].tolist())]


def _near_frontiers(
    grid: OccupancyGrid, clusters: FrontierClusters, field: DistanceField, min_size: float
) -> list[Cell]:
    """For each frontier long enough, the reachable cell nearest to its middle, in the order of the detour."""
    reached = np.argwhere(field.reached)
    kept = np.flatnonzero(np.diff(clusters.offsets) * grid.resolution >= min_size - 1e-9)
    if len(reached) == 0:
        return []
    pairs = np.array([_nearest(reached, clusters.cluster(int(i)).mean(axis=0)) for i in kept]).reshape(-1, 2)
    cells = reached[pairs[:, 1].astype(np.int64)]
    cost = field.to_cells(cells) + SHUT_COST * grid.resolution * pairs[:, 0]
    return [Cell(int(row), int(col)) for row, col in cells[np.argsort(cost, kind="stable")].tolist()]


def _nearest(cells: Ints, place: Floats) -> tuple[float, int]:
    """The distance in cells to the nearest of the cells (n, 2), and its number."""
    squares = ((cells - place) ** 2).sum(axis=1)
    nearest = int(np.argmin(squares))
    return math.sqrt(squares[nearest]), nearest
