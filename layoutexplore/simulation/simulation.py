"""The simulation: floor plan + robot + lidar + grid. The single place where time passes.

A run alternates decisions and walks. At a decision the robot knows its grid, the reachable frontiers and the
way to each; it walks to the one that is chosen, scanning on the way, and decides again on arrival, when the
frontier has dissolved or when the way turns out to be blocked. The environments, the benchmark and the
recorder all drive this class.

The robot's disc is tested against the same cells that the lidar sees. It plans on what it knows; a wall that
it has not seen stops it, and touching the wall puts it on the map.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path as FilePath
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError
from layoutexplore.frontiers.decision import (
    STOP,
    Choice,
    Decision,
    Frontier,
    Path,
    Predictor,
    Privileged,
    Truth,
)
from layoutexplore.frontiers.detection import FrontierDetector
from layoutexplore.frontiers.viewpoints import Outlook, facing, looked_at, remaining_share
from layoutexplore.grids.boxes import Box, union
from layoutexplore.grids.grid import Cell, Pose
from layoutexplore.grids.morphology import disc_offsets
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.library import load_plan
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.planning.distance_cache import PathTable
from layoutexplore.planning.shortest_paths import check_path
from layoutexplore.planning.traversability import Ground
from layoutexplore.sensing.lidar import Lidar, LidarConfig
from layoutexplore.sensing.mapper import Mapper, ScanUpdate
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.coverage import Coverage
from layoutexplore.simulation.path_following import (
    BLOCKED,
    COVERED,
    GOES_ON,
    GONE,
    NEEDS_STEP,
    NO_FRONTIER,
    Walker,
)
from layoutexplore.simulation.robot import (
    PERFECT_ODOMETRY,
    Motion,
    Robot,
    check_start,
    draw_start,
    path_is_blocked,
)

__all__ = ["Motion", "Simulation", "SimulationConfig"]


class Simulation:
    """One robot exploring one floor plan.

    Args:
        plan: A floor plan, the name of one that ships, or a path to one.
        config: How to simulate.
        predictor: Completes each decision with a layout, frontier classes and expected areas.

    Attributes:
        truth: The ground truth of the current run.
        mapper: Holds the robot's grid.
        lidar: The sensor on this floor plan.
        robot: Where the robot is and what it has walked.
        scans: Number of scans taken.
        decisions: Number of decisions acted on.
        stop_reason: Why the run ended: "coverage", "no_frontier", "budget" or "agent"; "" while it goes on.
        on_scan: Called after every scan, to film or log a run; None by default. It may read everything,
            `decision` too.

    Example:
        >>> from layoutexplore.maps.tracing import floorplan_from_ascii
        >>> plan = floorplan_from_ascii('''
        ... ###########
        ... #....#....#
        ... #.........#
        ... #....#....#
        ... ###########''', resolution=1.0)
        >>> simulation = Simulation(plan, SimulationConfig(sensor="indoor"))
        >>> decision = simulation.reset(seed=0)
        >>> while not simulation.done:
        ...     decision = simulation.step(0)
        >>> simulation.stop_reason
        'coverage'
    """

    def __init__(
        self,
        plan: FloorPlan | str | FilePath,
        config: SimulationConfig | None = None,
        predictor: Predictor | None = None,
    ) -> None:
        self.config = config or SimulationConfig()
        self.plan = plan if isinstance(plan, FloorPlan) else load_plan(plan)
        self.raster = self.plan.rasterize(self.config.resolution)
        self.lidar = shared_lidar(self.raster, self.config.lidar)
        self.predictor = predictor
        self._disc = disc_offsets(self.config.robot_radius / self.config.resolution)
        self._drifts = self.config.odometry_noise != PERFECT_ODOMETRY
        self._noisy = self._drifts or self.config.lidar.range_noise_std > 0 or self.config.lidar.dropout > 0
        self.on_scan: Callable[[Simulation], None] | None = None

    def reset(self, seed: int = 0, start: Pose | None = None) -> Decision:
        """Begin a run.

        Args:
            seed: Decides the start (when none is given), the sensor noise and the drift.
            start: Where the robot begins.

        Raises:
            StartError: The start lies outside, in a wall, or closer to an obstacle than the robot's radius.
        """
        streams = np.random.SeedSequence(seed).spawn(3)
        start_rng, self._sensor_rng, motion_rng = (np.random.default_rng(s) for s in streams)
        radius = self.config.robot_radius
        pose = (
            draw_start(self.raster, radius, start_rng)
            if start is None
            else check_start(self.raster, radius, start)
        )
        self.robot = Robot(self.raster, radius, pose, self.config.odometry_noise, motion_rng)
        cell = self.raster.world_to_cell(pose.x, pose.y)
        self.truth = Truth(
            plan=self.plan,
            raster=self.raster,
            target=self.raster.coverage_target(radius, cell),
            reachable=self.raster.reachable(radius, cell),
            sensor=self.config.lidar,
            robot_radius=radius,
        )
        shape, resolution, origin = self.raster.shape, self.raster.resolution, self.raster.origin
        self.mapper = Mapper(shape, resolution, origin)
        # With drift the robot's map is not in the frame of the floor plan: a second one, from the true pose,
        # says what was seen.
        self._witness = Mapper(shape, resolution, origin) if self._drifts else self.mapper
        self._detector = FrontierDetector(shape)
        self._changed = (0, 0, 0, 0)
        self._coverage = Coverage(self.truth.target, self.raster.room_ids)
        self._walker = Walker(
            self.lidar, self.raster.blocked(radius), self.config, self._coverage, self.max_distance
        )
        self._outlook = Outlook(
            shape,
            self.config.resolution,
            min_size=self.config.frontier_min_size,
            gain_range=min(self.config.gain_range, self.config.lidar.range_max),
            gain_rays=self.config.gain_rays,
        )
        self._ground = Ground(shape, radius, resolution)
        self._paths = PathTable()
        self._curve: list[tuple[float, float, float]] = []
        self.stop_reason = ""
        self.scans = self.decisions = 0
        self._decision: Decision | None = None
        self._goal: tuple[float, float] | None = None
        predictor: object = self.predictor
        if isinstance(predictor, Privileged):
            predictor.reveal(self.truth)
        self._scan(full_turn=True)
        return self._next()

    @property
    def decision(self) -> Decision:
        """The decision that is due (computed when it is first asked for)."""
        if self._decision is None:
            self._decision = self._decide()
        return self._decision

    def step(self, choice: Choice) -> Decision:
        """Act on a choice until the next decision.

        Args:
            choice: An index into `decision.frontiers`, `STOP`, or a path int32 (k, 2) of neighbouring cells
                that starts at the robot's cell (for agents that know the floor plan).

        Returns:
            The next decision; the last one when the run is `done`.

        Raises:
            ConfigError: The run is over, there is no such frontier, or the path jumps.
        """
        self._check_running()
        decision = self.decision
        if isinstance(choice, np.ndarray):
            path = check_path(choice, self._here())
            self._goal = None
            self._begin_step()
            if self._walk(path, None):
                self._scan(full_turn=True)
        elif choice == STOP:
            self._finish("agent")
            return decision
        elif not 0 <= choice < len(decision.frontiers):
            raise ConfigError(
                f"there is no frontier {choice}: this decision has {len(decision.frontiers)}, or STOP ({STOP})"
            )
        else:
            self._begin_step()
            frontier = decision.frontiers[choice]
            self._goal = frontier.centroid
            if self._walk(self._distances.path_to(frontier.viewpoint), frontier):
                self._look(frontier)
        return self._next()

    def drive(self, forward: float, turn: float = 0.0) -> Motion:
        """A motion primitive: turn, then go straight until `forward` metres or a wall, then scan once.

        Args:
            forward: Metres; negative drives backwards.
            turn: Radians, counter-clockwise.

        Raises:
            ConfigError: The run is over, or a value is not finite.
        """
        self._check_running()
        if not (math.isfinite(forward) and math.isfinite(turn)):
            raise ConfigError(f"drive needs finite numbers, got forward={forward}, turn={turn}")
        self._begin_step()
        if turn:
            self.robot.turn_to(self.robot.believed.theta + turn)
        theta = self.robot.believed.theta
        moved, collided = self._translate(forward * math.cos(theta), forward * math.sin(theta))
        return Motion(moved, collided, self._scan().new_cells)

    @property
    def done(self) -> bool:
        """Whether the run is over."""
        return bool(self.stop_reason)

    @property
    def pose(self) -> Pose:
        """Where the robot really is."""
        return self.robot.pose

    @property
    def coverage(self) -> float:
        """The share of the target area that has been seen, 0..1."""
        return self._coverage.share

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Bool (rows, cols): the part of the target area that has been seen."""
        return self.truth.target & ~self._coverage.unseen

    @property
    def unseen_in(self) -> NDArray[np.int64]:
        """int64 (rooms + 1,): the cells of the target area that have not been seen, by room; entry 0 counts those in none."""
        return self._coverage.unseen_in

    @property
    def target_area(self) -> float:
        """Square metres that an exploration from this start can be asked to see."""
        return self._coverage.target_count * self.raster.resolution**2

    @property
    def distance(self) -> float:
        """Metres travelled, with what turning costs."""
        return self.robot.walked + self.config.turn_cost * self.robot.turned

    @property
    def max_distance(self) -> float:
        """The budget in metres."""
        return self.config.max_distance or 100.0 + self.target_area

    @property
    def track(self) -> NDArray[np.float64]:
        """float64 (n, 3): the true poses walked, as (x, y, theta)."""
        return self.robot.track.copy()

    @property
    def curve(self) -> NDArray[np.float64]:
        """float64 (n, 3): (distance in m, coverage 0..1, number of the scan), a row a scan."""
        return np.array(self._curve, np.float64)

    def _check_running(self) -> None:
        if self.done:
            raise ConfigError(f"the run is over ({self.stop_reason}): call reset() to begin another")

    def _next(self) -> Decision:
        """The decision that is due; the run is over when it has nothing to decide."""
        self._decision = None  # one that `on_scan` asked for on the way is out of date
        if not self.decision.frontiers:
            self._finish("no_frontier")
        return self.decision

    def _begin_step(self) -> None:
        self.decisions += 1
        self._decision = None

    def _finish(self, reason: str) -> None:
        self.stop_reason = self.stop_reason or reason

    def _here(self) -> Cell:
        """The robot's cell; with odometry noise it may believe to be outside of its grid: then the nearest cell."""
        return self.mapper.grid.nearest_cell(self.robot.believed.x, self.robot.believed.y)

    def _decide(self) -> Decision:
        grid = self.mapper.grid
        self._distances = self._ground.distances(grid.cells, self._here())
        clusters = self._detector.update(grid.cells, self._changed)
        frontiers = self._outlook.frontiers(
            grid, self.robot.believed, self._distances, clusters, self._changed
        )
        self._changed = (0, 0, 0, 0)
        decision = Decision(
            step=self.decisions,
            grid=grid,
            pose=self.robot.believed,
            frontiers=frontiers,
            field=self._distances,
            distance=self.distance,
            sensor=self.config.lidar,
            robot_radius=self.config.robot_radius,
            track=self.robot.believed_track,
            paths=self._paths,
            goal=self._goal,
        )
        return self.predictor.predict(decision) if self.predictor and decision.frontiers else decision

    def _walk(self, path: Path, frontier: Frontier | None) -> bool:
        """Walk a path, scanning on the way; whether its end was reached with the frontier still to be looked at."""
        goal = NO_FRONTIER if frontier is None else frontier.cells
        self._walker.begin(self.robot)
        k, stretch = 1, self._noisy_stretch if self._noisy else self._stretch
        while k < len(path):
            event, k = stretch(path, k, goal)
            if event == NEEDS_STEP:
                if not self._advance(Cell(*path[k].tolist())):
                    return False
                k += 1
            elif event in (COVERED, GONE):
                return False
            elif event == BLOCKED and frontier is not None:
                path, k = self._ground.path(self.mapper.grid.cells, self._here(), frontier.viewpoint), 1
                if len(path) == 0:
                    return False
        return not self.done

    def _stretch(self, path: Path, k: int, goal: NDArray[np.int32]) -> tuple[int, int]:
        """Walk from cell k of a path on until something happens: what did, and the next cell's number."""
        self._decision = None
        walked = self._walker.go(
            self.robot, self.mapper, path, k, goal, scans=1 if self.on_scan else len(path)
        )
        self._note(walked.box)
        for distance, coverage in walked.curve.tolist():
            self.scans += 1
            self._curve.append((distance, coverage, float(self.scans)))
        if walked.event == COVERED:
            self._finish("coverage")
        if self.on_scan and len(walked.curve):
            self.on_scan(self)
        return walked.event, walked.reached

    def _noisy_stretch(self, path: Path, k: int, goal: NDArray[np.int32]) -> tuple[int, int]:
        """The same with noise or drift, to the next scan."""
        spacing, (scanned_at, x, y) = self.config.scan_spacing - 1e-9, self._walker.since
        if self.robot.walked - scanned_at < spacing:
            reached = 0
            if not self._drifts:
                end = self.max_distance - self.config.turn_cost * self.robot.turned
                points = self.mapper.grid.cells_to_world(path[k:])
                reached = self.robot.follow(points, spacing - self.robot.walked + scanned_at, end)
            if not reached:
                return NEEDS_STEP, k
            k += reached
        if k == len(path) or self.robot.walked - scanned_at < spacing:
            return GOES_ON, k
        here = self.robot.believed
        self.robot.turn_to(math.atan2(here.y - y, here.x - x))
        update, cells = self._scan(), self.mapper.grid.cells
        self._walker.begin(self.robot)
        if self.done:
            return COVERED, k
        if len(goal) and remaining_share(cells, goal) < self.config.gone_share:
            return GONE, k
        blocked = len(goal) and update.new_occupied and path_is_blocked(cells, path[k:], self._disc)
        return BLOCKED if blocked else GOES_ON, k

    def _look(self, frontier: Frontier) -> None:
        """Face the frontier and scan, turn fully if it is still there, and do not offer again what even that leaves."""
        cells = self.mapper.grid.cells
        self.robot.turn_to(facing(cells, frontier.cells, frontier.viewpoint))
        self._scan()
        if not self.done and remaining_share(cells, frontier.cells) >= self.config.gone_share:
            self._scan(full_turn=True)
        rest = looked_at(cells, frontier.cells, frontier.viewpoint, self.raster.resolution)
        self._outlook.exhaust(rest)

    def _advance(self, cell: Cell) -> bool:
        """One step to the centre of a neighbouring cell; whether the walk can go on."""
        x, y = self.mapper.grid.cell_to_world(cell.row, cell.col)
        here = self.robot.believed
        _, collided = self._translate(x - here.x, y - here.y)
        if collided:
            self._ground.shut(cell)
            self._scan()
        return not collided and not self.done

    def _translate(self, dx: float, dy: float) -> tuple[float, bool]:
        """Move by (dx, dy) metres; a wall that stops the robot goes onto the map, the budget ends the run."""
        moved, collided = self.robot.translate(dx, dy)
        if collided:
            self._note(self.mapper.mark_occupied(self.robot.touched(dx, dy)).box)
        if self.distance >= self.max_distance:
            self._scan()
            self._finish("budget")
        return moved, collided

    def _scan(self, full_turn: bool = False) -> ScanUpdate:
        """Scan from here; the grid, the coverage and the curve follow."""
        self._decision = None
        full_turn = full_turn and not self.lidar.config.full_turn
        believed, pose = self.robot.believed, self.robot.pose
        if not self._noisy:
            update = seen = self.mapper.observe(self.lidar, pose, full_turn=full_turn)
        else:
            scan = self.lidar.scan_full_turn if full_turn else self.lidar.scan
            ranges = scan(pose, self._sensor_rng)
            update = seen = self.mapper.integrate(believed, ranges, self.lidar.config, full_turn=full_turn)
            if self._drifts:
                seen = self._witness.integrate(pose, ranges, self.lidar.config, full_turn=full_turn)
        self._note(update.box)
        self._coverage.update(self._witness.grid.cells, seen.box)
        self.scans += 1
        self._curve.append((self.distance, self.coverage, float(self.scans)))
        if self.coverage >= self.config.coverage_goal:
            self._finish("coverage")
        if self.on_scan:
            self.on_scan(self)
        return update

    def _note(self, box: Box) -> None:
        self._changed = union(self._changed, box)
        self._ground.note(box)


_LIDARS: WeakKeyDictionary[PlanRaster, dict[LidarConfig, Lidar]] = WeakKeyDictionary()


def shared_lidar(raster: PlanRaster, config: LidarConfig) -> Lidar:
    """One lidar per raster and sensor: its tables are read-only, and many environments share a floor plan."""
    lidars = _LIDARS.setdefault(raster, {})
    if config not in lidars:
        lidars[config] = Lidar(config, raster.occupied, raster.resolution, raster.origin)
    return lidars[config]
