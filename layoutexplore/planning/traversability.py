"""Where a robot can go on the map that it knows, and how far it is, at the cost of what changes.

A scan changes some hundred cells of half a million. Only around them is the obstacles' inflation done again,
and a search counts on in the array of the search before. Lengths stay whole numbers until somebody asks for
metres.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError
from layoutexplore.grids.arrays import Cells, Floats32, Ints32, Mask
from layoutexplore.grids.boxes import Box, union
from layoutexplore.grids.grid import FREE, OCCUPIED, Cell
from layoutexplore.grids.morphology import inflate
from layoutexplore.planning.canonical_search import STRAIGHT, Search, find_moves, to_metres
from layoutexplore.planning.shortest_paths import check_cells, flat_indices, walk_down

_NOTHING: Box = (0, 0, 0, 0)
_NOWHERE = np.empty(0, np.int64)


class DistanceField:
    """Lengths of the shortest paths from one cell: a view of their search, which the next search takes away.

    Attributes:
        units: int32 (rows + 2, cols + 2), lengths in units of the search, from an origin on.
        settled: The greatest of them that is a length; what lies above is not reached.
    """

    def __init__(self, search: Search, resolution: float, settled: int) -> None:
        self._search, self._number = search, search.count
        self._scale = resolution / STRAIGHT
        self.units: Ints32 = search.distance.reshape(search.moves.shape)
        self.settled = settled

    def to_cells(self, cells: NDArray[np.integer]) -> Floats32:
        """Lengths float32 (n,) in metres to cells (n, 2) of the grid, inf where there is no path."""
        self._check()
        units = self.units[cells[:, 0] + 1, cells[:, 1] + 1]
        lengths = ((units - float(self._search.origin)) * self._scale).astype(np.float32)
        return np.where(units <= self.settled, lengths, np.float32(np.inf))

    @property
    def reached(self) -> Mask:
        """Bool (rows, cols): the cells that have a length."""
        self._check()
        return self.units[1:-1, 1:-1] <= self.settled

    def metres(self) -> Floats32:
        """Lengths float32 (rows, cols) in metres to every cell, inf where there is no path."""
        self._check()
        lengths = np.empty((self.units.shape[0] - 2, self.units.shape[1] - 2), np.float32)
        to_metres(self._search.distance, float(self._search.origin), self._scale, self.settled, lengths)
        return lengths

    def path_to(self, target: Cell) -> Ints32:
        """The shortest path int32 (k, 2) to a cell, both ends included, as `shortest_paths.descend` finds it.

        Raises:
            ConfigError: There is no path.
        """
        self._check()
        row, col = int(target[0]), int(target[1])
        if self.units[row + 1, col + 1] > self.settled:
            raise ConfigError(f"cell ({row}, {col}) cannot be reached: its distance is infinite")
        search = self._search
        return walk_down(
            self.units, 1, float(search.origin), self._scale, float(self.settled), search.moves, row, col
        )

    def _check(self) -> None:
        if self._search.count != self._number:
            raise ConfigError(
                "these distances belong to a decision that is over: copy `decision.distances` while it is due"
            )


class Traversability:
    """The cells that a robot can plan through, on a grid that changes.

    Args:
        shape: (rows, cols) of the grid, which is taken to be all unknown at first.
        robot_radius: In metres: nearer to an occupied cell, centre to centre, the robot's centre may not be.
        resolution: Side of a cell in metres.

    Example:
        >>> cells = np.full((3, 5), -1, np.int8)
        >>> cells[1] = [0, 0, 0, 0, 100]
        >>> traversability = Traversability(cells.shape, 0.15, 0.1)
        >>> traversability.note((1, 2, 0, 5))
        >>> traversability.distances(cells, Cell(1, 0)).metres()[1].round(1).tolist()
        [0.0, 0.10000000149011612, 0.20000000298023224, inf, inf]
    """

    def __init__(self, shape: tuple[int, int], robot_radius: float, resolution: float) -> None:
        self._shape, self._radius, self._resolution = shape, robot_radius, resolution
        self._margin = math.ceil(robot_radius / resolution)
        self._search = Search(shape)
        self._changed = _NOTHING
        self._shut: list[Cell] = []

    def note(self, box: Box) -> None:
        """Remember that cells in a box (half open) have changed."""
        self._changed = union(self._changed, box)

    def shut(self, cell: Cell) -> None:
        """Never plan through a cell again, whatever the map says."""
        self._shut.append(cell)
        self.note((cell.row, cell.row + 1, cell.col, cell.col + 1))

    def distances(self, cells: Cells, source: Cell, *, stop_at: Ints32 | None = None) -> DistanceField:
        """Path lengths on the grid as it is now from a cell, which need not be traversable.

        Args:
            cells: int8 (rows, cols), the grid; what differs from the last call lies in the boxes that were
                noted.
            source: Where the robot is.
            stop_at: int32 (n, 2) cells; stop as soon as the distances of all of them are known.

        Raises:
            ConfigError: A cell lies outside of the grid.
        """
        self._adapt(cells)
        (row, col), search = source, self._search
        if not (0 <= row < self._shape[0] and 0 <= col < self._shape[1]):
            raise ConfigError(f"cell ({row}, {col}) lies outside of the grid of shape {self._shape}")
        stops = _NOWHERE if stop_at is None else flat_indices(check_cells(stop_at, self._shape), search)
        settled = search.spread((row + 1) * search.cols + col + 1, stops)
        return DistanceField(search, self._resolution, settled)

    def path(self, cells: Cells, source: Cell, goal: Cell) -> Ints32:
        """The shortest path int32 (k, 2) from a cell to another on the grid as it is; empty without one."""
        goals = np.array([goal], np.int32)
        distances = self.distances(cells, source, stop_at=goals)
        return distances.path_to(goal) if np.isfinite(distances.to_cells(goals)).all() else goals[:0]

    def _adapt(self, cells: Cells) -> None:
        """Follow the changes of the grid."""
        box, self._changed = self._changed, _NOTHING
        if box[0] >= box[1]:
            return
        # The inflation reaches so far from the changes, moves a cell farther; and they hang on the cells
        # beside.
        changed = _grown(box, self._margin + 1, self._shape)
        beside = _grown(changed, 1, self._shape)
        around = _grown(beside, self._margin, self._shape)
        seen = cells[around[0] : around[1], around[2] : around[3]]
        free = (seen == FREE) & ~inflate(seen == OCCUPIED, self._radius, self._resolution)
        window = np.zeros((changed[1] - changed[0] + 2, changed[3] - changed[2] + 2), np.uint8)
        top, left = 1 - changed[0], 1 - changed[2]
        part = free[
            beside[0] - around[0] : beside[1] - around[0], beside[2] - around[2] : beside[3] - around[2]
        ]
        window[beside[0] + top : beside[1] + top, beside[2] + left : beside[3] + left] = part
        for cell in self._shut:
            row, col = cell.row + top, cell.col + left
            if 0 <= row < window.shape[0] and 0 <= col < window.shape[1]:
                window[row, col] = 0
        find_moves(window, self._search.moves, changed[0], changed[2])


def _grown(box: Box, margin: int, shape: tuple[int, int]) -> Box:
    """A box with a margin around it, inside of a grid."""
    row0, row1, col0, col1 = box
    return (
        max(row0 - margin, 0),
        min(row1 + margin, shape[0]),
        max(col0 - margin, 0),
        min(col1 + margin, shape[1]),
    )
