"""How a run is simulated: every option of a `Simulation`, with its unit and default."""

from __future__ import annotations

from dataclasses import dataclass

from layoutexplore.metrics.exploration import FULLY_SEEN
from layoutexplore.options import COUNT, NON_NEGATIVE, POSITIVE, SHARE, Rule, check
from layoutexplore.sensing.lidar import LidarConfig, sensor
from layoutexplore.simulation.robot import PERFECT_ODOMETRY, OdometryNoise


@dataclass(frozen=True, kw_only=True)
class SimulationConfig:
    """How a run is simulated.

    Attributes:
        resolution: Metres per grid cell.
        sensor: A preset's name or a `LidarConfig`.
        robot_radius: Metres. 0.2 m is a small indoor robot.
        scan_spacing: Metres between scans on a path.
        coverage_goal: The run ends when this share of the target area has been seen, 0..1.
        max_distance: Budget in metres; None means 100 m plus 1 m for every square metre of target area
            (about five times what going to the nearest frontier needs).
        turn_cost: Metres charged for turning by one radian; 0 makes turning free.
        frontier_min_size: Metres; shorter frontiers are offered only when no longer one is left.
        gain_range: Metres up to which `Frontier.visible_area` looks (never beyond the sensor's range).
        gain_rays: Rays per viewpoint for `Frontier.visible_area`.
        gone_share: A path ends early when less than this share of the target frontier is left, 0..1.
        odometry_noise: How the believed pose drifts; the error enters the map.

    Raises:
        ConfigError: A value is not finite or out of its range.
    """

    resolution: float = 0.1
    sensor: str | LidarConfig = "stage"
    robot_radius: float = 0.2
    scan_spacing: float = 0.5
    coverage_goal: float = FULLY_SEEN
    max_distance: float | None = None
    turn_cost: float = 0.0
    frontier_min_size: float = 0.4
    gain_range: float = 8.0
    gain_rays: int = 120
    gone_share: float = 0.1
    odometry_noise: OdometryNoise = PERFECT_ODOMETRY

    def __post_init__(self) -> None:
        sensor(self.sensor)
        check(
            self,
            resolution=POSITIVE,
            robot_radius=POSITIVE,
            scan_spacing=POSITIVE,
            coverage_goal=Rule(above=0.0, high=1.0),
            max_distance=Rule(above=0.0, optional=True),
            turn_cost=NON_NEGATIVE,
            frontier_min_size=NON_NEGATIVE,
            gain_range=POSITIVE,
            gain_rays=COUNT,
            gone_share=SHARE,
        )
        check(self.odometry_noise, "odometry_noise.", translation=NON_NEGATIVE, rotation=NON_NEGATIVE)

    @property
    def lidar(self) -> LidarConfig:
        """The sensor's configuration."""
        return sensor(self.sensor)
