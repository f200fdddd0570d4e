"""The simulation: it explores, it is deterministic, and nothing passes through walls."""

from __future__ import annotations

import math
import multiprocessing

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.errors import ConfigError, MapError, StartError
from layoutexplore.frontiers.decision import STOP, CellPath
from layoutexplore.grids.grid import Pose
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.sensing.lidar import LidarConfig
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.robot import OdometryNoise, Robot, advance_along, draw_start
from layoutexplore.simulation.simulation import Simulation
from tests.plans import WIDE_DOORS, offices


def three_rooms() -> FloorPlan:
    return floorplan_from_ascii(WIDE_DOORS, resolution=0.5)


def explore(sensor: str | LidarConfig, seed: int, **options: object) -> Simulation:
    config = SimulationConfig(sensor=sensor, **options)  # type: ignore[arg-type]
    simulation = Simulation(three_rooms(), config)
    decision = simulation.reset(seed=seed)
    rng = np.random.default_rng(seed)
    while not simulation.done:
        decision = simulation.step(int(rng.integers(len(decision.frontiers))))
    return simulation


def test_a_sensor_that_sees_less_than_a_cell_is_refused() -> None:
    lidar = LidarConfig(range_max=0.08, fov=2 * math.pi, beams=360)  # eight metres, in hundreds
    with pytest.raises(ConfigError, match=r"range_max of 0.08 m is less than a cell's side"):
        SimulationConfig(sensor=lidar)
    assert SimulationConfig(sensor=lidar, resolution=0.05).lidar is lidar


@pytest.mark.parametrize("sensor", ["stage", "indoor", "short", "mapex"])
def test_explores_to_the_goal(sensor: str) -> None:
    simulation = explore(sensor, seed=1)
    assert simulation.stop_reason == "coverage"
    assert simulation.coverage >= 0.99
    curve = simulation.curve
    assert (np.diff(curve[:, 0]) >= 0).all() and (np.diff(curve[:, 1]) >= 0).all(), (
        "distance and coverage only grow"
    )
    assert curve[-1, 0] == simulation.distance and curve[-1, 1] == simulation.coverage
    steps = np.hypot(*np.diff(simulation.track[:, :2], axis=0).T)
    assert simulation.distance == pytest.approx(steps.sum())


def test_same_seed_same_run_and_different_seeds_differ() -> None:
    one, same, other = (explore("stage", seed) for seed in (3, 3, 4))
    assert np.array_equal(one.track, same.track) and np.array_equal(one.curve, same.curve)
    assert not np.array_equal(one.track[0], other.track[0])


def _track(seed: int) -> bytes:
    noisy = LidarConfig(range_max=8.0, fov=math.pi, beams=181, range_noise_std=0.02, dropout=0.01)
    return explore(noisy, seed, odometry_noise=OdometryNoise(translation=0.02, rotation=0.01)).track.tobytes()


def test_worker_process_gives_the_same_run() -> None:
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.apply(_track, (5,)) == _track(5)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), drift=st.booleans(), radius=st.sampled_from([0.05, 0.2, 0.3]))
def test_robot_never_enters_what_the_lidar_sees(seed: int, drift: bool, radius: float) -> None:
    """The disc keeps its distance from every wall, with and without drift, under every kind of motion."""
    noise = OdometryNoise(translation=0.05, rotation=0.05) if drift else OdometryNoise()
    simulation = Simulation(
        three_rooms(), SimulationConfig(robot_radius=radius, odometry_noise=noise, max_distance=30.0)
    )
    decision = simulation.reset(seed=seed)
    rng = np.random.default_rng(seed)
    while not simulation.done:
        if rng.random() < 0.5 or not decision.frontiers:
            simulation.drive(float(rng.uniform(-1, 2)), float(rng.uniform(-3, 3)))
            decision = simulation.decision
        else:
            decision = simulation.step(int(rng.integers(len(decision.frontiers))))
    raster = simulation.raster
    walls = np.argwhere(raster.occupied)
    points = simulation.track[:, :2]
    middles = (points[1:] + points[:-1]) / 2
    for x, y in np.concatenate([points, middles]):
        cell = raster.world_to_cell(x, y)
        nearest = np.sqrt(((walls - np.array(cell)) ** 2).sum(axis=1).min()) * raster.resolution
        assert nearest >= radius - 1e-9 and not raster.occupied[cell]


@pytest.mark.parametrize("seed", range(4))
def test_a_motion_tells_what_came_into_view_with_the_end_of_the_budget(seed: int) -> None:
    simulation = Simulation(three_rooms(), SimulationConfig(sensor="short", max_distance=1.5))
    simulation.reset(seed=seed)
    last = 0
    while not simulation.done:
        known = np.count_nonzero(simulation.mapper.grid.cells >= 0)
        motion = simulation.drive(0.4, 0.5)
        touched = 1 if motion.collided else 0
        last = np.count_nonzero(simulation.mapper.grid.cells >= 0) - known
        assert 0 <= last - motion.new_cells <= touched
    assert simulation.stop_reason == "budget" and last > 0


def test_drift_bends_the_map_and_no_drift_does_not() -> None:
    straight, bent = (
        explore("indoor", 2),
        explore("indoor", 2, odometry_noise=OdometryNoise(rotation=0.05), max_distance=20.0),
    )
    known = straight.mapper.grid.cells >= 0
    assert np.array_equal(straight.mapper.grid.cells[known] == 100, straight.raster.occupied[known])
    known = bent.mapper.grid.cells >= 0
    assert (bent.mapper.grid.cells[known] == 100).astype(bool).tolist() != bent.raster.occupied[
        known
    ].tolist()
    assert bent.robot.pose != bent.robot.believed


def test_turning_costs_what_it_is_told_to() -> None:
    free, dear = explore("stage", 6), explore("stage", 6, turn_cost=0.5)
    assert dear.robot.turned > 0 and dear.distance == pytest.approx(
        dear.robot.walked + 0.5 * dear.robot.turned
    )
    assert free.distance == free.robot.walked


def test_who_looks_ahead_turns_to_look_all_around() -> None:
    for sensor, turns in (("stage", 1), ("indoor", 0)):
        simulation = Simulation(three_rooms(), SimulationConfig(sensor=sensor, turn_cost=0.1))
        simulation.reset(seed=0)
        assert simulation.distance == 0.0
        here = simulation.decision.grid.nearest_cell(*simulation.robot.pose[:2])
        simulation.step(np.array([here], np.int32))
        assert simulation.distance == pytest.approx(0.1 * turns * 2 * math.pi)


def test_turning_spends_the_budget() -> None:
    simulation = Simulation(three_rooms(), SimulationConfig(sensor="stage", turn_cost=1.0, max_distance=10.0))
    here = simulation.reset(seed=0).grid.nearest_cell(*simulation.robot.pose[:2])
    looks = 0
    while not simulation.done and looks < 9:
        simulation.step(np.array([here], np.int32))
        looks += 1
    assert (simulation.stop_reason, looks) == ("budget", 2)


def test_stops() -> None:
    simulation = Simulation(three_rooms(), SimulationConfig(max_distance=2.0, sensor="short"))
    decision = simulation.reset(seed=0)
    while not simulation.done:
        decision = simulation.step(len(decision.frontiers) - 1)
    assert simulation.stop_reason == "budget" and simulation.distance < 2.0 + 0.2
    simulation.reset(seed=0)
    simulation.step(STOP)
    assert simulation.stop_reason == "agent"
    with pytest.raises(ConfigError, match="reset"):
        simulation.step(0)


def test_every_frontier_is_resolved_or_given_up() -> None:
    """A goal that cannot be reached ends with "no_frontier" rather than in a loop."""
    simulation = Simulation(three_rooms(), SimulationConfig(sensor="indoor", coverage_goal=1.0))
    simulation.reset(seed=0)
    for _ in range(300):
        if simulation.done:
            break
        simulation.step(0)
    assert simulation.stop_reason in ("no_frontier", "coverage") and simulation.coverage > 0.97
    assert simulation.done


def test_frontiers_come_nearest_first_and_can_be_reached() -> None:
    simulation = Simulation(three_rooms(), SimulationConfig(sensor="short"))
    decision = simulation.reset(seed=8)
    lengths = [f.path_length for f in decision.frontiers]
    assert lengths == sorted(lengths) and all(map(math.isfinite, lengths))
    for frontier in decision.frontiers:
        assert decision.traversable[frontier.viewpoint]
        assert decision.distances[frontier.viewpoint] == frontier.path_length
        assert frontier.size >= 0.4 and frontier.visible_area >= 0
    tour = decision.path_lengths(range(len(decision.frontiers)))
    assert np.allclose(tour, tour.T) and np.allclose(tour[0, 1:], lengths)


def test_paths_are_checked() -> None:
    simulation = Simulation(three_rooms())
    simulation.reset(seed=0)
    here = np.array(simulation.raster.world_to_cell(*simulation.pose[:2]), np.int32)
    with pytest.raises(ConfigError, match="starts at"):
        simulation.step(np.array([here + 5, here + 6]))
    with pytest.raises(ConfigError, match="jumps"):
        simulation.step(np.array([here, here + 2]))
    with pytest.raises(ConfigError, match="no frontier 1000"):
        simulation.step(1000)
    with pytest.raises(ConfigError, match="a path as an array"):
        simulation.step((1, 2, 3))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "start",
    [Pose(0.1, 0.1), Pose(-5.0, 3.0), Pose(float("nan"), 1.0), Pose(1.0, 0.55)],
    ids=["wall", "outside", "nan", "near"],
)
def test_bad_starts(start: Pose) -> None:
    with pytest.raises(StartError):
        Simulation(three_rooms()).reset(start=start)


@pytest.mark.parametrize(
    "options",
    [
        {"resolution": 0.0},
        {"resolution": float("nan")},
        {"robot_radius": -1.0},
        {"coverage_goal": 1.5},
        {"max_distance": -3.0},
        {"sensor": "stagee"},
        {"odometry_noise": OdometryNoise(rotation=-1.0)},
    ],
)
def test_bad_options(options: dict[str, object]) -> None:
    with pytest.raises(ConfigError):
        SimulationConfig(**options)  # type: ignore[arg-type]


@given(st.integers(0, 10_000), st.floats(0.05, 2.0), st.floats(0.2, 3.0))
@settings(max_examples=40, deadline=None)
def test_following_a_path_is_a_row_of_moves(seed: int, pause: float, end: float) -> None:
    """Until the pause, and up to the move that a wall stops or that leads too far."""
    rng = np.random.default_rng(seed)
    raster = three_rooms().rasterize(0.1)
    start = draw_start(raster, 0.2, rng)
    points = start[:2] + np.cumsum(rng.choice([-0.1, 0.0, 0.1], (30, 2)), axis=0)
    slow = Robot(raster, 0.2, start, OdometryNoise(), rng)
    reached = np.full((len(points), 3), start.theta)
    count, walked = advance_along(slow.floor, start.x, start.y, points, 0.0, pause, end, reached)
    for x, y in points[:count].tolist():
        assert slow.walked < pause and not slow.translate(x - slow.pose.x, y - slow.pose.y)[1]
    track = np.concatenate([[start], reached[:count]])
    assert tuple(track[-1]) == slow.pose and walked == pytest.approx(slow.walked)
    moved = np.concatenate([[True], (np.diff(track, axis=0) != 0).any(axis=1)])
    np.testing.assert_array_equal(track[moved], slow.track)
    if count < len(points) and slow.walked < pause:
        collided = slow.translate(*(points[count] - slow.pose[:2]).tolist())[1]
        assert collided or slow.walked >= end


def test_plan_without_room_for_the_robot() -> None:
    narrow = floorplan_from_ascii("#####\n#...#\n#####", resolution=0.1)
    with pytest.raises((MapError, StartError)):
        Simulation(narrow).reset()


def test_the_robot_gets_no_further_than_the_lidar_sees() -> None:
    config = SimulationConfig(sensor="stage")
    simulation = Simulation(offices(), config)
    ahead = config.lidar.beams // 2
    for seed in range(12):
        simulation.reset(seed=seed)
        seen = float(simulation.lidar.scan(simulation.pose)[ahead])
        moved = simulation.drive(50.0).moved
        assert moved <= seen - config.robot_radius + simulation.raster.resolution
        assert moved < seen < 50.0


def test_paths_that_jump_or_begin_elsewhere_are_refused() -> None:
    simulation = Simulation(offices())
    decision = simulation.reset(seed=0)
    here = np.array(decision.grid.world_to_cell(decision.pose.x, decision.pose.y), np.int32)
    paths: list[CellPath] = [np.stack([here, here + 2]), np.stack([here + 1, here + 2])]
    for path, said in zip(paths, ("jumps", "starts at"), strict=True):
        with pytest.raises(ConfigError, match=said):
            simulation.step(path)
    assert simulation.distance == 0.0


def test_without_a_run_it_says_so() -> None:
    simulation = Simulation(three_rooms())
    for ask in (lambda: simulation.distance, lambda: simulation.decision, lambda: simulation.step(0)):
        with pytest.raises(ConfigError, match=r"call reset\(\) first"):
            ask()
    simulation.reset(seed=0)
    assert simulation.distance == 0
