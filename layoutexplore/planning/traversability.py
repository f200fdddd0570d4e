"""Where a robot can go on the map that it knows, and how far it is, at the cost of what changes.

A scan changes some hundred cells of half a million. Only around them is the obstacles' inflation done again,
and a search counts on in the array of the search before. On a large map the corners at which shortest paths
turn, and what is connected with the robot, follow the changes too, so that no search need look at all cells.
Lengths stay whole numbers until somebody asks for metres.
"""

from __future__ import annotations

import math

import numpy as np

from layoutexplore.errors import ConfigError, checks_making
from layoutexplore.grids.arrays import Bytes, Cells, Ints32
from layoutexplore.grids.boxes import Box, box_size, grown_box, union
from layoutexplore.grids.connected_tiles import ConnectedTiles
from layoutexplore.grids.grid import FREE, OCCUPIED, Cell
from layoutexplore.grids.morphology import inflate
from layoutexplore.planning.canonical_search import Search, find_moves
from layoutexplore.planning.corner_paths import CornerPaths
from layoutexplore.planning.distance_cache import DistanceCache
from layoutexplore.planning.distance_fields import NOWHERE, CornerField, DistanceField, Turn
from layoutexplore.planning.shortest_paths import check_cells, flat_indices
from layoutexplore.processes import release_memory

LARGE = 1_000_000
"""Size of the box around all that has changed from which on lengths come from the map's corners.

Below, one search over all cells costs less than following the changes of the corners.
"""

_NOTHING: Box = (0, 0, 0, 0)


@checks_making
class Traversability:
    """The cells that a robot can plan through, on a grid that changes.

    Args:
        shape: (rows, cols) of the grid, which is taken to be all unknown at first.
        robot_radius: In metres: nearer to an occupied cell, centre to centre, the robot's centre may not be.
        resolution: Side of a cell in metres.
        large: Cells from which on a map is large; see `LARGE`.

    Attributes:
        cache: Path lengths between cells, kept from decision to decision while the map is not large.
        corners: The same when it is; None before.

    Example:
        >>> cells = np.full((3, 5), -1, np.int8)
        >>> cells[1] = [0, 0, 0, 0, 100]
        >>> traversability = Traversability(cells.shape, 0.15, 0.1)
        >>> traversability.note((1, 2, 0, 5))
        >>> traversability.distances(cells, Cell(1, 0)).metres()[1].round(1).tolist()
        [0.0, 0.10000000149011612, 0.20000000298023224, inf, inf]
    """

    def __init__(
        self, shape: tuple[int, int], robot_radius: float, resolution: float, *, large: int = LARGE
    ) -> None:
        self._shape, self._radius, self._resolution, self._large = shape, robot_radius, resolution, large
        self._vast = shape[0] * shape[1] >= 4 * large  # a search of all cells would need too much memory
        self._margin = math.ceil(robot_radius / resolution)
        self._search = Search(shape)
        self._changed = self._ever_changed = _NOTHING
        self._shut: list[Cell] = []
        self._turn = Turn()
        self.cache = DistanceCache()
        self.corners: CornerPaths | None = None
        self._connected: ConnectedTiles | None = None
        self._opened: Cell | None = None

    def note(self, box: Box) -> None:
        """Remember that cells in a box (half open) have changed."""
        self._changed, self._ever_changed = union(self._changed, box), union(self._ever_changed, box)

    def shut(self, cell: Cell) -> None:
        """Never plan through a cell again, whatever the map says."""
        self._shut.append(cell)
        self.note((cell.row, cell.row + 1, cell.col, cell.col + 1))

    def reopen(self) -> None:
        """Plan through the cells again that were shut, where the map allows it."""
        for cell in self._shut:
            self.note((cell.row, cell.row + 1, cell.col, cell.col + 1))
        self._shut.clear()

    def plan_with(self, robot_radius: float) -> None:
        """Keep another distance in metres from what is occupied from now on."""
        self._radius, self._margin = robot_radius, math.ceil(robot_radius / self._resolution)
        self._changed = union(self._changed, self._ever_changed)

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
        (row, col), search = source, self._search
        if not (0 <= row < self._shape[0] and 0 <= col < self._shape[1]):
            raise ConfigError(f"cell ({row}, {col}) lies outside of the grid of shape {self._shape}")
        self._adapt(cells)
        self._turn.number += 1
        if self.corners and stop_at is None:
            return self._by_corners(source)
        if self.corners:
            find_moves(self.corners.world, search.moves, 0, 0)
        stops = NOWHERE if stop_at is None else flat_indices(check_cells(stop_at, self._shape), search)
        settled = search.spread((row + 1) * search.cols + col + 1, stops)
        return DistanceField(search, self._turn, self.cache, self._resolution, settled)

    def path(self, cells: Cells, source: Cell, goal: Cell) -> Ints32:
        """The shortest path int32 (k, 2) from a cell to another on the grid as it is; empty without one."""
        goals = np.array([goal], np.int32)
        self._adapt(cells)
        distances = self.distances(cells, source, stop_at=None if self.corners else goals)
        return distances.path_to(goal) if np.isfinite(distances.to_cells(goals)).all() else goals[:0]

    def _by_corners(self, source: Cell) -> DistanceField:
        """The lengths on a large map, where the robot's cell counts as traversable even if it is not."""
        assert self.corners is not None and self._connected is not None
        row, col = source
        if not self.corners.world[row + 1, col + 1]:
            self._opened = source
            self._write(np.ones((1, 1), np.uint8), row, col)
        self._connected.update(self.corners.world, row + 1, col + 1)
        return CornerField(
            self._search,
            self._turn,
            self.cache,
            self._resolution,
            source=source,
            opened=self._opened is not None,
            paths=self.corners,
            barred=self._connected.barred,
        )

    def _write(self, window: Bytes, row: int, col: int) -> None:
        """Tell corners and connections, where there are any, of a part of the map from (row, col) on."""
        if self.corners is None or self._connected is None:
            return
        self._connected.note(self.corners.update(window, row, col))

    def _adapt(self, cells: Cells) -> None:
        """Follow the changes of the grid."""
        if self._opened is not None:
            self._write(np.zeros((1, 1), np.uint8), *self._opened)
            self._opened = None
        box, self._changed = self._changed, _NOTHING
        if box[0] >= box[1]:
            return
        if self.corners is None and (self._vast or box_size(self._ever_changed) >= self._large):
            rows, cols = self._shape
            self.corners, self._connected = CornerPaths(self._shape), ConnectedTiles((rows + 2, cols + 2))
            self.cache = DistanceCache()
            self._search.release()
            release_memory()
            box = (0, rows, 0, cols)
        # The inflation reaches so far from the changes, moves a cell farther; and they hang on the cells
        # beside.
        changed = grown_box(box, self._margin + 1, self._shape)
        window = self._window(cells, changed)
        if self.corners is None:
            find_moves(window, self._search.moves, changed[0], changed[2])
        self._write(np.ascontiguousarray(window[1:-1, 1:-1]), changed[0], changed[2])

    def _window(self, cells: Cells, changed: Box) -> Bytes:
        """uint8 (n + 2, m + 2): where a robot can plan through in a box of the grid and a cell around it."""
        beside = grown_box(changed, 1, self._shape)
        around = grown_box(beside, self._margin, self._shape)
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
        return window
