"""Where a robot with drifting odometry believes it is, corrected by every scan."""

from __future__ import annotations

import math

from layoutexplore.grids.arrays import Floats32
from layoutexplore.grids.grid import OccupancyGrid, Pose
from layoutexplore.sensing.lidar import LidarConfig
from layoutexplore.sensing.scan_matching import ScanMatcher
from layoutexplore.simulation.robot import OdometryNoise, Robot

POSITION_FLOOR, HEADING_FLOOR = 0.01, 0.003
"""Metres and radians by which a pose may be wrong where the robot has hardly moved since the last scan."""

ENOUGH = 10.0
"""So many points on known walls correct a pose."""

LOST = 30.0
"""Metres without a correction after which the search grows no wider: what it would find is chance."""


class Localiser:
    """Matches scans with the map, as wide around the believed pose as odometry can have drifted since.

    In the middle of a hall no wall is in range. What odometry drifts there adds up until walls tell.

    Args:
        grid: The robot's grid.
        noise: How its odometry drifts.
    """

    def __init__(self, grid: OccupancyGrid, noise: OdometryNoise) -> None:
        self._matcher, self._noise, self._corrected = ScanMatcher(grid), noise, 0.0

    def metres_uncorrected(self, robot: Robot) -> float:
        """Metres that the robot has walked since a scan corrected its pose."""
        return robot.walked - self._corrected

    def correct(self, robot: Robot, ranges: Floats32, lidar: LidarConfig, *, full_turn: bool) -> Pose:
        """The pose from which a scan is to be integrated; the robot believes it from now on."""
        metres = min(self.metres_uncorrected(robot), LOST)
        heading_drift = self._noise.rotation * math.sqrt(metres)
        # A heading that drifts on the way leads aside: the integral of a random walk.
        drift = math.hypot(self._noise.translation * math.sqrt(metres), heading_drift * metres / math.sqrt(3))
        pose = self._matcher.match(
            robot.believed,
            ranges,
            lidar,
            position_std=POSITION_FLOOR + drift,
            heading_std=HEADING_FLOOR + heading_drift,
            full_turn=full_turn,
        )
        if self._matcher.overlap >= ENOUGH:
            self._corrected = robot.walked
        robot.relocate(pose)
        self._matcher.add(pose, ranges, lidar, full_turn=full_turn)
        return pose
