"""Decisions on the map of a robot of your own, as its SLAM publishes it.

A simulation maps, decides and moves. Here the robot maps and moves; what lies between is the same: frontiers
that it can look at, the rest of the rooms as a predictor completes them, and which frontiers are closed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from layoutexplore.errors import MapError, StartError, checks_calls
from layoutexplore.frontiers.decision import PATHS, STOP, Choice, Decision, path_of
from layoutexplore.frontiers.detection import FrontierDetector
from layoutexplore.frontiers.viewpoints import GAIN_RANGE, GAIN_RAYS, MIN_SIZE, ViewpointSelector
from layoutexplore.grids.arrays import Floats
from layoutexplore.grids.boxes import Box, known_box, true_box
from layoutexplore.grids.grid import UNKNOWN, OccupancyGrid, Pose
from layoutexplore.importing.cleaning import without_noise
from layoutexplore.options import FLAG, Rule, check_kind
from layoutexplore.planning.traversability import Traversability
from layoutexplore.predictors import make_predictor
from layoutexplore.sensing.lidar import LidarConfig
from layoutexplore.sensing.lidar import sensor as sensor_of

_COORDINATE = Rule(low=-1e9, high=1e9, count=3)


@dataclass(eq=False)
class _Frame:
    """What follows a grid while its cells stay where they are."""

    grid: OccupancyGrid
    traversability: Traversability
    detector: FrontierDetector
    selector: ViewpointSelector


@checks_calls
class RobotMap:
    """The map of a robot of your own as it grows, and the decisions that are due on it.

    Args:
        predictor: Who completes the rooms: a name with options ("layout", "reconstruct:rose2",
            "prior:plan.png", "none"), or an object, as `make_predictor` takes them.
        sensor: The robot's lidar: a preset's name or a `LidarConfig`. Its range bounds how far a frontier's
            unknown area is looked at; some agents look around where it does not see all around.
        robot_radius: In metres.
        min_size: Metres; shorter frontiers are offered only when no longer one is left.
        clean: Take traces of single beams, and specks of floor that are seen through a wall's gaps, for
            unknown and small holes in a floor for floor, as `without_noise` does. Recorded maps are full of
            them, and each would be a frontier, or be completed to a room. What is occupied stays so.

    Raises:
        ConfigError: An option makes no sense.
        UnknownNameError: There is no such predictor or sensor.

    Example:
        >>> cells = np.full((40, 60), -1, np.int8)
        >>> cells[5:35, 5:40] = 100
        >>> cells[6:34, 6:39] = 0
        >>> cells[15:25, 39] = -1  # an opening in the wall, behind which nobody has looked
        >>> robot_map = RobotMap(predictor="none")
        >>> decision = robot_map.decide(OccupancyGrid(cells, 0.1), Pose(1.0, 1.0))
        >>> [round(frontier.size, 1) for frontier in decision.frontiers]
        [1.0]
        >>> robot_map.way(decision, 0)[-1].round(1).tolist()
        [3.9, 2.0]
    """

    def __init__(
        self,
        predictor: object = "layout",
        *,
        sensor: str | LidarConfig = "stage",
        robot_radius: float = 0.2,
        min_size: float = MIN_SIZE,
        clean: bool = True,
    ) -> None:
        self.predictor = make_predictor(predictor)
        self.sensor = sensor_of(sensor)
        self._radius = Rule(above=0.0, high=10.0).convert("robot_radius", robot_radius)
        self._min_size = Rule(low=0.0, high=1e4).convert("min_size", min_size)
        self._clean = FLAG.convert("clean", clean)
        self._frame: _Frame | None = None
        self._track: list[Pose] = []
        self._walked = 0.0
        self._goal: tuple[float, float] | None = None
        self._given_up = np.empty((0, 2))

    def decide(self, grid: OccupancyGrid, pose: Pose) -> Decision:
        """What is to be decided on the map as it is now: at any time, and as often as one likes.

        While shape, resolution and origin of the grid stay, only what has changed is looked at again.

        Args:
            grid: What the robot knows. Probabilities count as ROS's map_server has them; around what is known
                the decision's grid has unknown cells as far as a frontier is looked beyond.
            pose: Where the robot is.

        Returns:
            The decision, without a frontier where nothing is left that the robot could look at. Its path
            lengths can be asked for until the next one.

        Raises:
            MapError: No cell of the grid is free.
            StartError: The robot is not on its map.
        """
        check_kind("grid", grid, OccupancyGrid)
        pose = Pose(*(float(value) for value in _COORDINATE.convert("pose", pose)))
        _check_on(grid, pose)
        frame, changed = self._follow(self._cleaned(self._with_margin(grid.trinary)))
        if self._track:
            self._walked += math.hypot(pose.x - self._track[-1].x, pose.y - self._track[-1].y)
        self._track.append(pose)
        frame.traversability.note(changed)
        field = frame.traversability.distances(frame.grid.cells, frame.grid.world_to_cell(pose.x, pose.y))
        clusters = frame.detector.update(frame.grid.cells, changed)
        decision = Decision(
            step=len(self._track) - 1,
            grid=frame.grid,
            pose=pose,
            frontiers=frame.selector.frontiers(frame.grid, pose, field, clusters, changed),
            field=field,
            distance=self._walked,
            sensor=self.sensor,
            robot_radius=self._radius,
            track=np.array(self._track),
            goal=self._goal,
        )
        return self.predictor.predict(decision) if self.predictor and decision.frontiers else decision

    def way(self, decision: Decision, choice: Choice) -> Floats:
        """The way that an agent has chosen, for the robot's navigation to follow.

        Args:
            decision: The last one.
            choice: What the agent answered, or the index of a frontier: later decisions know that the robot
                was sent there.

        Returns:
            float64 (n, 2): points (x, y) in metres, a cell apart, from the robot on; none where the agent
            stops.

        Raises:
            ConfigError: There is no such frontier, or the decision is no longer the last one.
        """
        if isinstance(choice, PATHS):
            return decision.grid.cells_to_world(path_of(choice))
        number = Rule(kind=int, low=STOP, high=len(decision.frontiers) - 1).convert("choice", choice)
        if number == STOP:
            return np.empty((0, 2))
        frontier = decision.frontiers[number]
        self._goal = frontier.centroid
        return decision.grid.cells_to_world(decision.field.path_to(frontier.viewpoint))

    def give_up(self, decision: Decision, index: int) -> None:
        """Offer the cells of a frontier no more: the robot has looked at it, and it is still there.

        Glass, a table's edge or a mirror can leave such frontiers, to which a robot would go for ever.

        Raises:
            ConfigError: There is no such frontier.
        """
        number = Rule(kind=int, low=0, high=len(decision.frontiers) - 1).convert("index", index)
        points = decision.grid.cells_to_world(decision.frontiers[number].cells)
        self._given_up = np.concatenate([self._given_up, points])
        if self._frame is not None:
            self._blacklist(self._frame, points)

    def _cleaned(self, grid: OccupancyGrid) -> OccupancyGrid:
        """The grid without noise, if it is to be cleaned; what is occupied stays occupied."""
        if self._clean:
            cells = np.where(grid.occupied, grid.cells, without_noise(grid).cells)
            grid = OccupancyGrid(cells, grid.resolution, grid.origin)
        if not grid.free.any():
            raise MapError("no cell of the robot's map is free: nothing is known of any floor")
        return grid

    def _follow(self, grid: OccupancyGrid) -> tuple[_Frame, Box]:
        """What follows the grid, and the box around the cells that have changed since the last decision."""
        frame = self._frame
        if frame is not None and _place(frame.grid) == _place(grid):
            changed = true_box(frame.grid.cells != grid.cells)
            frame.grid = grid
            return frame, changed
        view = min(GAIN_RANGE, self.sensor.range_max)
        self._frame = frame = _Frame(
            grid,
            Traversability(grid.shape, self._radius, grid.resolution),
            FrontierDetector(grid.shape),
            ViewpointSelector(
                grid.shape, grid.resolution, min_size=self._min_size, gain_range=view, gain_rays=GAIN_RAYS
            ),
        )
        self._blacklist(frame, self._given_up)
        return frame, (0, grid.shape[0], 0, grid.shape[1])

    @staticmethod
    def _blacklist(frame: _Frame, points: Floats) -> None:
        cells = frame.grid.world_to_cells(points)
        inside = ((cells >= 0) & (cells < frame.grid.shape)).all(axis=1)
        frame.selector.blacklist(cells[inside].astype(np.int32))

    def _with_margin(self, grid: OccupancyGrid) -> OccupancyGrid:
        """The grid with unknown cells around what is known, as far as a frontier is looked beyond."""
        reach = math.ceil(min(GAIN_RANGE, self.sensor.range_max) / grid.resolution)
        (row0, row1, col0, col1), (rows, cols) = known_box(grid.cells), grid.shape
        below, left = max(reach - row0, 0), max(reach - col0, 0)
        above, right = max(row1 + reach - rows, 0), max(col1 + reach - cols, 0)
        cells = np.pad(grid.cells, ((below, above), (left, right)), constant_values=UNKNOWN)
        x, y = grid.cell_to_world(-below - 0.5, -left - 0.5)
        return OccupancyGrid(cells, grid.resolution, Pose(x, y, grid.origin.theta))


def _check_on(grid: OccupancyGrid, pose: Pose) -> None:
    """Raise a `StartError` where a robot is not on its map."""
    (row, col), (rows, cols) = grid.world_to_cell(pose.x, pose.y), grid.shape
    if not (0 <= row < rows and 0 <= col < cols):
        raise StartError(
            f"the robot is not on its map: ({pose.x:g}, {pose.y:g}) is {col} cells along x and {row} along y "
            f"from the map's origin ({grid.origin.x:g}, {grid.origin.y:g}), the map has {cols} x {rows} cells"
        )


def _place(grid: OccupancyGrid) -> tuple[tuple[int, int], float, Pose]:
    """Where the cells of a grid lie."""
    return grid.shape, grid.resolution, grid.origin
