"""Lengths of the shortest paths from a robot, on the map as it is at one decision.

On a small map they are those of one search over all cells; on a large one those to single cells come from the
map's corners, and the search over cells is made when somebody asks for all of them, or for a path.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError, checks_making
from layoutexplore.grids.arrays import Bytes, Floats32, Ints32, Mask
from layoutexplore.grids.boxes import Box
from layoutexplore.grids.grid import Cell
from layoutexplore.planning.canonical_search import STRAIGHT, Search, find_moves, to_metres
from layoutexplore.planning.corner_paths import CornerPaths
from layoutexplore.planning.distance_cache import DistanceCache
from layoutexplore.planning.shortest_paths import (
    distances_between,
    flat_indices,
    lengths_in_metres,
    walk_down,
)

NOWHERE = np.empty(0, np.int64)
"""For a search that does not stop before its end."""


class Turn:
    """Counts the decisions whose distances share memory, so that those which are over are known.

    Attributes:
        number: That of the last one.
    """

    def __init__(self) -> None:
        self.number = 0


@checks_making
class DistanceField:
    """Lengths of the shortest paths from one cell: a view of their search, which the next search takes away.

    Args:
        search: It has been made.
        turn: Its next number ends this view.
        cache: Keeps lengths between other cells.
        resolution: Side of a cell in metres.
        settled: As of `Search.spread`.

    Attributes:
        settled: The greatest of `units` that is a length; what lies above is not reached.
    """

    def __init__(
        self, search: Search, turn: Turn, cache: DistanceCache, resolution: float, settled: int
    ) -> None:
        self._search, self._turn, self._number = search, turn, turn.number
        self._cache, self._resolution, self._scale = cache, resolution, resolution / STRAIGHT
        self.settled = settled
        self._reached: Mask | None = None

    @property
    def units(self) -> NDArray[np.integer]:
        """int32 (rows + 2, cols + 2), lengths in units of the search, from an origin on."""
        return self._search.distance.reshape(self._search.shape)

    @property
    def reached(self) -> Mask:
        """Bool (rows, cols): the cells that have a length."""
        if self._reached is None:
            self._check()
            self._reached = np.asarray(self.units[1:-1, 1:-1] <= self.settled)
        return self._reached

    def to_cells(self, cells: NDArray[np.integer]) -> Floats32:
        """Lengths float32 (n,) in metres to cells (n, 2) of the grid, inf where there is no path."""
        self._check()
        units = self.units[cells[:, 0] + 1, cells[:, 1] + 1]
        lengths = ((units - float(self._search.origin)) * self._scale).astype(np.float32)
        return np.where(units <= self.settled, lengths, np.float32(np.inf))

    def metres(self) -> Floats32:
        """Lengths float32 (rows, cols) in metres to every cell, inf where there is no path."""
        self._check()
        return self._metres(self.settled)

    def path_to(self, target: Cell) -> Ints32:
        """The shortest path int32 (k, 2) to a cell, both ends included, as `shortest_paths.descend` finds it.

        Raises:
            ConfigError: There is no path.
        """
        self._check()
        row, col = int(target[0]), int(target[1])
        if self.units[row + 1, col + 1] > self.settled:
            raise ConfigError(f"cell ({row}, {col}) cannot be reached: its distance is infinite")
        return self._walk(row, col)

    def between(self, cells: Ints32, resolution: float) -> Floats32:
        """Lengths float32 (n, n) in metres between cells (n, 2) that have one, kept for later decisions."""
        return self._cache.lengths(self.reached, cells, resolution)

    def lengths_from(self, source: Cell, cells: Ints32, resolution: float) -> Floats32:
        """Lengths float32 (n,) in metres from one cell that has a length to others (n, 2)."""
        return distances_between(self.reached, source, cells, resolution)

    def _metres(self, settled: int) -> Floats32:
        search = self._search
        lengths = np.empty((search.shape[0] - 2, search.shape[1] - 2), np.float32)
        to_metres(search.distance, float(search.origin), self._scale, settled, lengths)
        return lengths

    def _walk(self, row: int, col: int) -> Ints32:
        moves, origin = self._search.moves, float(self._search.origin)
        return walk_down(self.units, 1, origin, self._scale, float(self.settled), moves, row, col)

    def _check(self) -> None:
        if self._turn.number != self._number:
            raise ConfigError(
                "these distances belong to a decision that is over: copy `decision.distances` while it is due"
            )


@checks_making
class CornerField(DistanceField):
    """The same by the corners of the map.

    Args:
        search: On the same map, which it is told, and to be made, when it is needed.
        turn: Its next number ends this view.
        cache: Is not used.
        resolution: Side of a cell in metres.
        source: Where the robot is.
        opened: Whether the source is shut and only counts as traversable.
        paths: The corners of the map; the source counts as traversable.
        barred: uint8 (rows + 2, cols + 2), 0 where a cell is connected with the source, 1 elsewhere.
    """

    def __init__(
        self,
        search: Search,
        turn: Turn,
        cache: DistanceCache,
        resolution: float,
        *,
        source: Cell,
        opened: bool,
        paths: CornerPaths,
        barred: Bytes,
    ) -> None:
        self._source, self._opened, self._paths, self._barred = source, opened, paths, barred
        super().__init__(search, turn, cache, resolution, 0)
        self._known: dict[tuple[int, int], int] = {}

    @property
    def units(self) -> NDArray[np.integer]:
        """uint8 (rows + 2, cols + 2), `barred`: what is `settled`, 0, is reached."""
        return self._barred

    def to_cells(self, cells: NDArray[np.integer]) -> Floats32:
        """Lengths float32 (n,) in metres to cells (n, 2) of the grid, inf where there is no path."""
        self._check()
        lengths = np.full(len(cells), np.float32(np.inf))
        reached = np.flatnonzero(self.units[cells[:, 0] + 1, cells[:, 1] + 1] == 0)
        if len(reached):
            units = self._paths.lengths_from(self._source, np.asarray(cells[reached], np.int64))
            places = (Cell(*cell) for cell in cells[reached].tolist())
            self._known |= zip(places, units.tolist(), strict=True)
            lengths[reached] = lengths_in_metres(units, self._resolution)
        return lengths

    def metres(self) -> Floats32:
        """Lengths float32 (rows, cols) in metres to every cell, inf where there is no path."""
        self._check()
        row, col = self._source
        rows, cols = self._search.shape
        find_moves(self._world((0, rows - 2, 0, cols - 2)), self._search.moves, 0, 0)
        return self._metres(self._search.spread((row + 1) * self._search.cols + col + 1, NOWHERE))

    def between(self, cells: Ints32, resolution: float) -> Floats32:
        """Lengths float32 (n, n) in metres between cells (n, 2) that have one, kept for later decisions."""
        self._check()
        return lengths_in_metres(self._paths.between(cells), resolution)

    def lengths_from(self, source: Cell, cells: Ints32, resolution: float) -> Floats32:
        """Lengths float32 (n,) in metres from one cell that has a length to others (n, 2)."""
        self._check()
        return lengths_in_metres(self._paths.lengths_from(source, cells), resolution)

    def _walk(self, row: int, col: int) -> Ints32:
        here, there = self._source, Cell(row, col)
        if there not in self._known:
            (self._known[there],) = self._paths.lengths_from(here, np.array([there])).tolist()
        units = self._known[there]
        box = around_paths(here, there, units, self._search.shape)
        part = Search((box[1] - box[0], box[3] - box[2]))
        find_moves(self._world(box), part.moves, 0, 0)
        corner = np.array([box[0], box[2]])
        source, stops = flat_indices(np.array([here, there]) - corner, part)[:, None]
        # Nearer cells than the target are all that a path to it is walked down over.
        settled = part.spread(int(source[0]), stops)
        lengths = part.distance.reshape(part.shape)
        row, col = row - box[0], col - box[2]
        path = walk_down(lengths, 1, float(part.origin), self._scale, float(settled), part.moves, row, col)
        return path + corner.astype(np.int32)

    def _world(self, box: Box) -> Bytes:
        """uint8 (n + 2, m + 2): 1 where the map is traversable, in a half-open box of it; its border is 0."""
        row0, row1, col0, col1 = box
        world = np.zeros((row1 - row0 + 2, col1 - col0 + 2), np.uint8)
        world[1:-1, 1:-1] = self._paths.world[row0 + 1 : row1 + 1, col0 + 1 : col1 + 1]
        if self._opened:
            world[self._source.row - row0 + 1, self._source.col - col0 + 1] = 0
        return world


def around_paths(source: Cell, target: Cell, units: int, padded: tuple[int, ...]) -> Box:
    """The box (half open) that holds all paths of a length between two cells, and the cells beside them.

    Args:
        source: Where they begin.
        target: Where they end.
        units: Their length in units of the search.
        padded: (rows + 2, cols + 2) of the grid.

    Example:
        >>> around_paths(Cell(5, 5), Cell(5, 9), 6 * STRAIGHT, (102, 102))
        (1, 10, 3, 12)
    """
    bounds: list[int] = []
    for a, b, size in zip(source, target, padded, strict=True):
        # Each row or column farther away is gone there and back.
        aside = (units // STRAIGHT - abs(a - b)) // 2 + 1
        bounds += [max(min(a, b) - aside, 0), min(max(a, b) + aside + 1, size - 2)]
    return bounds[0], bounds[1], bounds[2], bounds[3]
