"""Everything of a run that changes, in one place, and how a run begins."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from layoutexplore.errors import ConfigError, shortened
from layoutexplore.frontiers.decision import STOP, CellPath, Choice, Decision, Predictor, Truth
from layoutexplore.frontiers.detection import FrontierDetector
from layoutexplore.frontiers.viewpoints import ViewpointSelector
from layoutexplore.grids.arrays import Mask
from layoutexplore.grids.boxes import Box, union
from layoutexplore.grids.grid import Pose
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.options import SEED, check_kind
from layoutexplore.planning.traversability import LARGE, Traversability
from layoutexplore.sensing.lidar import Lidar, LidarConfig
from layoutexplore.sensing.mapper import Mapper, ScanUpdate
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.coverage import TargetCoverage
from layoutexplore.simulation.localisation import Localiser
from layoutexplore.simulation.path_following import PathFollower
from layoutexplore.simulation.path_rules import PathRules, charged_distance
from layoutexplore.simulation.plan_warnings import warn_of_plan, warn_of_reach
from layoutexplore.simulation.region import region_mask
from layoutexplore.simulation.robot import PERFECT_ODOMETRY, Robot, check_start, draw_start
from layoutexplore.simulation.second_look import SecondLook
from layoutexplore.simulation.stop_reasons import StopReason

DRIFT_MARGIN = 0.1
"""Metres: a robot that does not quite know where it is keeps so much farther from walls while it can."""

BENT_SHARE = 0.1
"""A map that drift bends can stand out of the building by this share of the building's longer side, ..."""

BENT_MOST = 20.0
"""... and by so many metres at most."""


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
        follower: Drives the robot along paths.
        sensor_rng: For the noise of the lidar.
        max_distance: The budget in metres.
        seed: Of the run.
        start: Where it was told to begin; None where the seed decided.
        region: bool (rows, cols), where frontiers are offered and coverage counts; None for everywhere.
        second_look: Where was looked again, after noise had left no frontier.
        changed: Around the cells of the grid that changed since the last decision, half open.
        curve: (distance in m, coverage 0..1, number of the scan) of each scan.
        scans: Number of scans taken.
        decisions: Number of decisions acted on.
        stop_reason: Why the run ended, a `StopReason`; "" while it goes on.
        moves: What was done since the reset: choices, and of motion primitives (forward, turn).
        cut_at: Which of them, the first if several, an error or Ctrl-C has cut short; None where none was.
        explored: Metres when the robot set out for its start; None before that.
        goal: World point of the frontier that the robot was last sent to; None before that.
        localiser: Corrects the believed pose by each scan; None without drift.
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
    follower: PathFollower
    sensor_rng: np.random.Generator
    max_distance: float
    seed: int
    start: Pose | None
    second_look: SecondLook
    region: Mask | None = None
    changed: Box = (0, 0, 0, 0)
    curve: list[tuple[float, float, float]] = dataclasses.field(default_factory=list)
    scans: int = 0
    decisions: int = 0
    stop_reason: StopReason = StopReason.GOES_ON
    moves: list[Choice | tuple[float, float]] = dataclasses.field(default_factory=list)
    cut_at: int | None = None
    explored: float | None = None
    goal: tuple[float, float] | None = None
    localiser: Localiser | None = None
    decision: Decision | None = None

    @property
    def charged(self) -> float:
        """Metres travelled, with what turning costs and with the way back."""
        return charged_distance(self.follower.rules, self.robot.walked, self.robot.turned)

    @property
    def distance(self) -> float:
        """Metres travelled, with what turning costs, and without the way back."""
        return self.charged if self.explored is None else self.explored

    def freeze_distance(self) -> None:
        """What is travelled from now on is the way back and no longer counts."""
        self.explored = self.distance

    @contextmanager
    def move(
        self, move: Choice | tuple[float, float], goal: tuple[float, float] | None = None
    ) -> Iterator[None]:
        """A decision is acted on; the goal is the middle of the frontier that is gone to, if one is."""
        self.moves.append(move)
        self.decisions += 1
        self.decision, self.goal = None, goal
        with self.on_the_move():
            yield

    @contextmanager
    def on_the_move(self) -> Iterator[None]:
        """What is done within belongs to the last move, which is cut short where it comes to no end."""
        before = self.cut_at
        self.cut_at = len(self.moves) - 1 if before is None else before
        yield
        self.cut_at = before

    def stop(self) -> None:
        """The agent's last move."""
        self.moves.append(STOP)
        self.finish(StopReason.AGENT)

    def finish(self, reason: StopReason) -> None:
        """The run is over, unless it was before."""
        self.stop_reason = self.stop_reason or reason

    def finish_where_due(self, coverage_goal: float) -> None:
        """The run is over where this share has been seen, or the budget is spent."""
        if self.coverage.share >= coverage_goal:
            self.finish(StopReason.COVERAGE)
        if self.distance >= self.max_distance:
            self.finish(StopReason.BUDGET)

    def note_change(self, box: Box) -> None:
        """The grid's cells in a box (half open) may have changed."""
        self.changed = union(self.changed, box)
        self.traversability.note(box)

    def look_around(self, lidar: Lidar) -> bool:
        """Turn once if the lidar does not see all around; whether it does not. To begin a run is free."""
        turns = not lidar.config.full_turn
        if turns and self.moves:
            self.robot.turn_around()
        return turns

    def measure(self, lidar: Lidar, full_turn: bool) -> ScanUpdate:
        """Scan with noise from where the robot is, and map it from where it believes to be."""
        scan = lidar.scan_full_turn if full_turn else lidar.scan
        ranges = scan(self.robot.pose, self.sensor_rng)
        if self.localiser is not None:
            self.localiser.correct(self.robot, ranges, lidar.config, full_turn=full_turn)
        update = self.mapper.integrate(self.robot.believed, ranges, lidar.config, full_turn=full_turn)
        seen = update
        if self.witness is not self.mapper:
            seen = self.witness.integrate(self.robot.pose, ranges, lidar.config, full_turn=full_turn)
        self.coverage.update(self.witness.grid.cells, seen.box)
        return update

    def path_to_look_again(self) -> CellPath | None:
        """The path int32 (k, 2) to the next place from which to look again; None when none is left."""
        grid = self.mapper.grid
        if not self.second_look.begun:
            self.selector.forgive()
            self.traversability.plan_with(self.truth.robot_radius)
        self.traversability.reopen()
        clusters = self.detector.update(grid.cells, self.changed)
        return self.second_look.next_path(grid, self.robot.believed_track, clusters, self.traversability)

    def note_scan(self, distance: float, coverage: float) -> None:
        """A scan was made when so many metres counted, and so large a share was seen with it."""
        self.scans += 1
        self.curve.append((distance, coverage, float(self.scans)))


def drifts(config: SimulationConfig) -> bool:
    """Whether the robot's belief of its pose drifts from the truth."""
    return config.odometry != PERFECT_ODOMETRY


def corrects(config: SimulationConfig) -> bool:
    """Whether scans correct the robot's belief of its pose."""
    return drifts(config) and config.scan_matching


def is_noisy(config: SimulationConfig) -> bool:
    """Whether anything in a run is drawn at random after its start: readings or motions."""
    return drifts(config) or config.lidar.range_noise_std > 0 or config.lidar.dropout > 0


def checked_config(config: SimulationConfig | None, predictor: Predictor | None) -> SimulationConfig:
    """The configuration of a simulation, the default one when None.

    Raises:
        ConfigError: It is no configuration, or the predictor cannot predict.
    """
    check_kind("config", config, SimulationConfig, optional=True)
    if predictor is not None and not callable(getattr(predictor, "predict", None)):
        raise ConfigError(
            f"predictor must have a method predict(decision), got {shortened(predictor)}: "
            "layoutexplore.predictors.make_predictor makes one of a name, or of what has rooms(decision)"
        )
    return config or SimulationConfig()


def raster_of(plan: FloorPlan, config: SimulationConfig) -> PlanRaster:
    """The cells of a floor plan that a run takes place on: where drift bends the map, with room around them.

    What the robot believes to be beyond the cells cannot be mapped: its rooms would be lost.

    Warns:
        MapWarning: The plan's scale is a guess, or much of its floor is out of reach.
    """
    raster = plan.rasterize(config.resolution)
    if drifts(config):
        x0, y0, x1, y1 = plan.bounds
        margin = math.ceil(BENT_SHARE * max(x1 - x0, y1 - y0))
        raster = plan.rasterize(config.resolution, margin=min(margin, BENT_MOST))
    warn_of_plan(plan, raster, config.robot_radius, whole=config.region is None)
    return raster


def is_large(plan: FloorPlan, config: SimulationConfig) -> bool:
    """Whether the map of a whole floor plan has so many cells that paths on it are found in another way."""
    x0, y0, x1, y1 = plan.bounds
    return config.region is None and (x1 - x0) * (y1 - y0) >= LARGE * config.resolution**2


def world_of(plan: FloorPlan, config: SimulationConfig) -> tuple[PlanRaster, Lidar]:
    """The cells that a run takes place on, and the sensor among them."""
    raster = raster_of(plan, config)
    return raster, shared_lidar(raster, config.lidar)


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
        StartError: The start lies outside, in a wall, closer to an obstacle than the robot's radius, or not
            in the region; or the robot fits nowhere in the region.
    """
    SEED.convert("seed", seed)
    # The order of the streams is part of what a seed means.
    streams = np.random.SeedSequence(seed).spawn(3)
    start_rng, sensor_rng, motion_rng = (np.random.default_rng(stream) for stream in streams)
    raster, radius = raster_of(plan, config), config.robot_radius
    region = None if config.region is None else region_mask(raster, config.region)
    if start is None:
        pose = draw_start(raster, radius, start_rng, region)
    else:
        pose = check_start(raster, radius, start, region)
    cell = raster.world_to_cell(pose.x, pose.y)
    if start is not None and region is None and not raster.reachable(radius)[cell]:
        warn_of_reach(plan, raster, radius, cell)
    truth = Truth(plan, raster, cell, config.lidar, radius, region, seed)
    shape, resolution, origin = raster.shape, raster.resolution, raster.origin
    coverage = TargetCoverage(truth.target, raster.room_ids)
    mapper = Mapper(shape, resolution, origin)
    max_distance = config.max_distance or 100.0 + coverage.target_count * resolution**2
    return SimulationState(
        truth=truth,
        robot=Robot(raster, radius, pose, config.odometry, motion_rng),
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
        traversability=Traversability(shape, radius + DRIFT_MARGIN if drifts(config) else radius, resolution),
        follower=PathFollower(
            lidar,
            PathRules.of(config, max_distance),
            coverage,
            steps_itself=not drifts(config),
            scans_itself=not is_noisy(config),
        ),
        sensor_rng=sensor_rng,
        max_distance=max_distance,
        seed=seed,
        start=start,
        second_look=SecondLook(config.frontier_min_size),
        region=region,
        localiser=Localiser(mapper.grid, config.odometry) if corrects(config) else None,
    )


_LIDARS: WeakKeyDictionary[PlanRaster, dict[LidarConfig, Lidar]] = WeakKeyDictionary()


def shared_lidar(raster: PlanRaster, config: LidarConfig) -> Lidar:
    """One lidar per raster and sensor: its tables are read-only, and many environments share a floor plan."""
    lidars = _LIDARS.setdefault(raster, {})
    if config not in lidars:
        lidars[config] = Lidar(config, raster.occupied, raster.resolution, raster.origin)
    return lidars[config]
