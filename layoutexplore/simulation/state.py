"""Everything of a run that changes, in one place, and how a run begins."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from layoutexplore.frontiers.decision import Decision, Truth
from layoutexplore.frontiers.detection import FrontierDetector
from layoutexplore.frontiers.viewpoints import ViewpointSelector
from layoutexplore.grids.boxes import Box, union
from layoutexplore.grids.grid import Pose
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.planning.distance_cache import DistanceCache
from layoutexplore.planning.traversability import Traversability
from layoutexplore.sensing.lidar import Lidar, LidarConfig
from layoutexplore.sensing.mapper import Mapper
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.coverage import TargetCoverage
from layoutexplore.simulation.path_following import PathFollower
from layoutexplore.simulation.path_rules import PathRules, charged_distance
from layoutexplore.simulation.robot import PERFECT_ODOMETRY, Robot, check_start, draw_start


@dataclass(eq=False)
class SimulationState:
    """A run of a `Simulation`, made by its `reset`; only the simulation changes it.

    Attributes:
        truth: The ground truth.
        robot: Where it is and believes it is, what it has walked.
        mapper: The robot's grid.
        witness: The map from the true poses, which says what was seen; the robot's own without drift.
        coverage: What of the target has been seen.
        detector: Finds the frontier clusters of the robot's grid.
        selector: Chooses their viewpoints, and remembers the blacklisted cells.
        traversability: Where the robot can plan to go.
        path_lengths: Those between frontiers, kept from decision to decision.
        follower: Drives the robot along paths.
        sensor_rng: For the noise of the lidar.
        max_distance: The budget in metres.
        changed: Around the cells of the grid that changed since the last decision, half open.
        curve: (distance in m, coverage 0..1, number of the scan) of each scan.
        scans: Number of scans taken.
        decisions: Number of decisions acted on.
        stop_reason: Why the run ended; "" while it goes on.
        goal: World point of the frontier that the robot was last sent to; None before that.
        decision: The decision that is due; None until it is asked for.
    """

    truth: Truth
    robot: Robot
    mapper: Mapper
    witness: Mapper
    coverage: TargetCoverage
    detector: FrontierDetector
    selector: ViewpointSelector
    traversability: Traversability
    path_lengths: DistanceCache
    follower: PathFollower
    sensor_rng: np.random.Generator
    max_distance: float
    changed: Box = (0, 0, 0, 0)
    curve: list[tuple[float, float, float]] = dataclasses.field(default_factory=list)
    scans: int = 0
    decisions: int = 0
    stop_reason: str = ""
    goal: tuple[float, float] | None = None
    decision: Decision | None = None

    @property
    def distance(self) -> float:
        """Metres travelled, with what turning costs."""
        return charged_distance(self.follower.rules, self.robot.walked, self.robot.turned)

    def begin_step(self, goal: tuple[float, float] | None) -> None:
        """A decision is acted on; the goal is the middle of the frontier that is gone to, if one is."""
        self.decisions += 1
        self.decision, self.goal = None, goal

    def finish(self, reason: str) -> None:
        """The run is over, unless it was before."""
        self.stop_reason = self.stop_reason or reason

    def note_change(self, box: Box) -> None:
        """The grid's cells in a box (half open) may have changed."""
        self.changed = union(self.changed, box)
        self.traversability.note(box)

    def note_scan(self, distance: float, coverage: float) -> None:
        """A scan was made when so many metres counted, and so large a share was seen with it."""
        self.scans += 1
        self.curve.append((distance, coverage, float(self.scans)))


def drifts(config: SimulationConfig) -> bool:
    """Whether the robot's belief of its pose drifts from the truth."""
    return config.odometry_noise != PERFECT_ODOMETRY


def is_noisy(config: SimulationConfig) -> bool:
    """Whether anything in a run is drawn at random after its start: readings or motions."""
    return drifts(config) or config.lidar.range_noise_std > 0 or config.lidar.dropout > 0


def begin_run(
    plan: FloorPlan, lidar: Lidar, config: SimulationConfig, seed: int, start: Pose | None
) -> SimulationState:
    """The state before the first scan.

    Args:
        plan: The floor plan.
        lidar: The sensor on it.
        config: How to simulate.
        seed: Decides the start (when none is given), the sensor noise and the drift.
        start: Where the robot begins.

    Raises:
        StartError: The start lies outside, in a wall, or closer to an obstacle than the robot's radius.
    """
    # The order of the streams is part of what a seed means.
    streams = np.random.SeedSequence(seed).spawn(3)
    start_rng, sensor_rng, motion_rng = (np.random.default_rng(stream) for stream in streams)
    raster, radius = plan.rasterize(config.resolution), config.robot_radius
    pose = draw_start(raster, radius, start_rng) if start is None else check_start(raster, radius, start)
    cell = raster.world_to_cell(pose.x, pose.y)
    truth = Truth(
        plan=plan,
        raster=raster,
        target=raster.coverage_target(radius, cell),
        reachable=raster.reachable(radius, cell),
        sensor=config.lidar,
        robot_radius=radius,
    )
    shape, resolution, origin = raster.shape, raster.resolution, raster.origin
    coverage = TargetCoverage(truth.target, raster.room_ids)
    mapper = Mapper(shape, resolution, origin)
    max_distance = config.max_distance or 100.0 + coverage.target_count * resolution**2
    return SimulationState(
        truth=truth,
        robot=Robot(raster, radius, pose, config.odometry_noise, motion_rng),
        mapper=mapper,
        witness=Mapper(shape, resolution, origin) if drifts(config) else mapper,
        coverage=coverage,
        detector=FrontierDetector(shape),
        selector=ViewpointSelector(
            shape,
            config.resolution,
            min_size=config.frontier_min_size,
            gain_range=min(config.gain_range, config.lidar.range_max),
            gain_rays=config.gain_rays,
        ),
        traversability=Traversability(shape, radius, resolution),
        path_lengths=DistanceCache(),
        follower=PathFollower(
            lidar,
            PathRules.of(config, max_distance),
            coverage,
            steps_itself=not drifts(config),
            scans_itself=not is_noisy(config),
        ),
        sensor_rng=sensor_rng,
        max_distance=max_distance,
    )


_LIDARS: WeakKeyDictionary[PlanRaster, dict[LidarConfig, Lidar]] = WeakKeyDictionary()


def shared_lidar(raster: PlanRaster, config: LidarConfig) -> Lidar:
    """One lidar per raster and sensor: its tables are read-only, and many environments share a floor plan."""
    lidars = _LIDARS.setdefault(raster, {})
    if config not in lidars:
        lidars[config] = Lidar(config, raster.occupied, raster.resolution, raster.origin)
    return lidars[config]
