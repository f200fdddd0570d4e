"""The rules of following a path, each once: when a scan is due, where it looks, what ends a segment.

Where nothing is noisy, `layoutexplore.simulation.path_following` runs them compiled; where readings or
odometry are noisy, `layoutexplore.simulation.simulation` calls the same functions from Python, scan by scan.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

from numba import njit
from numba.extending import register_jitable

from layoutexplore.frontiers.viewpoints import remaining_share
from layoutexplore.grids.arrays import Cells, Ints32
from layoutexplore.grids.grid import OCCUPIED
from layoutexplore.grids.morphology import disc_offsets
from layoutexplore.simulation.config import SimulationConfig


class PathEvent(IntEnum):
    """What ends a segment of a path."""

    GOES_ON = 0
    """Nothing in particular: the path's end, or as many scans as were asked for."""

    STEP_DUE = 1
    """A step for `Robot.translate`: a wall may stop it, the budget may end in it, odometry may drift."""

    SCAN_DUE = 2
    """A scan that the caller has to make, because its readings are noisy."""

    COVERED = 3
    """The coverage goal is reached."""

    GONE = 4
    """Too little is left of the frontier that the path leads to."""

    BLOCKED = 5
    """The last scan found an obstacle on the rest of the path."""

    SPENT = 6
    """Turning for the last scan has spent the budget."""


class PathRules(NamedTuple):
    """When to scan and when to stop; numba kernels take it as it is.

    Attributes:
        spacing: Metres between scans.
        gone_share: A frontier of which less than this share is left is gone, 0..1.
        max_distance: Metres after which the run is over, with what turning costs.
        turn_cost: Metres charged for turning by one radian.
        coverage_goal: Share of the target area that has to be seen, 0..1.
        disc: int32 (n, 2), offsets of the cells under the robot.
    """

    spacing: float
    gone_share: float
    max_distance: float
    turn_cost: float
    coverage_goal: float
    disc: Ints32

    @staticmethod
    def of(config: SimulationConfig, max_distance: float) -> PathRules:
        """The rules of a configuration, with the budget that it comes to on a floor plan."""
        return PathRules(
            config.scan_spacing - 1e-9,  # As many steps of one cell as make up the spacing are enough.
            float(config.gone_share),
            float(max_distance),
            float(config.turn_cost),
            float(config.coverage_goal),
            disc_offsets(config.robot_radius / config.resolution),
        )


@register_jitable
def charged_distance(rules: PathRules, walked: float, turned: float) -> float:
    """Metres that count: those walked, and what turning by so many radians costs."""
    return walked + rules.turn_cost * turned


@register_jitable
def scan_is_due(rules: PathRules, walked: float, scanned_at: float) -> bool:
    """Whether the spacing has been walked since the last scan of this path, or since its beginning."""
    return walked - scanned_at >= rules.spacing


@register_jitable
def scan_heading(x: float, y: float, from_x: float, from_y: float) -> float:
    """Heading of a scan on the way, in radians: the direction from the place of the last one to here."""
    return math.atan2(y - from_y, x - from_x)


@register_jitable
def event_after_scan(
    rules: PathRules,
    shown: tuple[float, float],
    cells: Cells,
    new_occupied: int,
    frontier: Ints32,
    ahead: Ints32,
) -> int:
    """What a scan on the way means for the rest of a path, the number of a `PathEvent`.

    Args:
        rules: The rules.
        shown: The run's curve after the scan: metres charged so far, and the share of the target area seen.
        cells: int8 (rows, cols), the grid after the scan.
        new_occupied: How many cells the scan found to be occupied.
        frontier: int32 (n, 2), the cells of the frontier that the path leads to; none when it leads to none.
        ahead: int32 (m, 2), the cells of the path that are still ahead.
    """
    distance, coverage = shown
    # The ends of the run come first, whatever became of the frontier.
    if coverage >= rules.coverage_goal:
        return PathEvent.COVERED.value
    if distance >= rules.max_distance:
        return PathEvent.SPENT.value
    if len(frontier) == 0:  # An agent's own path is followed to its end, or until a wall stops the robot.
        return PathEvent.GOES_ON.value
    if remaining_share(cells, frontier) < rules.gone_share:
        return PathEvent.GONE.value
    # Only cells that became occupied can block a path that was free when it was planned.
    if new_occupied > 0 and is_blocked(cells, ahead, rules.disc):
        return PathEvent.BLOCKED.value
    return PathEvent.GOES_ON.value


@njit(cache=True, nogil=True)
def is_blocked(cells: Cells, path: Ints32, offsets: Ints32) -> bool:
    """Whether an occupied cell lies within the offsets int32 (n, 2) of a path's cells int32 (k, 2)."""
    rows, cols = cells.shape
    for k in range(len(path)):
        for n in range(len(offsets)):
            r, c = path[k, 0] + offsets[n, 0], path[k, 1] + offsets[n, 1]
            if 0 <= r < rows and 0 <= c < cols and cells[r, c] == OCCUPIED:
                return True
    return False
