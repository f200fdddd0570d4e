"""What an agent is given at a decision, and what it answers.

A `Decision` is everything a strategy may know: the grid, the pose and the frontiers with their path lengths,
gains and, where a predictor runs, classes. The ground truth is a separate `Truth` that only evaluation,
oracle predictors and the clairvoyant agent are handed.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from layoutexplore.errors import ConfigError, MapError, checks_calls, shortened
from layoutexplore.frontiers.detection import FrontierClusters
from layoutexplore.frontiers.foresight import Foresight
from layoutexplore.frontiers.table import Frontier, FrontierList, FrontierTable
from layoutexplore.grids.arrays import Floats, Floats32, Ints, Ints32, Mask, shows_shapes
from layoutexplore.grids.grid import Cell, OccupancyGrid, Pose
from layoutexplore.layout.types import Layout
from layoutexplore.maps.floorplan import FloorPlan, PlanRaster
from layoutexplore.options import check_kind
from layoutexplore.planning.shortest_paths import descend, distance_matrix, distances_between
from layoutexplore.sensing.lidar import LidarConfig

STOP = -1
"""The choice that ends an exploration."""

CellPath = Ints32
"""Cells int32 (k, 2) as (row, col), each next to the one before."""


class Walk(NamedTuple):
    """A path to where something is to be seen, left as soon as hardly anything of that is left to see.

    Attributes:
        path: int32 (k, 2), neighbouring cells from the robot's on; where the way is blocked it ends, too.
        sights: int32 (n, 2), at least one cell that is to be seen.
    """

    path: CellPath
    sights: Ints32


Choice = int | CellPath | Walk
"""An index into `Decision.frontiers`, `STOP`, or (of an agent that plans its own way) a path to follow."""

PATHS = (np.ndarray, Walk)
"""Types of the choices that are a path."""


def path_of(choice: CellPath | Walk) -> CellPath:
    """The cells int32 (k, 2) of a choice that is a path."""
    return choice.path if isinstance(choice, Walk) else choice


class Distances(Protocol):
    """Geodesic distances from the robot to every cell, worked out when they are asked for.

    A simulation keeps them in an array that its next step takes: `layoutexplore.planning.traversability`.
    """

    @property
    def reached(self) -> Mask:
        """Bool (rows, cols): the cells the robot can plan to."""

    def metres(self) -> Floats32:
        """float32 (rows, cols): distances in metres, inf where the robot cannot go."""

    def path_to(self, target: Cell) -> CellPath:
        """The shortest path to a cell, both ends included."""

    def between(self, cells: Ints32, resolution: float) -> Floats32:
        """float32 (n, n): path lengths in metres between cells (n, 2) that are reached."""

    def lengths_from(self, source: Cell, cells: Ints32, resolution: float) -> Floats32:
        """float32 (n,): path lengths in metres from one cell that is reached to others (n, 2)."""


@dataclass(frozen=True, eq=False)
class KnownDistances:
    """Distances that are known already, of a decision that no simulation has made.

    Attributes:
        array: float32 (rows, cols), in metres, inf where the robot cannot go.
    """

    array: Floats32

    @property
    def reached(self) -> Mask:
        """Bool (rows, cols): the cells the robot can plan to."""
        return np.isfinite(self.array)

    def metres(self) -> Floats32:
        """The distances, as given."""
        return self.array

    def path_to(self, target: Cell) -> CellPath:
        """The shortest path to a cell, both ends included."""
        return descend(self.array, self.reached, target)

    def between(self, cells: Ints32, resolution: float) -> Floats32:
        """float32 (n, n): path lengths in metres between cells (n, 2) that are reached."""
        return distance_matrix(self.reached, cells, resolution)

    def lengths_from(self, source: Cell, cells: Ints32, resolution: float) -> Floats32:
        """float32 (n,): path lengths in metres from one cell that is reached to others (n, 2)."""
        return distances_between(self.reached, source, cells, resolution)


class PredictedRooms(Protocol):
    """What is predicted of the rooms at a decision; what costs time is computed when it is asked for."""

    @property
    def labels(self) -> Ints32:
        """int32 (rows, cols): the predicted room of each cell, seen or not, 0 for none."""

    @property
    def sketch(self) -> Ints32:
        """int32 (rows, cols): like `labels`, in a millisecond or two: a sketch where rooms cost more."""

    @property
    def inside(self) -> Floats32:
        """float32 (rows, cols): probability that an unknown cell belongs to a seen room; 0 where known."""

    @property
    def layout(self) -> Layout:
        """The rooms with their polygons; walls, lines and faces, too, where the predictor found some."""


@checks_calls
@shows_shapes
@dataclass(frozen=True, eq=False)
class Decision:
    """One decision of an exploration. Arrays change with the next step: copy what you keep or change.

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
        goal: World point (x, y) in the middle of the frontier that the robot was last sent to; None before
            that.
        foresee: Called once, when `foresight` is first asked for; None where nothing is foreseen.
        turn_cost: Metres charged for turning by one radian; 0 where turning is free.
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
    track: Floats = dataclasses.field(default_factory=lambda: np.empty((0, 3)))
    goal: tuple[float, float] | None = None
    foresee: Callable[[], Foresight | None] | None = None
    turn_cost: float = 0.0

    @property
    def fault(self) -> str:
        """What is wrong with a decision that no simulation has made; empty where nothing is.

        Agents and predictors name it where they fail; nobody looks before.
        """
        kinds = {"grid": OccupancyGrid, "pose": Pose, "sensor": LidarConfig}
        for name, kind in kinds.items():
            if not isinstance(getattr(self, name), kind):
                return f"has a {name} that is no {kind.__name__}"
        if not _is_array((self.pose.x, self.pose.y, self.pose.theta), (3,)):
            return "has a pose whose values are no finite numbers"
        for name in ("distance", "robot_radius", "turn_cost"):
            if not _is_array(getattr(self, name), ()) or getattr(self, name) < 0:
                return f"has a {name} that is no finite number, 0 or more"
        if not _is_array(self.track, (len(self.track) if hasattr(self.track, "__len__") else -1, 3)):
            return "has a track that is no array (n, 3) of finite numbers"
        if self.goal is not None and not _is_array(self.goal, (2,)):
            return "has a goal that is no point (x, y)"
        if self.rooms is not None and not hasattr(self.rooms, "labels"):
            return "has rooms without labels"
        if not isinstance(self.frontiers, Sequence) or not self.frontiers:
            return "has no frontiers"
        if not all(isinstance(frontier, Frontier) for frontier in self.frontiers):
            return "has frontiers that are no Frontier"
        if not hasattr(self.field, "metres"):
            return "has no field of distances"
        for k, frontier in enumerate(self.frontiers):
            if wrong := _wrong_with(frontier, self.grid):
                return f"has a frontier {k} {wrong}"
        return ""

    @cached_property
    def foresight(self) -> Foresight | None:
        """What is foreseen of space that is not known yet; None where nothing is."""
        if self.foresee is None:
            return None
        if not callable(self.foresee):
            raise ConfigError(f"foresee must be a function or None, got {shortened(self.foresee)}")
        foresight = self.foresee()
        check_kind("what foresee returns", foresight, Foresight, optional=True)
        if foresight is not None and foresight.cells.shape != self.grid.shape:
            shape, needed = foresight.cells.shape, self.grid.shape
            raise MapError(f"foresight of {foresight.predictor!r} has {shape} cells, the grid {needed}")
        return foresight

    @cached_property
    def table(self) -> FrontierTable:
        """The numbers of the frontiers, by column."""
        return FrontierTable.of(self.frontiers)

    @cached_property
    def viewpoints(self) -> Ints32:
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
    def distances(self) -> Floats32:
        """float32 (rows, cols): geodesic distance from the robot in metres, inf where it cannot go.

        Raises:
            ConfigError: It was not asked for before the next step.
        """
        return self.field.metres()

    @cached_property
    def traversable(self) -> Mask:
        """Bool (rows, cols): the cells the robot can plan to."""
        return self.field.reached

    def path_lengths(self, chosen: Sequence[int] | Ints) -> Floats32:
        """Path lengths between the robot and some frontiers' viewpoints, and among these.

        Args:
            chosen: k indices into `frontiers`.

        Returns:
            float32 (k + 1, k + 1) in metres, symmetric; index 0 is the robot.
        """
        numbers = self._indices(chosen)
        lengths = np.zeros((len(numbers) + 1, len(numbers) + 1), np.float32)
        lengths[0, 1:] = lengths[1:, 0] = self.table.path_length[numbers]
        lengths[1:, 1:] = self.field.between(self.viewpoints[numbers], self.grid.resolution)
        return lengths

    def path_lengths_from(self, index: int, chosen: Sequence[int] | Ints) -> Floats32:
        """Path lengths float32 (k,) in metres from one frontier's viewpoint to those of others, by index."""
        cells = self.viewpoints[self._indices(chosen)]
        source = Cell(*self.viewpoints[index].tolist())
        return self.field.lengths_from(source, cells, self.grid.resolution)

    def _indices(self, chosen: Sequence[int] | Ints) -> Ints:
        """Indices of frontiers as an array."""
        count = len(self.viewpoints)
        if isinstance(chosen, range) and len(chosen) > count:
            chosen = chosen[: count + 1]
        numbers = np.asarray(chosen)
        good = numbers.ndim == 1 and (numbers.dtype.kind in "iu" or not numbers.size)
        if not good or (numbers.size and not -count <= numbers.min() <= numbers.max() < count):
            raise ConfigError(f"frontiers are chosen by numbers 0 to {count - 1}, got {shortened(chosen)}")
        return numbers.astype(np.int64, copy=False)


@shows_shapes
@dataclass(frozen=True, eq=False)
class Truth:
    """The ground truth of a run, for evaluation and for agents that are allowed to know it.

    Attributes:
        plan: The floor plan.
        raster: The plan at the simulation's resolution, in the frame of the robot's grid.
        start: The cell where the robot begins.
        sensor: The lidar's configuration.
        robot_radius: In metres.
        region: bool (rows, cols), the cells that count; None for all.
        seed: Of the run.
    """

    plan: FloorPlan
    raster: PlanRaster
    start: Cell
    sensor: LidarConfig
    robot_radius: float
    region: Mask | None = None
    seed: int = 0

    @property
    def target(self) -> Mask:
        """Bool (rows, cols): the free cells that have to be seen, painted anew at every call."""
        target = self.raster.coverage_target(self.robot_radius, self.start)
        return target if self.region is None else target & self.region

    @property
    def reachable(self) -> Mask:
        """Bool (rows, cols): the cells the robot's centre can reach, painted anew at every call."""
        return self.raster.reachable(self.robot_radius, self.start)


@runtime_checkable
class Agent(Protocol):
    """A strategy: it is reset once a run and then asked at every decision."""

    name: str

    def reset(self, seed: int) -> None:
        """Forget everything and start a new run with this seed."""

    def act(self, decision: Decision) -> Choice:
        """Choose a frontier by its index, or `STOP`."""


@runtime_checkable
class AsksForRooms(Protocol):
    """An agent that names the predictor which completes its decisions."""

    @property
    def predictor(self) -> object:
        """The predictor's name and options, or the predictor itself."""


def predictor_of(agent: Agent) -> object:
    """The predictor that an agent asks for; "none" where it asks for none."""
    return agent.predictor if isinstance(agent, AsksForRooms) else "none"


@runtime_checkable
class Remembering(Protocol):
    """An agent or predictor that says whether it keeps anything in mind from decision to decision."""

    @property
    def remembers(self) -> bool:
        """Whether what it answers depends on the decisions before."""


def remembers(part: object, otherwise: bool) -> bool:
    """What an agent or predictor says of itself, as in `Remembering`; `otherwise` where it says nothing."""
    return part.remembers if isinstance(part, Remembering) else otherwise


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


def _is_array(value: object, shape: tuple[int, ...]) -> bool:
    """Whether a value has this shape and nothing but finite numbers."""
    try:
        array = np.asarray(value)
    except Exception:  # whatever an object raises that is asked for its numbers
        return False
    return array.dtype.kind in "iuf" and array.shape == shape and bool(np.isfinite(array).all())


def _wrong_with(frontier: Frontier, grid: OccupancyGrid) -> str:
    """What is wrong with a frontier of a grid; empty where nothing is."""
    numbers = frontier.size, frontier.path_length, frontier.straight_distance, frontier.visible_area
    if not (_is_array(numbers, (4,)) and _is_array(frontier.centroid, (2,)) and min(numbers) >= 0):
        return "whose lengths and area are not all finite numbers, 0 or more"
    if not _is_array(frontier.viewpoint, (2,)):
        return "whose viewpoint is no cell"
    cells = np.vstack([np.asarray(frontier.cells).reshape(-1, 2), [frontier.viewpoint]])
    if len(cells) < 2 or (cells < 0).any() or (cells >= grid.shape).any():
        return "without cells, or with some outside of the grid"
    unknown = np.pad(grid.unknown, 1)
    beside = unknown[:-2, 1:-1] | unknown[2:, 1:-1] | unknown[1:-1, :-2] | unknown[1:-1, 2:]
    return "" if beside[tuple(cells[:-1].T)].any() else "that is beside no unknown cell"
