"""What an agent is given at a decision, and what it answers.

A `Decision` is everything a strategy may know: the grid, the pose and the frontiers with their path lengths,
gains and, where a predictor runs, classes. The ground truth is a separate `Truth` that only evaluation,
oracle predictors and the clairvoyant agent are handed.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol, overload, runtime_checkable

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.frontiers.detection import FrontierClusters
from layoutexplore.grids.grid import Cell, OccupancyGrid, Pose
from layoutexplore.layout.types import Layout
from layoutexplore.maps.floorplan import FloorPlan, PlanRaster
from layoutexplore.planning.distance_cache import DistanceCache
from layoutexplore.planning.shortest_paths import descend, distance_matrix, distances_between
from layoutexplore.sensing.lidar import LidarConfig

STOP = -1
"""The choice that ends an exploration."""

CellPath = NDArray[np.int32]
"""Cells int32 (k, 2) as (row, col), each next to the one before."""

Choice = int | CellPath
"""An index into `Decision.frontiers`, `STOP`, or (of an agent that knows the floor plan) a path to follow."""


@dataclass(frozen=True, eq=False)
class Frontier:
    """A cluster of free cells that border the unknown, with a place to look at it from.

    Attributes:
        cells: int32 (n, 2), the cluster's cells as (row, col).
        size: Length in metres: number of cells times the resolution.
        centroid: World point (x, y) of the cells' mean.
        viewpoint: The reachable cell from which the robot looks at the frontier.
        path_length: Geodesic distance from the robot to the viewpoint, in metres.
        straight_distance: Straight distance from the robot to the centroid, in metres.
        visible_area: Unknown area in square metres that rays from the viewpoint would cross within the gain
            range.
        is_closed: The rest of an almost finished room (True), leads on (False), or not predicted (None).
        expected_area: Predicted unknown area behind the frontier in square metres; None without a predictor.
        confidence: The predictor's probability that `is_closed` is right; None without a predictor.
        room: Id of the predicted room that holds the frontier; None without one.
    """

    cells: NDArray[np.int32]
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
        size: Length of the frontier, in metres.
        visible_area: Unknown area in view of the viewpoint, in square metres.
        closed: 1 where the frontier is predicted to be closed, -1 where open, 0 where nothing is predicted.
        expected_area: Predicted unknown area behind it, in square metres; 0 where nothing is predicted.
        confidence: Probability that `closed` is right; 0 where nothing is predicted.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    path_length: NDArray[np.float64]
    straight_distance: NDArray[np.float64]
    size: NDArray[np.float64]
    visible_area: NDArray[np.float64]
    closed: NDArray[np.float64]
    expected_area: NDArray[np.float64]
    confidence: NDArray[np.float64]

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
        kept: NDArray[np.int64],
        table: FrontierTable,
        viewpoints: NDArray[np.int32],
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
        self,
        is_closed: NDArray[np.bool_],
        area: NDArray[np.float64],
        confidence: NDArray[np.float64],
        rooms: NDArray[np.integer],
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
        return Frontier(
            cells=self._clusters.cluster(int(self._kept[k])),
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
def _gather(
    cells: NDArray[np.int32], offsets: NDArray[np.int64], kept: NDArray[np.int64]
) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """The cells and offsets of some clusters."""
    starts = np.zeros(len(kept) + 1, np.int64)
    for n in range(len(kept)):
        starts[n + 1] = starts[n] + offsets[kept[n] + 1] - offsets[kept[n]]
    members = np.empty((starts[-1], 2), np.int32)
    for n in range(len(kept)):
        members[starts[n] : starts[n + 1]] = cells[offsets[kept[n]] : offsets[kept[n] + 1]]
    return members, starts


class Distances(Protocol):
    """Geodesic distances from the robot to every cell, worked out when they are asked for.

    A simulation keeps them in an array that its next step takes: `layoutexplore.planning.traversability`.
    """

    @property
    def reached(self) -> NDArray[np.bool_]:
        """Bool (rows, cols): the cells the robot can plan to."""

    def metres(self) -> NDArray[np.float32]:
        """float32 (rows, cols): distances in metres, inf where the robot cannot go."""

    def path_to(self, target: Cell) -> CellPath:
        """The shortest path to a cell, both ends included."""


@dataclass(frozen=True, eq=False)
class KnownDistances:
    """Distances that are known already, of a decision that no simulation has made.

    Attributes:
        array: float32 (rows, cols), in metres, inf where the robot cannot go.
    """

    array: NDArray[np.float32]

    @property
    def reached(self) -> NDArray[np.bool_]:
        """Bool (rows, cols): the cells the robot can plan to."""
        return np.isfinite(self.array)

    def metres(self) -> NDArray[np.float32]:
        """The distances, as given."""
        return self.array

    def path_to(self, target: Cell) -> CellPath:
        """The shortest path to a cell, both ends included."""
        return descend(self.array, self.reached, target)


class PredictedRooms(Protocol):
    """What is predicted of the rooms at a decision; what costs time is computed when it is first asked for."""

    @property
    def labels(self) -> NDArray[np.int32]:
        """int32 (rows, cols): the predicted room of each cell, seen or not, 0 for none."""

    @property
    def inside(self) -> NDArray[np.float32]:
        """float32 (rows, cols): probability that an unknown cell belongs to a seen room; 0 where it is known."""

    @property
    def layout(self) -> Layout:
        """The rooms with their polygons; walls, lines and faces, too, where the predictor found some."""


@dataclass(frozen=True, eq=False)
class Decision:
    """One decision of an exploration. Arrays are views that change with the next step: copy what you keep.

    Attributes:
        step: Number of decisions taken before this one.
        grid: What the robot knows.
        pose: Where the robot believes it is.
        frontiers: Reachable frontiers, nearest first by path length.
        field: Geodesic distances from the robot; `distances` and `traversable` read them.
        distance: Metres travelled so far.
        sensor: The lidar's configuration.
        robot_radius: In metres.
        rooms: What is predicted of the rooms; None without a predictor.
        track: float64 (n, 3), the poses so far as (x, y, theta), as the robot believes them.
        paths: Keeps path lengths from decision to decision; None computes them anew.
        goal: World point (x, y) in the middle of the frontier that the robot was last sent to; None before
            that.
    """

    step: int
    grid: OccupancyGrid
    pose: Pose
    frontiers: Sequence[Frontier]
    field: Distances
    distance: float
    sensor: LidarConfig
    robot_radius: float
    rooms: PredictedRooms | None = None
    track: NDArray[np.float64] = dataclasses.field(default_factory=lambda: np.empty((0, 3)))
    paths: DistanceCache | None = None
    goal: tuple[float, float] | None = None

    @cached_property
    def table(self) -> FrontierTable:
        """The numbers of the frontiers, by column."""
        return FrontierTable.of(self.frontiers)

    @cached_property
    def viewpoints(self) -> NDArray[np.int32]:
        """int32 (k, 2): the frontiers' viewpoints as (row, col)."""
        if isinstance(self.frontiers, FrontierList):
            return self.frontiers.viewpoints
        return np.array([frontier.viewpoint for frontier in self.frontiers], np.int32).reshape(-1, 2)

    @cached_property
    def clusters(self) -> FrontierClusters:
        """The cells of one or more frontiers."""
        if isinstance(self.frontiers, FrontierList):
            return self.frontiers.clusters
        return FrontierClusters.of([frontier.cells for frontier in self.frontiers])

    @cached_property
    def distances(self) -> NDArray[np.float32]:
        """float32 (rows, cols): geodesic distance from the robot in metres, inf where it cannot go.

        Raises:
            ConfigError: It was not asked for before the next step.
        """
        return self.field.metres()

    @cached_property
    def traversable(self) -> NDArray[np.bool_]:
        """Bool (rows, cols): the cells the robot can plan to."""
        return self.field.reached

    def path_lengths(self, chosen: Sequence[int] | NDArray[np.int64]) -> NDArray[np.float32]:
        """Path lengths between the robot and some frontiers' viewpoints, and among these.

        Args:
            chosen: k indices into `frontiers`.

        Returns:
            float32 (k + 1, k + 1) in metres, symmetric; index 0 is the robot.
        """
        numbers = np.asarray(chosen, np.int64)
        lengths = np.zeros((len(numbers) + 1, len(numbers) + 1), np.float32)
        lengths[0, 1:] = lengths[1:, 0] = self.table.path_length[numbers]
        between = self.paths.lengths if self.paths else distance_matrix
        lengths[1:, 1:] = between(self.traversable, self.viewpoints[numbers], self.grid.resolution)
        return lengths

    def path_lengths_from(self, index: int, chosen: Sequence[int] | NDArray[np.int64]) -> NDArray[np.float32]:
        """Path lengths float32 (k,) in metres from one frontier's viewpoint to those of others, by index."""
        cells = self.viewpoints[np.asarray(chosen, np.int64)]
        source = Cell(*self.viewpoints[index].tolist())
        return distances_between(self.traversable, source, cells, self.grid.resolution)


@dataclass(frozen=True, eq=False)
class Truth:
    """The ground truth of a run, for evaluation and for agents that are allowed to know it.

    Attributes:
        plan: The floor plan.
        raster: The plan at the simulation's resolution, in the frame of the robot's grid.
        target: bool (rows, cols), the free cells that have to be seen.
        reachable: bool (rows, cols), the cells the robot's centre can reach.
        sensor: The lidar's configuration.
        robot_radius: In metres.
    """

    plan: FloorPlan
    raster: PlanRaster
    target: NDArray[np.bool_]
    reachable: NDArray[np.bool_]
    sensor: LidarConfig
    robot_radius: float


@runtime_checkable
class Agent(Protocol):
    """A strategy: it is reset once a run and then asked at every decision."""

    name: str

    def reset(self, seed: int) -> None:
        """Forget everything and start a new run with this seed."""

    def act(self, decision: Decision) -> Choice:
        """Choose a frontier by its index, or `STOP`."""


@runtime_checkable
class Privileged(Protocol):
    """An agent or predictor that is allowed to know the floor plan: it is shown the truth after `reset`."""

    def reveal(self, truth: Truth) -> None:
        """Receive the truth of the run that begins."""


class Predictor(Protocol):
    """Predicts the rooms of a decision's grid and writes classes and areas into its frontiers."""

    name: str

    def predict(self, decision: Decision) -> Decision:
        """The same decision with `rooms` and the frontiers' class, area, confidence and room filled in."""
