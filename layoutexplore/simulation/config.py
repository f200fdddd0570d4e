"""How a run is simulated: every option of a `Simulation`, with its unit and default."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, NamedTuple

from layoutexplore.errors import ConfigError, unknown_name
from layoutexplore.frontiers.viewpoints import GAIN_RANGE, GAIN_RAYS, MIN_SIZE
from layoutexplore.metrics.exploration import FULLY_SEEN
from layoutexplore.options import FLAG, SHARE, Rule, check, check_kind, make_floats
from layoutexplore.sensing.lidar import LidarConfig, sensor
from layoutexplore.simulation.region import Region, check_region
from layoutexplore.simulation.robot import PERFECT_ODOMETRY, OdometryNoise


class NoiseLevel(NamedTuple):
    """How wrong a robot's sensors are.

    Attributes:
        odometry: Drift of the believed pose.
        range_std: Standard deviation of a range, in metres.
        dropout: Probability that a beam fails.
    """

    odometry: OdometryNoise
    range_std: float
    dropout: float


NOISE: dict[str, NoiseLevel] = {
    "low": NoiseLevel(OdometryNoise(translation=0.01, rotation=0.0035), range_std=0.01, dropout=0.0),
    "middle": NoiseLevel(OdometryNoise(translation=0.02, rotation=0.01), range_std=0.03, dropout=0.01),
    "high": NoiseLevel(OdometryNoise(translation=0.05, rotation=0.03), range_std=0.05, dropout=0.05),
}
"""Levels of noise, after data sheets and what is usual for wheeled robots.

"low": a surveying-grade lidar (SICK LMS 200: 5 mm statistical, 15 mm systematic error) and calibrated
wheels, a fifth of a degree a metre. "middle": the error of a Hokuyo UTM-30LX (30 mm up to 10 m) and odometry
as it comes, half a degree. "high": a low-cost lidar (LDS-01: 3.5 to 5 % of the range beyond half a metre) and
wheels that slip, nearly two degrees.
"""


@dataclass(frozen=True, kw_only=True)
class SimulationConfig:
    """How a run is simulated.

    Attributes:
        resolution: Metres per grid cell.
        sensor: A preset's name or a `LidarConfig`.
        robot_radius: Metres. 0.2 m is a small indoor robot.
        scan_spacing: Metres between scans on a path.
        coverage_goal: The run ends when this share of the target area has been seen, 0..1.
        max_distance: Budget in metres; None means 100 m plus 1 m for every square metre of target area.
            Going to the nearest frontier needs a fifth to a quarter of that at the median, and more the
            smaller the rooms are: on one hospital's floor all of it.
        turn_cost: Metres charged for turning by one radian; 0 makes turning free. To look all around, a lidar
            that looks ahead turns once; the look with which a run begins is free.
        frontier_min_size: Metres; shorter frontiers are offered only when no longer one is left.
        gain_range: Metres up to which `Frontier.visible_area` looks (never beyond the sensor's range).
        gain_rays: Rays per viewpoint for `Frontier.visible_area`.
        gone_share: A path ends early when less than this share of the target frontier is left, 0..1.
        region: Corners (x, y) in metres of a polygon that is explored alone: frontiers outside are not
            offered, coverage counts inside, and the robot starts inside. The whole building when None.
        noise: A level of `NOISE`: "low", "middle" or "high" sets the odometry's drift and the lidar's noise,
            which `odometry` and `lidar` tell; "" leaves both as they are given. Beside a level neither has
            noise of its own, unless it is the level's.
        odometry_noise: How the believed pose drifts; what scan matching leaves of it enters the map. With a
            level of noise it stays as it is.
        scan_matching: Correct a drifting pose by matching each scan with the map, as SLAM does.

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
    frontier_min_size: float = MIN_SIZE
    gain_range: float = GAIN_RANGE
    gain_rays: int = GAIN_RAYS
    gone_share: float = 0.1
    noise: str = ""
    odometry_noise: OdometryNoise = PERFECT_ODOMETRY
    region: Region | None = None
    scan_matching: bool = True

    def __post_init__(self) -> None:
        sensor(self.sensor)
        check_kind("noise", self.noise, str)
        check_kind("odometry_noise", self.odometry_noise, OdometryNoise)
        if self.noise:
            self._check_noise()
        check(
            self,
            resolution=Rule(low=0.01, high=10.0),
            robot_radius=Rule(above=0.0, high=10.0),
            scan_spacing=Rule(low=0.01, high=1e4),
            coverage_goal=Rule(above=0.0, high=1.0),
            max_distance=Rule(above=0.0, high=1e7, optional=True),
            turn_cost=Rule(low=0.0, high=1e4),
            frontier_min_size=Rule(low=0.0, high=1e4),
            gain_range=Rule(above=0.0, high=1e4),
            gain_rays=Rule(kind=int, low=1, high=10_000),
            gone_share=SHARE,
            scan_matching=FLAG,
        )
        lidar = sensor(self.sensor)
        if lidar.range_max < self.resolution:
            raise ConfigError(
                f"lidar {lidar.name!r}: its range_max of {lidar.range_max:g} m is less than a cell's side "
                f"(resolution) of {self.resolution:g} m: nothing would be seen"
            )
        noise = Rule(low=0.0, high=100.0)
        check(self.odometry_noise, "odometry_noise.", translation=noise, rotation=noise)
        make_floats(self.odometry_noise)
        make_floats(self)
        object.__setattr__(self, "region", check_region(self.region))

    def _check_noise(self) -> None:
        """See that there is such a level, and no noise beside it; files tell the level's own noise, too."""
        if self.noise not in NOISE:
            raise unknown_name("noise", self.noise, NOISE)
        level, lidar = NOISE[self.noise], sensor(self.sensor)
        if self.odometry_noise not in (PERFECT_ODOMETRY, level.odometry):
            raise ConfigError(f"noise={self.noise!r} sets odometry_noise: give one of the two")
        if lidar.noisy and (lidar.range_noise_std, lidar.dropout) != level[1:]:
            raise ConfigError(
                f"noise={self.noise!r} sets range_noise_std and dropout of the lidar {lidar.name!r}: "
                "give one of the two"
            )
        object.__setattr__(self, "odometry_noise", PERFECT_ODOMETRY)

    @property
    def odometry(self) -> OdometryNoise:
        """How the believed pose drifts: as the level of noise says, if there is one."""
        return NOISE[self.noise].odometry if self.noise else self.odometry_noise

    @property
    def lidar(self) -> LidarConfig:
        """The sensor's configuration."""
        config = sensor(self.sensor)
        if not self.noise:
            return config
        level = NOISE[self.noise]
        return dataclasses.replace(config, range_noise_std=level.range_std, dropout=level.dropout)

    def as_table(self) -> dict[str, Any]:
        """The options as plain nested values; `odometry_noise` is the drift that a level of noise sets."""
        return dataclasses.asdict(self) | {"odometry_noise": dataclasses.asdict(self.odometry)}

    # Pickles tell the drift of the level, too, as tables do and as those of earlier versions did.
    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"odometry_noise": self.odometry}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, **({"odometry_noise": PERFECT_ODOMETRY} if state.get("noise") else {}))
