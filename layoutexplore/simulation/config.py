"""How a run is simulated: every option of `layoutexplore.simulation.simulation.Simulation`, with its unit and default."""

from __future__ import annotations

import math
from dataclasses import dataclass

from layoutexplore.errors import ConfigError
from layoutexplore.sensing.lidar import LidarConfig, sensor
from layoutexplore.simulation.robot import PERFECT_ODOMETRY, OdometryNoise


@dataclass(frozen=True, kw_only=True)
class SimulationConfig:
    """How a run is simulated.

    Attributes:
        resolution: Metres per grid cell.
        sensor: A preset's name or a `LidarConfig`.
        robot_radius: Metres. 0.2 m is a small indoor robot.
        scan_spacing: Metres between scans while walking.
        coverage_goal: The run ends when this share of the target area has been seen, 0..1.
        max_distance: Budget in metres; None means 100 m plus 1 m for every square metre of target area
            (about five times what going to the nearest frontier needs).
        turn_cost: Metres charged for turning by one radian; 0 makes turning free.
        frontier_min_size: Metres; shorter frontiers are offered only when no longer one is left.
        gain_range: Metres up to which `Frontier.visible_area` looks (never beyond the sensor's range).
        gain_rays: Rays per viewpoint for `Frontier.visible_area`.
        gone_share: A walk ends early when less than this share of the target frontier is left, 0..1.
        odometry_noise: How the believed pose drifts; the error enters the map.

    Raises:
        ConfigError: A value is not finite or out of its range.
    """

    resolution: float = 0.1
    sensor: str | LidarConfig = "stage"
    robot_radius: float = 0.2
    scan_spacing: float = 0.5
    coverage_goal: float = 0.99
    max_distance: float | None = None
    turn_cost: float = 0.0
    frontier_min_size: float = 0.4
    gain_range: float = 8.0
    gain_rays: int = 120
    gone_share: float = 0.1
    odometry_noise: OdometryNoise = PERFECT_ODOMETRY

    def __post_init__(self) -> None:
        sensor(self.sensor)
        for name in (
            "resolution",
            "robot_radius",
            "scan_spacing",
            "coverage_goal",
            "gain_range",
            "gain_rays",
        ):
            _check(name, getattr(self, name), above=0.0)
        if not isinstance(self.gain_rays, int):
            raise ConfigError(f"gain_rays must be a whole number above 0, got {self.gain_rays!r}")
        for name in ("turn_cost", "frontier_min_size", "gone_share"):
            _check(name, getattr(self, name), least=0.0)
        for name, whole in (("coverage_goal", "the target area"), ("gone_share", "a frontier")):
            if getattr(self, name) > 1:
                raise ConfigError(
                    f"{name} is a share of {whole} and cannot exceed 1, got {getattr(self, name)}"
                )
        if self.max_distance is not None:
            _check("max_distance", self.max_distance, above=0.0)
        _check("odometry_noise.translation", self.odometry_noise.translation, least=0.0)
        _check("odometry_noise.rotation", self.odometry_noise.rotation, least=0.0)

    @property
    def lidar(self) -> LidarConfig:
        """The sensor's configuration."""
        return sensor(self.sensor)


def _check(name: str, value: float, *, above: float = -math.inf, least: float = -math.inf) -> None:
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not (number and math.isfinite(value) and value > above and value >= least):
        bound = f"above {above:g}" if math.isfinite(above) else f"{least:g} or more"
        raise ConfigError(f"{name} must be a finite number {bound}, got {value!r}")
