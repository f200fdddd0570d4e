"""Following a path with scans on the way, compiled, until something happens that Python has to see to.

Between two decisions a robot makes a hundred steps and ten scans, and hardly ever does one of them ask for
more than arithmetic.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from layoutexplore.errors import checks_making
from layoutexplore.frontiers.decision import CellPath
from layoutexplore.grids.arrays import Bytes, Cells, Floats, Ints, Ints32, Labels, Mask
from layoutexplore.grids.boxes import Box
from layoutexplore.grids.grid import Pose
from layoutexplore.sensing.lidar import Lidar
from layoutexplore.sensing.mapper import Mapper, field_of_view
from layoutexplore.sensing.scan_kernels import (
    COL0,
    COL1,
    FREE_CHANGE,
    NEW,
    NEW_OCCUPIED,
    OCCUPIED_CHANGE,
    ROW0,
    ROW1,
    FieldOfView,
    update_occupancy,
)
from layoutexplore.simulation.coverage import TargetCoverage, strike_seen
from layoutexplore.simulation.path_rules import (
    PathEvent,
    PathRules,
    charged_distance,
    event_after_scan,
    scan_heading,
    scan_is_due,
)
from layoutexplore.simulation.robot import Floor, Robot, advance_along

_X, _Y, _HEADING, _WALKED, _TURNED, _SCANNED_AT, _FROM_X, _FROM_Y = range(8)
"""Places in a kernel's float64 state: pose, metres and radians in all, metres and place of the last scan."""

_UNSEEN = 8
"""Place in a kernel's int64 totals of the cells left to see, behind those of the mapper's `Changes`."""


class _Sensor(NamedTuple):
    """What scans need: the world, and what is seen of it."""

    clearance: Bytes
    field_of_view: FieldOfView


class _Maps(NamedTuple):
    """What scans change: the robot's grid, and what a `TargetCoverage` counts in it."""

    cells: Cells
    unseen: Mask
    rooms: Labels
    unseen_in: Ints
    target_count: int


class _Task(NamedTuple):
    """A path, its first cell still ahead, the frontier it leads to, and how many scans to make at most.

    With -1 scans the caller makes them.
    """

    path: Ints32
    first: int
    frontier: Ints32
    scans: int


class _Log(NamedTuple):
    """Written by the kernel: poses float64 (n, 3), a (distance, coverage) a scan, and totals int64 (9,)."""

    track: Floats
    curve: Floats
    totals: Ints


class PathSegment(NamedTuple):
    """A part of a path that was followed.

    Attributes:
        event: What ended it.
        reached: Cells of the path that are behind the robot, the one it stands in included.
        curve: float64 (scans, 2), distance in metres and coverage after each scan.
        box: Around all cells of the grid that changed.
    """

    event: int
    reached: int
    curve: Floats
    box: Box


@checks_making
class PathFollower:
    """Drives one robot along paths on one floor plan.

    Args:
        lidar: The sensor on the floor plan.
        rules: When to scan and when to stop.
        coverage: What is to be seen.
        steps_itself: Whether `follow` makes the steps; the caller, by `next_event`, where odometry drifts.
        scans_itself: Whether it makes the scans; where readings are noisy each is `SCAN_DUE`.
    """

    def __init__(
        self,
        lidar: Lidar,
        rules: PathRules,
        coverage: TargetCoverage,
        *,
        steps_itself: bool = True,
        scans_itself: bool = True,
    ) -> None:
        self._sensor = _Sensor(lidar.padded_clearance, field_of_view(lidar.config, lidar.resolution))
        self.rules, self._coverage = rules, coverage
        self.steps_itself, self.scans_itself = steps_itself, scans_itself
        self._since = (0.0, 0.0, 0.0)

    def note_scan(self, robot: Robot) -> None:
        """A scan was made here, or a path begins here: the next scan is due after the spacing."""
        self._since = (robot.walked, robot.believed.x, robot.believed.y)

    def scan_heading(self, robot: Robot) -> float:
        """Heading in radians of a scan that is due here."""
        _, x, y = self._since
        return scan_heading(robot.believed.x, robot.believed.y, x, y)

    def next_event(self, robot: Robot) -> PathEvent:
        """What is due next where each step and scan is the caller's."""
        due = scan_is_due(self.rules, robot.walked, self._since[0])
        return PathEvent.SCAN_DUE if due else PathEvent.STEP_DUE

    def follow(
        self, robot: Robot, mapper: Mapper, path: CellPath, first: int, frontier: Ints32, scans: int
    ) -> PathSegment:
        """Follow a path until something happens, or to its end.

        Args:
            robot: It is moved.
            mapper: Its grid takes the scans.
            path: int32 (n, 2), cells.
            first: The first of them that is still ahead.
            frontier: int32 (m, 2), the cells of the frontier that the path leads to, or other cells that it
                is followed to see, or none at all.
            scans: How many scans to make at most.
        """
        coverage = self._coverage
        state = np.array([*robot.pose, robot.walked, robot.turned, *self._since])
        log = _Log(
            np.empty((len(path) - first, 3)),
            np.empty((len(path) - first, 2)),
            np.array([0, 0, 0, 0, 0, 0, 0, 0, coverage.unseen_count]),
        )
        task = _Task(path, first, frontier, scans if self.scans_itself else -1)
        seen = (coverage.unseen, coverage.rooms, coverage.unseen_in, coverage.target_count)
        maps = _Maps(mapper.grid.cells, *seen)
        event, reached, steps, made = _follow(task, state, robot.floor, self._sensor, self.rules, maps, log)
        x, y, heading, walked, turned, *since = state.tolist()
        self._since = (since[0], since[1], since[2])
        robot.arrive(log.track[:steps], Pose(x, y, heading), walked, turned)
        totals = log.totals.tolist()
        update = mapper.count(tuple(totals[:_UNSEEN]))
        coverage.unseen_count = totals[_UNSEEN]
        return PathSegment(event, reached, log.curve[:made], update.box)


@njit(cache=True, nogil=True)
def _follow(
    task: _Task, state: Floats, floor: Floor, sensor: _Sensor, rules: PathRules, maps: _Maps, log: _Log
) -> tuple[int, int, int, int]:
    """The event, the number of cells behind the robot, and the numbers of steps and scans."""
    path, points = task.path, _centres(task.path, task.first, floor)
    k, steps, scans = task.first, 0, 0
    while k < len(path):
        if not scan_is_due(rules, state[_WALKED], state[_SCANNED_AT]):
            pause = rules.spacing - state[_WALKED] + state[_SCANNED_AT]
            end = rules.max_distance - rules.turn_cost * state[_TURNED]
            count, state[_WALKED] = advance_along(
                floor, state[_X], state[_Y], points[k:], state[_WALKED], pause, end, log.track[steps:]
            )
            # No step at all: a wall or the end of the budget lies in the next one.
            if count == 0:
                return PathEvent.STEP_DUE.value, k, steps, scans
            log.track[steps : steps + count, 2] = state[_HEADING]
            k, steps = k + count, steps + count
            state[_X], state[_Y] = log.track[steps - 1, 0], log.track[steps - 1, 1]
        # At the path's end no scan is due: the robot scans there in its own way, facing the frontier.
        if k == len(path) or not scan_is_due(rules, state[_WALKED], state[_SCANNED_AT]):
            continue
        if task.scans < 0:
            return PathEvent.SCAN_DUE.value, k, steps, scans
        _turn(state, scan_heading(state[_X], state[_Y], state[_FROM_X], state[_FROM_Y]))
        new_occupied = _scan(state, floor, sensor, maps, log.totals)
        coverage = 1.0 - log.totals[_UNSEEN] / maps.target_count
        shown = charged_distance(rules, state[_WALKED], state[_TURNED]), coverage
        log.curve[scans, 0], log.curve[scans, 1] = shown
        scans += 1
        state[_SCANNED_AT], state[_FROM_X], state[_FROM_Y] = state[_WALKED], state[_X], state[_Y]
        event = event_after_scan(rules, shown, maps.cells, new_occupied, task.frontier, path[k:])
        if event != PathEvent.GOES_ON.value or scans == task.scans:
            return event, k, steps, scans
    return PathEvent.GOES_ON.value, k, steps, scans


@njit(cache=True, nogil=True)
def _centres(path: Ints32, first: int, floor: Floor) -> Floats:
    """World points float64 (n, 2) of the centres of a path's cells; those before `first` stay empty."""
    points = np.empty((len(path), 2))
    for k in range(first, len(path)):
        points[k, 0] = (path[k, 1] + 0.5) * floor.resolution + floor.x
        points[k, 1] = (path[k, 0] + 0.5) * floor.resolution + floor.y
    return points


@njit(cache=True, nogil=True)
def _turn(state: Floats, heading: float) -> None:
    """Turn on the spot to a heading in -pi .. pi, the short way round, as `Robot.turn_to` does."""
    turn = heading - state[_HEADING]
    if turn > math.pi:
        turn -= 2 * math.pi
    elif turn < -math.pi:
        turn += 2 * math.pi
    state[_TURNED] += abs(turn)
    state[_HEADING] = heading


@njit(cache=True, nogil=True)
def _scan(state: Floats, floor: Floor, sensor: _Sensor, maps: _Maps, totals: Ints) -> int:
    """Scan from where the robot is: the grid and what is unseen follow. How many cells became occupied."""
    heading = state[_HEADING]
    x, y = (state[_X] - floor.x) / floor.resolution, (state[_Y] - floor.y) / floor.resolution
    update = update_occupancy(sensor.clearance, maps.cells, x, y, heading, sensor.field_of_view)
    totals[NEW] += update[NEW]
    totals[NEW_OCCUPIED] += update[NEW_OCCUPIED]
    totals[FREE_CHANGE] += update[FREE_CHANGE]
    totals[OCCUPIED_CHANGE] += update[OCCUPIED_CHANGE]
    row0, row1, col0, col1 = update[ROW0], update[ROW1], update[COL0], update[COL1]
    # Boxes are half open; an empty one (row0 == row1) says nothing of where it lies and must not be joined.
    if row0 < row1:
        totals[_UNSEEN] -= strike_seen(
            maps.cells, maps.unseen, maps.rooms, maps.unseen_in, row0, row1, col0, col1
        )
        if totals[ROW0] < totals[ROW1]:
            row0, row1 = min(row0, totals[ROW0]), max(row1, totals[ROW1])
            col0, col1 = min(col0, totals[COL0]), max(col1, totals[COL1])
        totals[ROW0], totals[ROW1], totals[COL0], totals[COL1] = row0, row1, col0, col1
    return update[NEW_OCCUPIED]
