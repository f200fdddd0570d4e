"""Walking along a path with scans on the way, in one go until something happens: for runs without noise and drift.

Between two decisions a robot makes a hundred steps and ten scans, and hardly ever does one of them ask for
more than arithmetic.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.frontiers.decision import Path
from layoutexplore.frontiers.viewpoints import count_remaining
from layoutexplore.grids.boxes import Box
from layoutexplore.grids.grid import Pose
from layoutexplore.grids.morphology import disc_offsets
from layoutexplore.sensing.lidar import Lidar, beam_table
from layoutexplore.sensing.mapper import Mapper, dense_reach
from layoutexplore.sensing.scan_kernels import cast_and_mark
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.coverage import Coverage, strike_seen
from layoutexplore.simulation.robot import Robot, advance_along, is_blocked

GOES_ON, NEEDS_STEP, COVERED, GONE, BLOCKED = range(5)
"""What ends a stretch of a walk: nothing in particular; a step that only `Robot.translate` can tell about; the coverage goal;
too little is left of the frontier; an obstacle lies on the way."""

NO_FRONTIER = np.empty((0, 2), np.int32)
"""For a path that leads to no frontier: int32 (0, 2)."""

_X, _Y, _HEADING, _WALKED, _TURNED, _SCANNED_AT, _FROM_X, _FROM_Y = range(8)
_NEW, _NEW_OCCUPIED, _FREE_CHANGE, _OCCUPIED_CHANGE, _ROW0, _ROW1, _COL0, _COL1, _UNSEEN = range(9)


_Grids = tuple[NDArray[np.int8], NDArray[np.bool_], NDArray[np.int32], NDArray[np.int64]]
"""What scans change: the robot's grid, and of a `Coverage` what is unseen, the rooms, and what is unseen in each."""


class _Eye(NamedTuple):
    """What scans need: the arguments of `cast_and_mark`, and the angle of the middle of the field of view."""

    clearance: NDArray[np.uint8]
    unit_x: NDArray[np.float64]
    unit_y: NDArray[np.float64]
    range_max: float
    dense: int
    half: bool
    offset: float


class _Floor(NamedTuple):
    """Where the robot's centre may not be, bool (rows, cols), and where the cells lie."""

    blocked: NDArray[np.bool_]
    x: float
    y: float
    resolution: float


class _Rules(NamedTuple):
    """When to scan and when to stop; `disc` holds the offsets int32 (n, 2) of the cells under the robot."""

    spacing: float
    gone_share: float
    max_distance: float
    turn_cost: float
    coverage_goal: float
    target_count: int
    disc: NDArray[np.int32]


class Stretch(NamedTuple):
    """A stretch of a walk.

    Attributes:
        event: What ended it.
        reached: Cells of the path that are behind the robot, the one it stands in included.
        curve: float64 (scans, 2), distance in metres and coverage after each scan.
        box: Around all cells of the grid that changed.
    """

    event: int
    reached: int
    curve: NDArray[np.float64]
    box: Box


class Walker:
    """Walks one robot on one floor plan, in a run without sensor noise and odometry drift.

    Args:
        lidar: The sensor on the floor plan.
        blocked: bool (rows, cols), cells where the robot's centre may not be.
        config: How to simulate.
        coverage: What is to be seen.
        max_distance: Metres after which the run is over.

    Attributes:
        since: Metres walked, x and y when the walk began or the last scan of it was made.
    """

    def __init__(
        self,
        lidar: Lidar,
        blocked: NDArray[np.bool_],
        config: SimulationConfig,
        coverage: Coverage,
        max_distance: float,
    ) -> None:
        sensor, resolution, origin = lidar.config, lidar.resolution, lidar.origin
        self._eye = _Eye(
            lidar.padded_clearance,
            *beam_table(sensor),
            sensor.range_max / resolution,
            dense_reach(sensor),
            not sensor.full_turn,
            sensor.angle_offset,
        )
        self._floor = _Floor(blocked, float(origin.x), float(origin.y), float(resolution))
        self._rules = _Rules(
            config.scan_spacing - 1e-9,
            float(config.gone_share),
            float(max_distance),
            float(config.turn_cost),
            float(config.coverage_goal),
            coverage.target_count,
            disc_offsets(config.robot_radius / resolution),
        )
        self._coverage = coverage
        self.since = (0.0, 0.0, 0.0)

    def begin(self, robot: Robot) -> None:
        """Begin a walk: the next scan is due when the scan spacing has been walked from here."""
        self.since = (robot.walked, robot.believed.x, robot.believed.y)

    def go(
        self, robot: Robot, mapper: Mapper, path: Path, first: int, frontier: NDArray[np.int32], scans: int
    ) -> Stretch:
        """Walk on until something happens, or the path's end.

        Args:
            robot: It is moved.
            mapper: Its grid takes the scans.
            path: int32 (n, 2), cells.
            first: The first of them that is still ahead.
            frontier: int32 (m, 2), the cells of the frontier that is walked to, or `NO_FRONTIER`.
            scans: How many scans to make at most.
        """
        pose = robot.pose
        state = np.array([*pose, robot.walked, robot.turned, *self.since])
        track, curve = np.empty((len(path) - first, 3)), np.empty((len(path) - first, 2))
        changes = np.array([0, 0, 0, 0, 0, 0, 0, 0, self._coverage.unseen_count])
        grids = (mapper.grid.cells, self._coverage.unseen, self._coverage.rooms, self._coverage.unseen_in)
        event, reached, steps, made = _walk(
            path,
            first,
            state,
            self._floor,
            self._eye,
            self._rules,
            grids,
            frontier,
            scans,
            track,
            curve,
            changes,
        )
        x, y, heading, walked, turned, *since = state.tolist()
        self.since = (since[0], since[1], since[2])
        robot.arrive(track[:steps], Pose(x, y, heading), walked, turned)
        totals = changes.tolist()
        update = mapper.count(tuple(totals[:_UNSEEN]))
        self._coverage.unseen_count = totals[_UNSEEN]
        return Stretch(event, reached, curve[:made], update.box)


@njit(cache=True, nogil=True)
def _walk(
    path: NDArray[np.int32],
    first: int,
    state: NDArray[np.float64],
    floor: _Floor,
    eye: _Eye,
    rules: _Rules,
    grids: _Grids,
    frontier: NDArray[np.int32],
    most_scans: int,
    track: NDArray[np.float64],
    curve: NDArray[np.float64],
    changes: NDArray[np.int64],
) -> tuple[int, int, int, int]:
    """The event, the cells of the path behind the robot, and the numbers of steps and scans; see `Walker.go`."""
    points = np.empty((len(path), 2))
    for k in range(first, len(path)):
        points[k, 0] = (path[k, 1] + 0.5) * floor.resolution + floor.x
        points[k, 1] = (path[k, 0] + 0.5) * floor.resolution + floor.y
    frame = np.array([0.0, 0.0, floor.x, floor.y, floor.resolution])
    k, steps, scans = first, 0, 0
    while k < len(path):
        since = state[_WALKED] - state[_SCANNED_AT]
        if since < rules.spacing:
            pause = rules.spacing - state[_WALKED] + state[_SCANNED_AT]
            end = rules.max_distance - rules.turn_cost * state[_TURNED]
            frame[0], frame[1] = state[_X], state[_Y]
            count, state[_WALKED] = advance_along(
                floor.blocked, points[k:], frame, state[_WALKED], pause, end, track[steps:]
            )
            if count == 0:
                return NEEDS_STEP, k, steps, scans
            track[steps : steps + count, 2] = state[_HEADING]
            k, steps = k + count, steps + count
            state[_X], state[_Y] = track[steps - 1, 0], track[steps - 1, 1]
        if k == len(path) or state[_WALKED] - state[_SCANNED_AT] < rules.spacing:
            continue
        _turn(state, math.atan2(state[_Y] - state[_FROM_Y], state[_X] - state[_FROM_X]))
        new_occupied = _scan(state, floor, eye, grids, changes)
        coverage = 1.0 - changes[_UNSEEN] / rules.target_count
        curve[scans, 0], curve[scans, 1] = state[_WALKED] + rules.turn_cost * state[_TURNED], coverage
        scans += 1
        state[_SCANNED_AT], state[_FROM_X], state[_FROM_Y] = state[_WALKED], state[_X], state[_Y]
        if coverage >= rules.coverage_goal:
            return COVERED, k, steps, scans
        if len(frontier) > 0:
            if count_remaining(grids[0], frontier) / len(frontier) < rules.gone_share:
                return GONE, k, steps, scans
            if new_occupied > 0 and is_blocked(grids[0], path[k:], rules.disc):
                return BLOCKED, k, steps, scans
        if scans == most_scans:
            break
    return GOES_ON, k, steps, scans


@njit(cache=True, nogil=True)
def _turn(state: NDArray[np.float64], heading: float) -> None:
    """Turn on the spot to a heading within half a turn of 0, the short way round."""
    turn = heading - state[_HEADING]
    if turn > math.pi:
        turn -= 2 * math.pi
    elif turn < -math.pi:
        turn += 2 * math.pi
    state[_TURNED] += abs(turn)
    state[_HEADING] = heading


@njit(cache=True, nogil=True)
def _scan(
    state: NDArray[np.float64],
    floor: _Floor,
    eye: _Eye,
    grids: _Grids,
    changes: NDArray[np.int64],
) -> int:
    """Scan from where the robot is: the grid and what is unseen follow. How many cells became occupied."""
    cells, unseen, rooms, unseen_in = grids
    heading = state[_HEADING]
    update = cast_and_mark(
        eye.clearance,
        cells,
        (state[_X] - floor.x) / floor.resolution,
        (state[_Y] - floor.y) / floor.resolution,
        math.cos(heading),
        math.sin(heading),
        eye.unit_x,
        eye.unit_y,
        eye.range_max,
        eye.dense,
        eye.half,
        math.cos(heading + eye.offset),
        math.sin(heading + eye.offset),
    )
    new, new_occupied, free_change, occupied_change, row0, row1, col0, col1 = update
    changes[_NEW] += new
    changes[_NEW_OCCUPIED] += new_occupied
    changes[_FREE_CHANGE] += free_change
    changes[_OCCUPIED_CHANGE] += occupied_change
    if row0 < row1:
        changes[_UNSEEN] -= strike_seen(cells, unseen, rooms, unseen_in, row0, row1, col0, col1)
        if changes[_ROW0] < changes[_ROW1]:
            row0, row1 = min(row0, changes[_ROW0]), max(row1, changes[_ROW1])
            col0, col1 = min(col0, changes[_COL0]), max(col1, changes[_COL1])
        changes[_ROW0], changes[_ROW1], changes[_COL0], changes[_COL1] = row0, row1, col0, col1
    return new_occupied
