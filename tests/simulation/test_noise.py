"""Noisy robots: levels of noise, drift that scans correct, and the second look before a run is over."""

from __future__ import annotations

import math
import pickle
from dataclasses import asdict, replace

import numpy as np
import pytest

from layoutexplore.agents import make_agent
from layoutexplore.errors import ConfigError, UnknownNameError
from layoutexplore.frontiers.detection import FrontierClusters
from layoutexplore.grids.grid import Cell, OccupancyGrid, Pose
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.planning.traversability import Traversability
from layoutexplore.sensing.lidar import sensor
from layoutexplore.simulation.config import NOISE, SimulationConfig
from layoutexplore.simulation.robot import BACK, OdometryNoise, Robot
from layoutexplore.simulation.second_look import TRIES, WAYS_BACK, SecondLook, way_back, way_out
from layoutexplore.simulation.simulation import Simulation

TWO_ROOMS = """
####################
#..................#
#..................#
#..................#
#........#.........#
#........#.........#
#........#.........#
####################
"""


HALL = "\n".join(("#" * 22, *("#" + "." * 20 + "#" for _ in range(20)), "#" * 22))


def explored(config: SimulationConfig, plan: str, seed: int) -> Simulation:
    simulation, agent = Simulation(plan, config), make_agent("nearest")
    agent.reset(seed=seed)
    decision = simulation.reset(seed=seed)
    while not simulation.done:
        decision = simulation.step(agent.act(decision))
    return simulation


def error(simulation: Simulation) -> float:
    """Metres between where the robot is and where it believes to be."""
    believed, true = simulation.robot.believed, simulation.robot.pose
    return float(np.hypot(believed.x - true.x, believed.y - true.y))


@pytest.mark.parametrize("turn", [0.0, 0.5 * math.pi, math.pi, -0.5 * math.pi, 0.3])
def test_a_wall_that_stops_a_robot_is_put_ahead_of_where_it_believes_to_go(turn: float) -> None:
    raster = floorplan_from_ascii(HALL, resolution=0.5, name="hall").rasterize(0.1)
    row, col = np.argwhere(~raster.blocked(0.2))[-1].tolist()  # in the highest row that it can stand in
    true = Pose(*raster.cell_to_world(row, col - 20), 0.5 * math.pi)
    robot = Robot(raster, 0.2, true, OdometryNoise(rotation=0.01), np.random.default_rng(0))
    robot.relocate(true._replace(x=true.x - 1.0, theta=true.theta - turn))
    x, y, theta = robot.believed
    assert robot.translate(0.1 * math.cos(theta), 0.1 * math.sin(theta))[1]
    walls = robot.touched(0.1 * math.cos(theta), 0.1 * math.sin(theta)) - np.array(raster.world_to_cell(x, y))
    ahead, aside = walls @ (math.sin(theta), math.cos(theta)), walls @ (math.cos(theta), -math.sin(theta))
    assert len(walls)
    assert (ahead > 1.0).all() and (abs(aside) < ahead).all()


def test_headings_of_a_track_stay_within_a_turn() -> None:
    raster = floorplan_from_ascii(HALL, resolution=0.5, name="hall").rasterize(0.1)
    robot = Robot(raster, 0.2, Pose(8.0, 5.0, 3.14), OdometryNoise(rotation=0.1), np.random.default_rng(0))
    for _ in range(40):
        robot.translate(-0.1, 0.0)
    robot.relocate(robot.believed._replace(theta=4.0))
    for track in (robot.track, robot.believed_track):
        assert abs(track[:, 2]).max() <= math.pi
    assert np.ptp(robot.track[:, 2]) > math.pi, "they went through pi"
    assert robot.believed_track[-1, 2] == pytest.approx(4.0 - 2 * math.pi)


@pytest.mark.parametrize("level", NOISE)
def test_a_level_sets_odometry_and_lidar(level: str) -> None:
    config = SimulationConfig(sensor="indoor", noise=level)
    assert config.odometry == NOISE[level].odometry
    assert config.lidar.range_noise_std == NOISE[level].range_std > 0
    assert config.lidar.range_max == sensor("indoor").range_max


@pytest.mark.parametrize("level", NOISE)
def test_a_level_is_left_and_changed_and_survives_a_table(level: str) -> None:
    config = SimulationConfig(sensor="indoor", noise=level)
    assert replace(config, noise="") == SimulationConfig(sensor="indoor")
    assert replace(config, noise="middle") == SimulationConfig(sensor="indoor", noise="middle")
    table = config.as_table()
    assert table["noise"] == level and table["odometry_noise"] == asdict(NOISE[level].odometry)
    assert list(table) == list(asdict(config)) and pickle.loads(pickle.dumps(config)) == config
    assert config.__getstate__()["odometry_noise"] == NOISE[level].odometry
    assert SimulationConfig(sensor="indoor", noise=level, odometry_noise=NOISE[level].odometry) == config
    kept = replace(config, noise="", odometry_noise=config.odometry)
    assert kept.odometry == NOISE[level].odometry and not kept.lidar.noisy


def test_levels_rise() -> None:
    low, middle, high = (NOISE[name] for name in ("low", "middle", "high"))
    assert low.range_std < middle.range_std < high.range_std
    assert low.odometry.rotation < middle.odometry.rotation < high.odometry.rotation


def test_an_unknown_level_and_two_kinds_of_odometry_are_refused() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'middle'"):
        SimulationConfig(noise="midle")
    with pytest.raises(ConfigError, match="odometry_noise"):
        SimulationConfig(noise="low", odometry_noise=OdometryNoise(translation=0.5))


@pytest.mark.parametrize("level", NOISE)
def test_a_lidar_with_other_noise_than_the_level_is_refused(level: str) -> None:
    of_level = SimulationConfig(sensor="indoor", noise=level).lidar
    assert SimulationConfig(sensor=of_level, noise=level).lidar == of_level
    for own in ({"range_noise_std": 0.5}, {"dropout": 0.5}):
        with pytest.raises(ConfigError, match=f"noise='{level}' sets range_noise_std and dropout"):
            SimulationConfig(sensor=replace(of_level, **own), noise=level)


@pytest.mark.parametrize("level", ["low", "middle"])
@pytest.mark.parametrize("seed", range(3))
def test_noisy_robots_see_all(level: str, seed: int) -> None:
    assert explored(SimulationConfig(sensor="indoor", noise=level), "apartment:3", seed).coverage >= 0.99


def test_scans_correct_the_drift() -> None:
    for seed in range(3):
        config = SimulationConfig(sensor="indoor", noise="middle")
        with_scans = explored(config, "office-01", seed)
        assert error(with_scans) < 0.35
    alone = SimulationConfig(sensor="indoor", noise="middle", scan_matching=False)
    assert max(error(explored(alone, "office-01", seed)) for seed in range(3)) > 0.35


def test_a_doorway_that_noise_has_closed_is_looked_at_anew() -> None:
    plan = floorplan_from_ascii(TWO_ROOMS, resolution=0.4)
    config = SimulationConfig(sensor="indoor", noise="low", robot_radius=0.15)
    simulation = Simulation(plan, config)
    simulation.reset(seed=0, start=Pose(2.0, 1.0, 0.0))
    # Readings have drawn a wall across the passage, and a bump has shut a cell in it.
    column = simulation.mapper.grid.nearest_cell(3.8, 2.0).col
    rows = np.flatnonzero(~simulation.raster.occupied[:, column])
    closed = np.array([(row, column + k) for row in rows for k in (0, 1)])
    simulation.state.note_change(simulation.mapper.mark_occupied(closed).box)
    simulation.state.traversability.shut(Cell(int(rows[-2]), column))
    assert not simulation.decision.distances[rows, column].max() < np.inf
    agent = make_agent("nearest")
    decision = simulation.decision
    while not simulation.done:
        decision = simulation.step(agent.act(decision))
    assert simulation.coverage >= 0.99


def test_a_robot_that_noise_has_shut_in_goes_back() -> None:
    plan = floorplan_from_ascii(TWO_ROOMS, resolution=0.4)
    simulation = Simulation(plan, SimulationConfig(sensor="indoor", noise="low", robot_radius=0.15))
    simulation.reset(seed=0, start=Pose(2.0, 1.0, 0.0))
    grid = simulation.mapper.grid
    grid.cells[:] = 0
    here = grid.nearest_cell(1.95, 1.05)
    grid.cells[here.row - 2 : here.row + 3, here.col - 5 : here.col + 5] = 100
    grid.cells[here.row - 1 : here.row + 2, here.col - 4 : here.col + 4] = 0
    traversability = Traversability(grid.cells.shape, 0.15, grid.resolution)
    traversability.note((0, grid.cells.shape[0], 0, grid.cells.shape[1]))
    track = np.array([(x, 1.05, 0.0) for x in (3.0, 2.7, 2.2, 1.95, 1.75)])
    back = way_back(grid, track, traversability)
    assert [tuple(cell) for cell in back.tolist()] == [
        tuple(grid.nearest_cell(x, y)) for x, y, _ in track[:0:-1]
    ]
    assert len(way_back(grid, track[:1], traversability)) == 0


def test_a_robot_shut_in_a_room_goes_back_through_the_door_it_came_by() -> None:
    """The room is too large to call it shut in, but it came from where more can be reached."""
    cells = np.full((40, 100), 100, np.int8)
    cells[5:35, 5:35] = cells[5:35, 40:95] = 0
    grid = OccupancyGrid(cells, 0.1)
    traversability = Traversability(cells.shape, 0.15, 0.1)
    traversability.note((0, 40, 0, 100))
    track = np.array([(x, 2.05, 0.0) for x in (9.05, 6.05, 4.55, 3.75, 3.05, 2.05)])
    assert len(way_back(grid, track, traversability)) == 0
    assert [col for _, col in way_out(grid, track, traversability).tolist()] == [20, 30, 37, 45]
    for nowhere in (track[:1], track[-2:], track[::-1]):
        assert len(way_out(grid, nowhere, traversability)) == 0
    look, clusters = SecondLook(0.4), FrontierClusters.of([])
    look.note(Pose(2.05, 2.05))
    ways = [look.next_path(grid, track, clusters, traversability) for _ in range(WAYS_BACK + 1)]
    assert all(way is not None and tuple(way[-1]) == (20, 45) for way in ways[:-1]) and ways[-1] is None


def test_a_place_that_cannot_be_reached_is_tried_and_then_left() -> None:
    plan = floorplan_from_ascii(TWO_ROOMS, resolution=0.4)
    simulation = Simulation(plan, SimulationConfig(sensor="indoor", noise="low", robot_radius=0.15))
    simulation.reset(seed=0, start=Pose(2.0, 1.0, 0.0))
    state = simulation.state
    here = (
        state.mapper.grid,
        state.robot.believed_track,
        state.detector.update(state.mapper.grid.cells, (0, 0, 0, 0)),
    )
    paths = [state.second_look.next_path(*here, state.traversability) for _ in range(20)]
    goals = [tuple(path[-1].tolist()) for path in paths if path is not None]
    assert paths[-1] is None and max(goals.count(goal) for goal in goals) == TRIES
    fresh = SecondLook(0.4)
    fresh.note(state.robot.believed)
    path = fresh.next_path(*here, state.traversability)
    assert path is None or tuple(path[-1].tolist()) != goals[0]


def test_a_robot_that_drifts_backs_up_from_a_wall() -> None:
    plan = floorplan_from_ascii(TWO_ROOMS, resolution=0.4)
    for noise, leaves in (("low", True), ("", False)):
        simulation = Simulation(plan, SimulationConfig(sensor="indoor", noise=noise))
        simulation.reset(seed=0, start=Pose(2.0, 1.5, 0.0))
        robot = simulation.robot
        moved, collided = robot.translate(0.0, -5.0)
        assert collided and moved > 0.3
        touching = robot.pose
        robot.back_up()
        away = np.hypot(robot.pose.x - touching.x, robot.pose.y - touching.y)
        assert away >= BACK if leaves else away == 0.0


def test_a_robot_that_pushes_against_a_wall_does_not_lose_its_heading() -> None:
    raster = floorplan_from_ascii(TWO_ROOMS, resolution=0.4).rasterize(0.1)
    start = Pose(*raster.cell_to_world(*np.argwhere(raster.reachable(0.2))[0].tolist()), 0.0)
    noise = OdometryNoise(rotation=0.03)
    robot = Robot(raster, 0.2, start, noise, np.random.default_rng(0))
    for _ in range(200):
        robot.translate(50.0, 0.0)
    assert abs(robot.pose.theta - robot.believed.theta) < 4 * noise.rotation * math.sqrt(robot.walked)


def test_there_is_room_around_the_building_where_drift_bends_the_map() -> None:
    plan = floorplan_from_ascii(TWO_ROOMS, resolution=0.4)
    exact = Simulation(plan, SimulationConfig(sensor="indoor"))
    noisy = Simulation(plan, SimulationConfig(sensor="indoor", noise="middle"))
    exact.reset(seed=3)
    noisy.reset(seed=3)
    assert noisy.raster.origin.x < exact.raster.origin.x and noisy.raster.shape > exact.raster.shape
    assert noisy.mapper.grid.shape == noisy.raster.shape
    # Where the robot starts, what it is to see and its budget stay what they are.
    assert noisy.pose == exact.pose and noisy.target_area == pytest.approx(exact.target_area)
    assert noisy.max_distance == pytest.approx(exact.max_distance)


def test_drift_adds_up_where_no_wall_is_in_range() -> None:
    """A hall that is wider than the lidar sees: from its far wall the robot must know how little it knows."""
    plan = floorplan_from_ascii("\n".join(["#" * 30, *["#" + "." * 28 + "#"] * 28, "#" * 30]), resolution=1.0)
    noise = OdometryNoise(translation=0.02, rotation=0.01)
    simulation = Simulation(plan, SimulationConfig(sensor="short", odometry_noise=noise))
    simulation.reset(seed=0, start=Pose(15.0, 15.0, 0.0))
    localiser = simulation.state.localiser
    assert localiser is not None
    widths = []
    for _ in range(16):
        simulation.drive(0.5)
        widths.append(localiser.metres_uncorrected(simulation.robot))
    assert widths == pytest.approx([0.5 * (k + 1) for k in range(16)])
    while not simulation.drive(0.5).collided:
        continue
    assert localiser.metres_uncorrected(simulation.robot) < 2.0


def test_a_robot_without_noise_looks_no_second_time() -> None:
    simulation = explored(SimulationConfig(sensor="indoor", coverage_goal=1.0), "apartment:3", 0)
    assert not simulation.state.second_look.begun
