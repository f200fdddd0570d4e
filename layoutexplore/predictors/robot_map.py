"""Decisions on the map of a robot of your own, as its SLAM publishes it.

A simulation maps, decides and moves. Here the robot maps and moves; what lies between is the same: frontiers
that it can look at, the rest of the rooms as a predictor completes them, and which frontiers are closed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from layoutexplore.errors import ConfigError, MapError, StartError, checks_calls
from layoutexplore.frontiers.answers import completed
from layoutexplore.frontiers.decision import PATHS, STOP, Choice, Decision, path_of
from layoutexplore.frontiers.detection import FrontierDetector
from layoutexplore.frontiers.viewpoints import GAIN_RANGE, GAIN_RAYS, MIN_SIZE, ViewpointSelector
from layoutexplore.frontiers.walks import checked_walk, plain_choice
from layoutexplore.grids.arrays import Cells, Floats, Ints32
from layoutexplore.grids.boxes import Box, grown_box, known_box, true_box, union
from layoutexplore.grids.grid import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    Cell,
    OccupancyGrid,
    Pose,
    check_cell_range,
    in_cells,
)
from layoutexplore.grids.morphology import dilate_by_disc, disc_offsets, inflate
from layoutexplore.importing.cleaning import without_noise
from layoutexplore.options import FLAG, POSE, Rule, check_kind
from layoutexplore.planning.shortest_paths import descend, geodesic_distances
from layoutexplore.planning.traversability import Traversability
from layoutexplore.predictors import make_predictor
from layoutexplore.sensing.lidar import LidarConfig
from layoutexplore.sensing.lidar import sensor as sensor_of

GIVEN_UP = 0.1
"""Metres around a frontier that was given up in which nothing is offered: maps change and move by a cell."""

WAY_OUT = 1.0
"""Metres that a robot which has no room where it stands may be away from where it has."""

CLEANING_MARGIN = 1.0
"""Metres of the unknown around what is known that tell what is cleaned where the outside is."""

_SAME_CELL = 1e-3
"""Share of a cell by which two grids may lie apart and have the same cells: ROS rounds resolutions."""


Place = tuple[tuple[int, int], float, Pose]
"""Where the cells of a grid lie: its shape, resolution and origin."""


@dataclass(frozen=True, eq=False)
class _Seen:
    """What a robot knows in the frame of a decision: the cells int8 of a box (half open), no others."""

    place: Place
    box: Box
    cells: Cells


@dataclass(eq=False)
class _Frame:
    """What follows a grid while its cells stay where they are, and what that was before cleaning."""

    grid: OccupancyGrid
    seen: _Seen
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
        self._track, self._way_out = np.empty((0, 3)), np.empty((0, 2), np.int32)
        self._goal: tuple[float, float] | None = None
        self._given_up = np.empty((0, 2))

    def decide(self, grid: OccupancyGrid, pose: Pose) -> Decision:
        """What is to be decided on the map as it is now: at any time, and as often as one likes.

        While the cells stay cells of one frame, however many there are, only what has changed is looked at
        again.

        Args:
            grid: What the robot knows. Probabilities count as ROS's map_server has them; around what is known
                the decision's grid has unknown cells as far as a frontier is looked beyond.
            pose: Where the robot is. Where the map leaves it no room, paths begin at the nearest place that
                has, and `way` leads there first.

        Returns:
            The decision, without a frontier where nothing is left that the robot could look at. Its path
            lengths can be asked for until the next one.

        Raises:
            MapError: No cell of the grid is free.
            StartError: The robot is not on its map, or nowhere near it has room.
        """
        check_kind("grid", grid, OccupancyGrid)
        pose = Pose(*(float(value) for value in POSE.convert("pose", pose)))
        _check_on(grid, pose)
        seen = self._seen(grid)
        grid = self._cleaned(seen)
        self._way_out = _way_out(grid, pose, self._radius)
        frame, changed = self._follow(grid, seen)
        frame.traversability.note(changed)
        field = frame.traversability.distances(frame.grid.cells, Cell(*self._way_out[-1].tolist()))
        self._track = np.concatenate([self._track, [pose]])
        clusters = frame.detector.update(frame.grid.cells, changed)
        decision = Decision(
            step=len(self._track) - 1,
            grid=frame.grid,
            pose=pose,
            frontiers=frame.selector.frontiers(frame.grid, pose, field, clusters, changed),
            field=field,
            distance=float(np.hypot(*np.diff(self._track[:, :2], axis=0).T).sum()),
            sensor=self.sensor,
            robot_radius=self._radius,
            track=self._track,
            goal=self._goal,
        )
        return completed(decision, self.predictor) if self.predictor and decision.frontiers else decision

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
            ConfigError: There is no such frontier, the path does not lead from the robot from cell to cell,
                or the decision is no longer the last one.
        """
        choice, goal = plain_choice(choice), None
        if isinstance(choice, PATHS):
            if decision.step != len(self._track) - 1:
                raise ConfigError("the decision is no longer the last one: choose on that one")
            out = self._way_out.tolist()
            here = out[0 if path_of(choice)[:1].tolist() == out[:1] else -1]
            path = checked_walk(choice, Cell(*here), decision.grid.shape).path
        else:
            number = Rule(kind=int, low=STOP, high=len(decision.frontiers) - 1).convert("choice", choice)
            if number == STOP:
                return np.empty((0, 2))
            frontier = decision.frontiers[number]
            path, goal = decision.field.path_to(frontier.viewpoint), frontier.centroid
        self._goal = goal
        is_out = tuple(path[0]) == tuple(self._way_out[-1])
        return decision.grid.cells_to_world(np.concatenate([self._way_out[:-1], path]) if is_out else path)

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

    def _cleaned(self, seen: _Seen) -> OccupancyGrid:
        """What is seen, without noise if it is to be cleaned; what is occupied stays occupied."""
        before, cells = self._frame, seen.cells
        if before and _alike(before.seen, seen) and np.array_equal(before.seen.cells, cells):
            return before.grid
        shape, resolution, origin = seen.place
        if self._clean and cells.size:
            margin = in_cells(CLEANING_MARGIN, resolution)
            around = OccupancyGrid(np.pad(cells, margin, constant_values=UNKNOWN), resolution)
            clean = without_noise(around).cells[margin:-margin, margin:-margin]
            cells = np.where(cells == OCCUPIED, cells, clean)
        if not (cells == FREE).any():
            raise MapError("no cell of the robot's map is free: nothing is known of any floor")
        canvas = np.full(shape, UNKNOWN, np.int8)
        canvas[_part(seen.box)] = cells
        return OccupancyGrid(canvas, resolution, origin)

    def _follow(self, grid: OccupancyGrid, seen: _Seen) -> tuple[_Frame, Box]:
        """What follows the grid, and the box around the cells that have changed since the last decision."""
        frame = self._frame
        if frame is not None and frame.seen.place == seen.place:
            changed = _changes(frame.grid.cells, grid.cells, union(frame.seen.box, seen.box))
            frame.grid, frame.seen = grid, seen
            return frame, changed
        view = min(GAIN_RANGE, self.sensor.range_max)
        self._frame = frame = _Frame(
            grid,
            seen,
            Traversability(grid.shape, self._radius, grid.resolution),
            FrontierDetector(grid.shape),
            ViewpointSelector(
                grid.shape, grid.resolution, min_size=self._min_size, gain_range=view, gain_rays=GAIN_RAYS
            ),
        )
        self._blacklist(frame, self._given_up)
        return frame, seen.box

    @staticmethod
    def _blacklist(frame: _Frame, points: Floats) -> None:
        """Never offer what lies within `GIVEN_UP` of points float64 (n, 2) in metres."""
        around = disc_offsets(in_cells(GIVEN_UP, frame.grid.resolution), closed=True)
        cells = (frame.grid.world_to_cells(points)[:, None] + around).reshape(-1, 2)
        inside = ((cells >= 0) & (cells < frame.grid.shape)).all(axis=1)
        frame.selector.blacklist(np.unique(cells[inside], axis=0).astype(np.int32))

    def _seen(self, grid: OccupancyGrid) -> _Seen:
        """What is known of a grid, in a frame that reaches as far around it as a frontier is looked beyond.

        It is the frame before while the cells are cells of that and the margin fits; a new frame has twice
        the margin, or a map that grows would soon leave it.
        """
        known = known_box(grid.cells)
        cells = grid.cells[_part(known)].copy()  # SLAM may go on writing into the array
        if cells.size:
            if cells.min() < UNKNOWN or cells.max() > OCCUPIED:
                check_cell_range(grid.cells)
            cells = OccupancyGrid(cells, grid.resolution).trinary.cells
        reach = math.ceil(min(GAIN_RANGE, self.sensor.range_max) / grid.resolution)
        box = union((0, grid.shape[0], 0, grid.shape[1]), _shifted(known, -reach, -reach, 2 * reach))
        before = self._frame and self._frame.grid
        if before and (at := _offset(before, grid)):
            around = at.row, at.row + before.shape[0], at.col, at.col + before.shape[1]
            if union(box, around) == around:
                return _Seen(_place(before), _shifted(known, -at.row, -at.col), cells)
            box = _shifted(box, -reach, -reach, 2 * reach)
        x, y = grid.cell_to_world(box[0] - 0.5, box[2] - 0.5)
        shape = box[1] - box[0], box[3] - box[2]
        place = shape, grid.resolution, Pose(x, y, grid.origin.theta)
        return _Seen(place, _shifted(known, -box[0], -box[2]), cells)


def _part(box: Box) -> tuple[slice, slice]:
    """The slices of an array that are a box."""
    return slice(box[0], box[1]), slice(box[2], box[3])


def _shifted(box: Box, rows: int, cols: int, larger: int = 0) -> Box:
    """A box moved by so many rows and columns, and made larger at its end."""
    return box[0] + rows, box[1] + rows + larger, box[2] + cols, box[3] + cols + larger


def _changes(before: Cells, cells: Cells, box: Box) -> Box:
    """The box around the cells that differ, all of which lie in a box."""
    inner = (0, 0, 0, 0) if before is cells else true_box(before[_part(box)] != cells[_part(box)])
    return _shifted(inner, box[0], box[2]) if inner[1] else inner


def _alike(one: _Seen, other: _Seen) -> bool:
    return one.place == other.place and one.box == other.box


def _offset(before: OccupancyGrid, grid: OccupancyGrid) -> Cell | None:
    """Which cell of a grid the first one of another is, maybe outside; None where cells do not match."""
    first = before.cell_to_world(0, 0)
    cell = grid.world_to_cell(*first)
    away = math.dist(grid.cell_to_world(*cell), first) / grid.resolution
    alike = before.resolution == grid.resolution and before.origin.theta == grid.origin.theta
    return cell if alike and away < _SAME_CELL else None


def _check_on(grid: OccupancyGrid, pose: Pose) -> None:
    """Raise a `StartError` where a robot is not on its map."""
    (row, col), (rows, cols) = grid.world_to_cell(pose.x, pose.y), grid.shape
    if not (0 <= row < rows and 0 <= col < cols):
        raise StartError(
            f"the robot is not on its map: ({pose.x:g}, {pose.y:g}) is {col} cells along x and {row} along y "
            f"from the map's origin ({grid.origin.x:g}, {grid.origin.y:g}), the map has {cols} x {rows} cells"
        )


def _way_out(grid: OccupancyGrid, pose: Pose, radius: float) -> Ints32:
    """The shortest path int32 (k, 2) from the robot's cell to the nearest one from which it can plan.

    Maps and poses are off by a cell or two: to the map, a robot beside a wall stands too near to it, or in
    it. Where the robot is, nothing can be in its way; but from free cells that lead on, walls are not passed.
    """
    here = grid.world_to_cell(pose.x, pose.y)
    margin = in_cells(WAY_OUT, grid.resolution) + math.ceil(radius / grid.resolution)
    top, bottom, left, right = grown_box((here.row, here.row + 1, here.col, here.col + 1), margin, grid.shape)
    cells, at = grid.cells[top:bottom, left:right], Cell(here.row - top, here.col - left)
    occupied, own = cells == OCCUPIED, np.zeros(cells.shape, np.bool_)
    room = (cells == FREE) & ~inflate(occupied, radius, grid.resolution)
    own[at] = True
    if (room & dilate_by_disc(own, 1)).any():  # it has room, or beside it there is
        return np.array([here], np.int32)
    passable, leads_on = ~occupied, False
    if cells[at] == FREE:
        lengths = geodesic_distances(passable, at, grid.resolution)
        leads_on = bool((np.isfinite(lengths) & (room | (lengths > WAY_OUT))).any())
    if not leads_on:
        passable |= dilate_by_disc(own, radius / grid.resolution)
        lengths = geodesic_distances(passable, at, grid.resolution)
    nearest = np.unravel_index(np.where(room, lengths, np.inf).argmin(), cells.shape)
    if not (room[nearest] and lengths[nearest] <= WAY_OUT):
        raise StartError(
            f"the robot has no room at ({pose.x:g}, {pose.y:g}) nor within {WAY_OUT:g} m of it: it gets to "
            f"no free cells of its map there that are {radius:g} m (robot_radius) from what is occupied"
        )
    return descend(lengths, passable, Cell(*map(int, nearest))) + np.array([top, left], np.int32)


def _place(grid: OccupancyGrid) -> Place:
    return grid.shape, grid.resolution, grid.origin
