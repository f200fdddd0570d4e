"""The simulation: floor plan + robot + lidar + grid. The single place where time passes.

A run alternates decisions and paths. At a decision the robot knows its grid and a path to each frontier in
reach; it follows one, scanning, and decides again on arrival, or where the path is needless or blocked.

The robot's disc is tested against the same cells that the lidar sees. It plans on what it knows; a wall that
it has not seen stops it, and touching the wall puts it on the map.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from functools import cached_property

import numpy as np

from layoutexplore.errors import ConfigError, checks_calls, shortened
from layoutexplore.frontiers.answers import completed
from layoutexplore.frontiers.decision import PATHS, STOP, Choice, Decision, Predictor, Privileged, Truth
from layoutexplore.frontiers.viewpoints import cells_in_view, facing, remaining_share
from layoutexplore.frontiers.walks import NO_SIGHTS, checked_walk, plain_choice
from layoutexplore.grids.arrays import Floats, Ints, Ints32, Mask
from layoutexplore.grids.grid import Cell, Pose
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.library import load_plan
from layoutexplore.sensing.mapper import Mapper, ScanUpdate
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.path_rules import PathEvent, event_after_scan
from layoutexplore.simulation.region import clusters_inside
from layoutexplore.simulation.robot import Motion, Robot
from layoutexplore.simulation.second_look import SCANS
from layoutexplore.simulation.state import SimulationState, begin_run, checked_config, is_noisy, world_of
from layoutexplore.simulation.stop_reasons import StopReason

__all__ = ["Motion", "Simulation", "SimulationConfig"]


@checks_calls
class Simulation:
    """One robot exploring one floor plan.

    Args:
        plan: A floor plan, the name of one that ships, or a path to one.
        config: How to simulate.
        predictor: Completes each decision with a layout, frontier classes and expected areas.

    Attributes:
        plan: The floor plan.
        config: How it is simulated.
        raster: The floor plan's cells at that resolution.
        lidar: The sensor on this floor plan.
        predictor: As given.
        on_scan: Called after every scan, to film or log a run, or None; it may read all, `decision` too.

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
        >>> print(simulation.stop_reason)
        coverage
    """

    def __init__(
        self,
        plan: FloorPlan | str | os.PathLike[str],
        config: SimulationConfig | None = None,
        predictor: Predictor | None = None,
    ) -> None:
        self.config = checked_config(config, predictor)
        self.plan = plan if isinstance(plan, FloorPlan) else load_plan(plan)
        self.raster, self.lidar = world_of(self.plan, self.config)
        self.predictor = predictor
        self._noisy, self._cell = is_noisy(self.config), self.raster.resolution
        self.on_scan: Callable[[Simulation], None] | None = None

    def reset(self, seed: int = 0, start: Pose | None = None) -> Decision:
        """Begin a run.

        Args:
            seed: Decides the start (when none is given), the sensor noise and the drift.
            start: Where the robot begins.

        Raises:
            StartError: The start lies outside, in a wall, or closer to an obstacle than the robot's radius.
        """
        self.state = begin_run(self.plan, self.lidar, self.config, seed, start)
        predictor: object = self.predictor
        if isinstance(predictor, Privileged):
            predictor.reveal(self.truth)
        self._scan(full_turn=True)
        return self._next()

    @cached_property
    def state(self) -> SimulationState:
        """The current run, made by `reset`: to read, not to change; a `ConfigError` before the first one."""
        raise ConfigError("there is no run: call reset() first")

    @property
    def decision(self) -> Decision:
        """The decision that is due (computed when it is first asked for)."""
        state = self.state
        if state.decision is None:
            state.decision = self._decide()
        return state.decision

    def step(self, choice: Choice) -> Decision:
        """Act on a choice until the next decision.

        Args:
            choice: An index into `decision.frontiers`, `STOP`, or a path int32 (k, 2) of neighbouring cells
                from the robot's on: it is followed to its end, a `Walk` until its sights are seen.

        Returns:
            The next decision; the last one when the run is `done`.

        Raises:
            ConfigError: The run is over, there is no such frontier, the path jumps, or sights lie outside.
        """
        self._check_running()
        decision, state, choice = self.decision, self.state, plain_choice(choice)
        if isinstance(choice, PATHS):
            walk = checked_walk(choice, self._here(), self.mapper.grid.shape)
            with state.move(walk if len(walk.sights) else walk.path):
                if self._follow(*walk):
                    self._scan(full_turn=True)
        elif choice == STOP:
            state.stop()
            return decision
        elif not isinstance(choice, (int, np.integer)) or not 0 <= choice < len(decision.frontiers):
            told = f"{len(decision.frontiers)}, STOP ({STOP}), or a path as an array of cells"
            raise ConfigError(f"there is no frontier {shortened(choice)}: this decision has {told}")
        else:
            frontier = decision.frontiers[choice]
            path = decision.field.path_to(frontier.viewpoint)
            members = frontier.cells.copy()  # of a read-only array kernels would be compiled once more
            with state.move(int(choice), frontier.centroid):
                if self._follow(path, members, frontier.viewpoint):
                    self._look(members, frontier.viewpoint)
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
        state, robot = self.state, self.state.robot
        with state.move((float(forward), float(turn)), state.goal):
            if turn:
                robot.turn_to(robot.believed.theta + turn)
            theta = robot.believed.theta
            motion = self._translate(forward * math.cos(theta), forward * math.sin(theta))
            return motion._replace(new_cells=motion.new_cells + self._scan().new_cells)

    @property
    def done(self) -> bool:
        """Whether the run is over."""
        return bool(self.state.stop_reason)

    @property
    def stop_reason(self) -> StopReason:
        """Why the run ended: "coverage", "no_frontier", "budget" or "agent"; "" while it goes on."""
        return self.state.stop_reason

    @property
    def truth(self) -> Truth:
        """The ground truth of the run."""
        return self.state.truth

    @property
    def mapper(self) -> Mapper:
        """Holds the robot's grid."""
        return self.state.mapper

    @property
    def robot(self) -> Robot:
        """Where the robot is and what it has walked."""
        return self.state.robot

    @property
    def scans(self) -> int:
        """Number of scans taken."""
        return self.state.scans

    @property
    def decisions(self) -> int:
        """Number of decisions acted on."""
        return self.state.decisions

    @property
    def pose(self) -> Pose:
        """Where the robot really is."""
        return self.robot.pose

    @property
    def coverage(self) -> float:
        """The share of the target area that has been seen, 0..1."""
        return self.state.coverage.share

    @property
    def seen(self) -> Mask:
        """Bool (rows, cols): the part of the target area that has been seen."""
        return self.truth.target & ~self.state.coverage.unseen

    @property
    def unseen_in(self) -> Ints:
        """int64 (rooms + 1,): cells of the target area not seen yet, by room (0: in none)."""
        return self.state.coverage.unseen_in

    @property
    def target_area(self) -> float:
        """Square metres that an exploration from this start can be asked to see."""
        return self.state.coverage.target_count * self.raster.resolution**2

    @property
    def distance(self) -> float:
        """Metres travelled, with what turning costs."""
        return self.state.distance

    @property
    def max_distance(self) -> float:
        """The budget in metres."""
        return self.state.max_distance

    @property
    def track(self) -> Floats:
        """float64 (n, 3): the true poses so far, as (x, y, theta)."""
        return self.robot.track.copy()

    @property
    def curve(self) -> Floats:
        """float64 (n, 3): (distance in m, coverage 0..1, number of the scan), a row a scan."""
        return np.array(self.state.curve, np.float64)

    def _check_running(self) -> None:
        if self.done:
            raise ConfigError(f"the run is over ({self.stop_reason}): call reset() to begin another")

    def _next(self) -> Decision:
        """The decision that is due; the run is over when it has nothing to decide."""
        self.state.decision = None  # One that `on_scan` asked for on the way is out of date.
        while not (self.decision.frontiers or self.done or not self._look_again()):
            continue
        if not self.decision.frontiers:
            self.state.finish(StopReason.NO_FRONTIER)
        return self.decision

    def _look_again(self) -> bool:
        """Look from one more place before a noisy run is over; False when none is left."""
        path = self.state.path_to_look_again() if self._noisy else None
        if path is None:
            self.state.decision = None  # What was asked for on the way has outdated its distances.
            return False
        with self.state.on_the_move():
            self._follow(path, NO_SIGHTS)
            for _ in range(SCANS):
                if not self.done:
                    self._scan(full_turn=True)
        self.state.second_look.note(self.robot.believed)
        return not self.done

    def _here(self) -> Cell:
        """The robot's cell; the nearest one where drift makes it believe to be outside of its grid."""
        return self.mapper.grid.nearest_cell(self.robot.believed.x, self.robot.believed.y)

    def _decide(self) -> Decision:
        state, believed = self.state, self.robot.believed
        grid, changed = state.mapper.grid, state.changed
        field = state.traversability.distances(grid.cells, self._here())
        clusters = state.detector.update(grid.cells, changed)
        if state.region is not None:
            clusters = clusters_inside(clusters, state.region)
        frontiers = state.selector.frontiers(grid, believed, field, clusters, changed)
        state.changed = (0, 0, 0, 0)
        decision = Decision(
            step=state.decisions,
            grid=grid,
            pose=believed,
            frontiers=frontiers,
            field=field,
            distance=self.distance,
            sensor=self.config.lidar,
            robot_radius=self.config.robot_radius,
            track=self.robot.believed_track,
            goal=state.goal,
            turn_cost=self.config.turn_cost,
        )
        return completed(decision, self.predictor) if self.predictor and decision.frontiers else decision

    def _follow(self, path: Ints32, goal: Ints32, target: Cell | None = None) -> bool:
        """Follow a path, scanning on the way; whether the goal is still to be looked at from its end."""
        state = self.state
        state.follower.note_scan(state.robot)
        k = 1
        while k < len(path):
            event, k = self._segment(path, k, goal)
            if event == PathEvent.SCAN_DUE:
                event = self._scan_on_the_way(path[k:], goal)
            if event == PathEvent.STEP_DUE:
                if not self._advance(Cell(*path[k].tolist())):
                    return False
                k += 1
            elif event == PathEvent.BLOCKED and target is not None:
                path, k = state.traversability.path(state.mapper.grid.cells, self._here(), target), 1
                if len(path) == 0:
                    return False
            elif event != PathEvent.GOES_ON:
                return False
        return not self.done

    def _segment(self, path: Ints32, k: int, goal: Ints32) -> tuple[int, int]:
        """Follow a path from its cell k on until something happens: what did, and the next cell's number."""
        state = self.state
        if not state.follower.steps_itself:
            return state.follower.next_event(state.robot), k
        state.decision = None
        scans = 1 if self.on_scan else len(path)
        segment = state.follower.follow(state.robot, state.mapper, path, k, goal, scans)
        state.note_change(segment.box)
        for distance, coverage in segment.curve.tolist():
            state.note_scan(distance, coverage)
        if segment.event in (PathEvent.COVERED, PathEvent.SPENT):
            state.finish_where_due(self.config.coverage_goal)
        if self.on_scan and len(segment.curve):
            self.on_scan(self)
        return segment.event, segment.reached

    def _scan_on_the_way(self, ahead: Ints32, goal: Ints32) -> int:
        """A scan that is due on a path of which these cells lie ahead: the event that it means."""
        state = self.state
        state.robot.turn_to(state.follower.scan_heading(state.robot))
        new_occupied = self._scan().new_occupied
        state.follower.note_scan(state.robot)
        shown, cells = (state.distance, state.coverage.share), state.mapper.grid.cells
        return event_after_scan(state.follower.rules, shown, cells, new_occupied, goal, ahead)

    def _look(self, members: Ints32, viewpoint: Cell) -> None:
        """Face a frontier's cells and scan, all around if it is still there, and blacklist what is left."""
        state, cells = self.state, self.state.mapper.grid.cells
        state.robot.turn_to(facing(cells, members, viewpoint))
        self._scan()
        if not self.done and remaining_share(cells, members) >= self.config.gone_share:
            self._scan(full_turn=True)
        state.selector.blacklist(cells_in_view(cells, members, viewpoint, self._cell))

    def _advance(self, cell: Cell) -> bool:
        """One step to the centre of a neighbouring cell; whether the robot can go on."""
        state = self.state
        x, y = state.mapper.grid.cell_to_world(cell.row, cell.col)
        here = state.robot.believed
        collided = self._translate(x - here.x, y - here.y).collided
        if collided:
            state.traversability.shut(cell)
            state.robot.back_up()
            self._scan()
        return not collided and not self.done

    def _translate(self, dx: float, dy: float) -> Motion:
        """Move by (dx, dy) metres; a wall in the way goes onto the map, the budget ends with a last scan."""
        state, new = self.state, 0
        moved, collided = state.robot.translate(dx, dy)
        if collided:
            state.note_change(state.mapper.mark_occupied(state.robot.touched(dx, dy)).box)
        if state.distance >= state.max_distance:
            new = self._scan().new_cells
        return Motion(moved, collided, new)

    def _scan(self, full_turn: bool = False) -> ScanUpdate:
        """Scan from here; the grid, the coverage and the curve follow."""
        state = self.state
        state.decision = None
        full_turn = full_turn and state.look_around(self.lidar)
        if self._noisy:
            update = state.measure(self.lidar, full_turn)
        else:
            update = state.mapper.observe(self.lidar, state.robot.pose, full_turn=full_turn)
            state.coverage.update(state.mapper.grid.cells, update.box)
        state.note_change(update.box)
        state.note_scan(state.distance, state.coverage.share)
        state.finish_where_due(self.config.coverage_goal)
        if self.on_scan:
            self.on_scan(self)
        return update
