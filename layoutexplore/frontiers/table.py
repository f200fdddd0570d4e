"""Frontiers and their numbers: a table with named columns, whose rows become `Frontier`s when asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, overload

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.frontiers.detection import FrontierClusters
from layoutexplore.grids.arrays import Floats, Ints, Ints32, Mask, shows_shapes
from layoutexplore.grids.grid import Cell


@shows_shapes
@dataclass(frozen=True, eq=False)
class Frontier:
    """A cluster of free cells that border the unknown, with a place to look at it from.

    Attributes:
        cells: int32 (n, 2), the cluster's cells as (row, col); read-only where a simulation has made them.
        size: Length in metres: number of cells times the resolution, up to 30 % less than that of a slanting
            line.
        centroid: World point (x, y) of the cells' mean.
        viewpoint: The reachable cell from which the robot looks at the frontier.
        path_length: Geodesic distance from the robot to the viewpoint, in metres.
        straight_distance: Straight distance from the robot to the centroid, in metres.
        visible_area: Unknown area in square metres that rays from the viewpoint would cross within the gain
            range.
        is_closed: The rest of a seen room and nothing else (True), leads on (False), or not predicted (None).
        expected_area: Predicted unknown area behind the frontier in square metres; None without a predictor.
        confidence: The predictor's probability that `is_closed` is right; None without a predictor.
        room: Id of the predicted room that holds the frontier; None without one.
    """

    cells: Ints32
    size: float
    centroid: tuple[float, float]
    viewpoint: Cell
    path_length: float
    straight_distance: float
    visible_area: float
    is_closed: bool | None = None
    expected_area: float | None = None
    confidence: float | None = None
    room: int | None = None


class FrontierTable(NamedTuple):
    """The numbers of k frontiers, a column float64 (k,) each; numba kernels take it as it is.

    Attributes:
        x: Of the centroid, in metres (world).
        y: Of the centroid, in metres (world).
        path_length: Geodesic distance from the robot to the viewpoint, in metres.
        straight_distance: From the robot to the centroid, in metres.
        size: Length of the frontier, in metres: number of cells times the resolution.
        visible_area: Unknown area in view of the viewpoint, in square metres.
        closed: 1 where the frontier is predicted to be closed, -1 where open, 0 where nothing is predicted.
        expected_area: Predicted unknown area behind it, in square metres; 0 where nothing is predicted.
        confidence: Probability that `closed` is right; 0 where nothing is predicted.
    """

    x: Floats
    y: Floats
    path_length: Floats
    straight_distance: Floats
    size: Floats
    visible_area: Floats
    closed: Floats
    expected_area: Floats
    confidence: Floats

    @staticmethod
    def zeros(count: int) -> FrontierTable:
        """A table of so many frontiers of which nothing is known."""
        return FrontierTable(*np.zeros((len(FrontierTable._fields), count)))

    @staticmethod
    def of(frontiers: Sequence[Frontier]) -> FrontierTable:
        """The table of some frontiers."""
        if isinstance(frontiers, FrontierList):
            return frontiers.table
        table = FrontierTable.zeros(len(frontiers))
        for k, frontier in enumerate(frontiers):
            closed = frontier.is_closed
            table.x[k], table.y[k] = frontier.centroid
            table.path_length[k], table.straight_distance[k] = (
                frontier.path_length,
                frontier.straight_distance,
            )
            table.size[k], table.visible_area[k] = frontier.size, frontier.visible_area
            table.closed[k] = 0.0 if closed is None else 1.0 if closed else -1.0
            table.expected_area[k] = frontier.expected_area or 0.0
            table.confidence[k] = frontier.confidence or 0.0
        return table

    def first(self, count: int) -> FrontierTable:
        """The first rows, at most so many, as views."""
        return FrontierTable(*(column[:count] for column in self))


class FrontierList(Sequence[Frontier]):
    """Frontiers kept as a table; each becomes a `Frontier` when it is asked for.

    Most decisions of a training run ask for one of forty.

    Args:
        clusters: The frontiers' cells, and maybe others.
        kept: int64 (k,), the numbers of the clusters that are the frontiers.
        table: Their numbers.
        viewpoints: int32 (k, 2), as (row, col).
        rooms: int (k,), the ids of the predicted rooms; None without a prediction.
    """

    def __init__(
        self,
        clusters: FrontierClusters,
        kept: Ints,
        table: FrontierTable,
        viewpoints: Ints32,
        rooms: NDArray[np.integer] | None = None,
    ) -> None:
        self.table, self.viewpoints = table, viewpoints
        self._clusters, self._kept, self._rooms = clusters, kept, rooms
        self._made: dict[int, Frontier] = {}

    @property
    def clusters(self) -> FrontierClusters:
        """The cells of these frontiers."""
        return FrontierClusters(*_gather(self._clusters.cells, self._clusters.offsets, self._kept))

    def judged(
        self, is_closed: Mask, area: Floats, confidence: Floats, rooms: NDArray[np.integer]
    ) -> FrontierList:
        """The same frontiers with what a predictor says of them, an entry each."""
        table = self.table._replace(
            closed=np.where(is_closed, 1.0, -1.0),
            expected_area=np.array(area, np.float64),
            confidence=np.array(confidence, np.float64),
        )
        return FrontierList(self._clusters, self._kept, table, self.viewpoints, rooms)

    def __len__(self) -> int:
        return len(self._kept)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({list(self)})"

    @overload
    def __getitem__(self, index: int) -> Frontier: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Frontier, ...]: ...
    def __getitem__(self, index: int | slice) -> Frontier | tuple[Frontier, ...]:
        if isinstance(index, slice):
            return tuple(self[k] for k in range(*index.indices(len(self))))
        k = range(len(self))[index]
        if k not in self._made:
            self._made[k] = self._make(k)
        return self._made[k]

    def _make(self, k: int) -> Frontier:
        x, y, path_length, straight_distance, size, visible_area, closed, area, confidence = (
            column.item(k) for column in self.table
        )
        predicted = self._rooms is not None
        cells = self._clusters.cluster(int(self._kept[k]))
        cells.flags.writeable = False  # whoever is asked may keep it, and the robot looks at these cells
        return Frontier(
            cells=cells,
            size=size,
            centroid=(x, y),
            viewpoint=Cell(*self.viewpoints[k].tolist()),
            path_length=path_length,
            straight_distance=straight_distance,
            visible_area=visible_area,
            is_closed=closed > 0 if predicted else None,
            expected_area=area if predicted else None,
            confidence=confidence if predicted else None,
            room=None if self._rooms is None else int(self._rooms[k]),
        )


@njit(cache=True, nogil=True)
def _gather(cells: Ints32, offsets: Ints, kept: Ints) -> tuple[Ints32, Ints]:
    """The cells and offsets of some clusters."""
    starts = np.zeros(len(kept) + 1, np.int64)
    for n in range(len(kept)):
        starts[n + 1] = starts[n] + offsets[kept[n] + 1] - offsets[kept[n]]
    members = np.empty((starts[-1], 2), np.int32)
    for n in range(len(kept)):
        first = offsets[kept[n]] - starts[n]
        for i in range(starts[n], starts[n + 1]):
            members[i, 0], members[i, 1] = cells[first + i, 0], cells[first + i, 1]
    return members, starts
