"""Decisions on the map of a robot of one's own: those of a simulation, whatever the map's frame does."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest

from layoutexplore.agents import make_agent
from layoutexplore.errors import ConfigError, MapError, StartError, UnknownNameError
from layoutexplore.frontiers.decision import STOP, Decision, Walk
from layoutexplore.grids.grid import OccupancyGrid, Pose
from layoutexplore.maps.library import load_plan
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.predictors import make_predictor
from layoutexplore.predictors.prior_plan import PriorPredictor
from layoutexplore.predictors.robot_map import RobotMap
from layoutexplore.priors.presets import study_prior
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.simulation import Simulation
from tests.plans import FLAT
from tests.priors.cases import office, seen_part


def run(sensor: str = "stage") -> Simulation:
    plan = floorplan_from_ascii(FLAT, resolution=1.0, name="flat")
    return Simulation(plan, SimulationConfig(sensor=sensor))


def copied(grid: OccupancyGrid) -> OccupancyGrid:
    return OccupancyGrid(grid.cells.copy(), grid.resolution, grid.origin)


def numbers(decision: Decision) -> list[tuple[float, ...]]:
    """What tells frontiers apart in any frame."""
    table = decision.table
    columns = (table.path_length, table.size, table.straight_distance, table.closed, table.expected_area)
    return [tuple(row) for row in np.stack(columns, axis=1).round(4).tolist()]


def opening() -> OccupancyGrid:
    """A room of 3.3 by 2.8 m with an opening of 1 m in its right wall."""
    cells = np.full((40, 60), -1, np.int8)
    cells[5:35, 5:40] = 100
    cells[6:34, 6:39] = 0
    cells[15:25, 39] = -1
    return OccupancyGrid(cells, 0.1)


def test_its_decisions_are_those_of_a_simulation_that_knows_the_same() -> None:
    simulation = run()
    simulation.reset(seed=1)
    robot_map = RobotMap(make_predictor("none"), clean=False)
    asked = 0
    while not simulation.done:
        decision = robot_map.decide(copied(simulation.mapper.grid), simulation.pose)
        assert numbers(decision) == numbers(simulation.decision)
        views = decision.grid.cells_to_world(decision.viewpoints)
        expected = simulation.decision.grid.cells_to_world(simulation.decision.viewpoints)
        np.testing.assert_allclose(views, expected, atol=1e-9)
        asked += 1
        simulation.step(len(decision.frontiers) - 1)
    assert asked > 3
    assert decision.step == asked - 1 and len(decision.track) == asked and decision.distance > 0


def test_a_frame_that_moves_changes_nothing() -> None:
    """SLAM widens its map as it goes: the same cells lie elsewhere in the array."""
    simulation = run()
    simulation.reset(seed=2)
    still, moved = RobotMap("layout"), RobotMap("layout")
    for k in range(4):
        grid = copied(simulation.mapper.grid)
        cells = np.pad(grid.cells, ((k, 0), (0, 2 * k)), constant_values=-1)
        x, y = grid.cell_to_world(-k - 0.5, -0.5)
        wider = OccupancyGrid(cells, grid.resolution, Pose(x, y))
        one, other = still.decide(grid, simulation.pose), moved.decide(wider, simulation.pose)
        assert numbers(one) == numbers(other)
        simulation.step(0)


def test_a_turned_map_has_the_same_frontiers() -> None:
    grid, here = opening(), Pose(1.0, 1.0, 0.3)
    c, s = math.cos(0.7), math.sin(0.7)
    turned = OccupancyGrid(grid.cells, grid.resolution, Pose(4.0, -2.0, 0.7))
    there = Pose(4.0 + c * here.x - s * here.y, -2.0 + s * here.x + c * here.y, 1.0)
    one, other = RobotMap("layout").decide(grid, here), RobotMap("layout").decide(turned, there)
    assert numbers(one) == numbers(other) and len(one.frontiers) == 1
    x, y = one.frontiers[0].centroid
    assert other.frontiers[0].centroid == pytest.approx((4.0 + c * x - s * y, -2.0 + s * x + c * y))


def test_beams_through_gaps_of_walls_are_no_frontiers() -> None:
    grid = opening()
    grid.cells[10, 39:55] = 0  # a beam through a hole of the wall
    here = Pose(1.0, 1.0)
    assert len(RobotMap("none").decide(grid, here).frontiers) == 1
    assert len(RobotMap("none", clean=False, min_size=0.0).decide(grid, here).frontiers) > 1


def test_what_is_occupied_stays_so() -> None:
    grid = opening()
    grid.cells[20, 20] = 100  # the leg of a chair
    decision = RobotMap("none").decide(grid, Pose(1.0, 1.0))
    assert np.count_nonzero(decision.grid.occupied) == np.count_nonzero(grid.occupied)


def test_the_way_leads_to_where_the_frontier_is_seen_from() -> None:
    robot_map, here = RobotMap("none"), Pose(1.0, 1.0)
    decision = robot_map.decide(opening(), here)
    way = robot_map.way(decision, 0)
    assert math.hypot(*(way[0] - here[:2])) < 0.1
    np.testing.assert_allclose(way[-1], decision.grid.cell_to_world(*decision.frontiers[0].viewpoint))
    steps = np.hypot(*np.diff(way, axis=0).T)
    assert steps.max() < 0.15 and steps.sum() == pytest.approx(decision.frontiers[0].path_length, abs=1e-5)
    assert robot_map.decide(opening(), here).goal == decision.frontiers[0].centroid
    assert robot_map.way(decision, STOP).shape == (0, 2)
    with pytest.raises(ConfigError, match="choice"):
        robot_map.way(decision, 1)


@pytest.mark.parametrize("name", ["layout-tour", "watchful-tour", "policy", "plan-tour", "nearest"])
def test_agents_choose_a_way_on_it(name: str) -> None:
    simulation = Simulation(load_plan("apartment-01"), SimulationConfig(sensor="indoor"))
    simulation.reset(seed=0)
    agent, robot_map = make_agent(name), RobotMap("layout", sensor="indoor")
    agent.reset(0)
    decision = robot_map.decide(copied(simulation.mapper.grid), simulation.pose)
    way = robot_map.way(decision, agent.act(decision))
    assert len(way) > 1
    cells = decision.grid.world_to_cells(way)
    assert decision.traversable[cells[1:, 0], cells[1:, 1]].all()


def test_what_was_given_up_is_not_offered_again() -> None:
    robot_map, here, grid = RobotMap("none"), Pose(1.0, 1.0), opening()
    decision = robot_map.decide(grid, here)
    robot_map.give_up(decision, 0)
    assert not robot_map.decide(grid, here).frontiers
    wider = OccupancyGrid(np.pad(grid.cells, ((3, 0), (0, 0)), constant_values=-1), 0.1, Pose(0.0, -0.3))
    assert not robot_map.decide(wider, here).frontiers
    smaller = OccupancyGrid(grid.cells[:, :30].copy(), 0.1)  # what was given up lies outside
    assert robot_map.decide(smaller, here).frontiers
    with pytest.raises(ConfigError, match="index"):
        robot_map.give_up(decision, 5)


@pytest.mark.parametrize("away", [0.01, 0.05, -0.04])
def test_what_was_given_up_stays_so_where_the_map_moves_or_changes_by_a_cell(away: float) -> None:
    robot_map, here, grid = RobotMap("none"), Pose(1.0, 1.0), opening()
    robot_map.give_up(robot_map.decide(grid, here), 0)
    moved = OccupancyGrid(grid.cells.copy(), 0.1, Pose(away, away))
    assert not robot_map.decide(moved, here).frontiers
    grid.cells[15:25, 38] = -1
    assert not robot_map.decide(grid, here).frontiers


@pytest.mark.parametrize("x", [0.85, 0.72, 0.65, 0.55])
def test_a_robot_to_whom_the_map_leaves_no_room_gets_out(x: float) -> None:
    """It stands beside a wall, the map is a cell off: that does not end an exploration."""
    grid = opening()
    grid.cells[18:22, 5:6] = 100  # in the wall, too
    robot_map, here = RobotMap("none"), Pose(x, 2.0)
    decision = robot_map.decide(grid, here)
    way = robot_map.way(decision, 0)
    assert math.hypot(*(way[0] - here[:2])) < 0.1
    assert np.hypot(*np.diff(way, axis=0).T).max() < 0.15
    path = decision.field.path_to(decision.frontiers[0].viewpoint)
    np.testing.assert_allclose(robot_map.way(decision, path), way)  # an agent that plans its own way


def test_a_robot_in_a_narrow_passage_is_not_led_through_its_walls() -> None:
    """A passage of four cells between two rooms, each behind a wall of one cell, opens into one of them."""
    cells = np.full((40, 60), 100, np.int8)
    cells[1:17, 1:59] = cells[18:22, 1:59] = cells[23:39, 1:59] = 0
    cells[22, 1:20], cells[5:11, 59], cells[30:36, 59] = 0, -1, -1
    grid, robot_map = OccupancyGrid(cells, 0.1), RobotMap("none", robot_radius=0.3)
    decision = robot_map.decide(grid, Pose(2.65, 1.95))
    assert len(decision.frontiers) == 1
    way = grid.world_to_cells(robot_map.way(decision, 0))
    assert (cells[way[:, 0], way[:, 1]] == 0).all()
    with pytest.raises(StartError, match=r"no room at \(4.5, 1.95\)"):
        robot_map.decide(grid, Pose(4.5, 1.95))


def test_a_robot_without_room_within_a_metre_is_told() -> None:
    grid = opening()
    with pytest.raises(StartError, match=r"no room at \(5.5, 2\)"):
        RobotMap("none").decide(grid, Pose(5.5, 2.0))
    robot_map = RobotMap("none")
    robot_map.decide(grid, Pose(1.0, 1.0))
    grown = opening()
    grown.cells[15:25, 39:45] = 0
    with pytest.raises(StartError):
        robot_map.decide(grown, Pose(5.8, 2.0))
    # What has changed in the meantime is not lost.
    found = robot_map.decide(grown, Pose(1.0, 1.0))
    assert numbers(found) == numbers(RobotMap("none").decide(grown, Pose(1.0, 1.0)))


def test_ways_that_agents_plan_are_followed_as_in_a_simulation() -> None:
    robot_map, here = RobotMap("none"), Pose(1.0, 1.0)
    decision = robot_map.decide(opening(), here)
    robot_map.way(decision, 0)
    path = decision.field.path_to(decision.frontiers[0].viewpoint)[:4]
    assert len(robot_map.way(decision, Walk(path, decision.frontiers[0].cells))) == 4
    for of_a_policy in (np.array(0), np.array([0])):
        assert len(robot_map.way(decision, of_a_policy)) > 4
    assert len(robot_map.way(decision, path)) == 4
    later = robot_map.decide(opening(), here)
    assert later.goal is None  # it was sent along a path, and to no frontier
    for wrong in (path[1:], path[::2], path.astype(float), path[:0]):
        with pytest.raises(ConfigError, match="path"):
            robot_map.way(later, wrong)
    with pytest.raises(ConfigError, match="no longer the last"):
        robot_map.way(decision, path)
    assert later.goal is None


def test_the_frame_stays_while_the_map_grows_by_whole_cells() -> None:
    """Else all would be found anew whenever SLAM widens its map, and agents would forget what they know."""
    simulation = run()
    simulation.reset(seed=3)
    grid, robot_map = copied(simulation.mapper.grid), RobotMap("layout")
    rows, cols = (np.flatnonzero((grid.cells >= 0).any(axis=k)) for k in (1, 0))
    places = set()
    for k in range(6):
        row, col = max(rows[0] - 3 * k, 0), max(cols[0] - 2 * k, 0)
        part = grid.cells[row : rows[-1] + k, col : cols[-1] + k].copy()
        # ROS's messages have the resolution rounded to 32 bits, but not the origin.
        corner = grid.cell_to_world(row - 0.5, col - 0.5)
        seen = OccupancyGrid(part, float(np.float32(grid.resolution)), Pose(*corner))
        decision = robot_map.decide(seen, simulation.pose)
        assert numbers(decision) == numbers(RobotMap("layout").decide(seen, simulation.pose))
        places.add((decision.grid.shape, decision.grid.origin))
    assert len(places) == 2  # one more after the first, with more of a margin


def test_a_map_that_has_not_changed_is_not_looked_at_again() -> None:
    grid, robot_map = opening(), RobotMap("layout")
    first = robot_map.decide(grid, Pose(1.0, 1.0))
    second = robot_map.decide(copied(grid), Pose(1.5, 1.0))
    assert second.grid is first.grid
    assert numbers(second) == numbers(RobotMap("layout").decide(grid, Pose(1.5, 1.0)))


def test_it_can_be_pickled_while_a_plan_known_beforehand_is_looked_for() -> None:
    floor = office()
    robot_map, here = RobotMap(PriorPredictor(study_prior("true", floor, 0).prior)), Pose(2.0, 6.0)
    for share in (0.3, 0.5, 0.5):
        robot_map.decide(seen_part(floor, share), here)
        later = pickle.loads(pickle.dumps(robot_map))
    found = [known.decide(seen_part(floor, 0.6), here) for known in (robot_map, later)]
    assert numbers(found[0]) == numbers(found[1]) and found[0].foresight is not None


def test_probabilities_count_as_ros_counts_them() -> None:
    grid = opening()
    cells = np.select([grid.cells == 0, grid.cells == 100], [10, 80], -1).astype(np.int8)
    here = Pose(1.0, 1.0)
    told = RobotMap("none").decide(OccupancyGrid(cells, 0.1), here)
    assert numbers(told) == numbers(RobotMap("none").decide(grid, here))


def test_what_cannot_be_is_refused() -> None:
    robot_map, grid = RobotMap("none"), opening()
    with pytest.raises(StartError, match=r"not on its map: \(100, 1\)"):
        robot_map.decide(grid, Pose(100.0, 1.0))
    with pytest.raises(ConfigError, match="pose"):
        robot_map.decide(grid, Pose(math.nan, 1.0))
    with pytest.raises(MapError, match="no cell"):
        robot_map.decide(OccupancyGrid(np.full((5, 5), -1, np.int8), 0.1), Pose(0.2, 0.2))
    costs = grid.cells.copy()
    costs[20, 20] = -2  # 254 of a costmap, as int8
    with pytest.raises(MapError, match=r"cell \(20, 20\) holds -2"):
        robot_map.decide(OccupancyGrid(costs, 0.1), Pose(1.0, 1.0))
    with pytest.raises(UnknownNameError):
        RobotMap("layuot")
    with pytest.raises(UnknownNameError):
        RobotMap(sensor="stag")
    with pytest.raises(ConfigError, match="robot_radius"):
        RobotMap(robot_radius=0.0)
    assert robot_map.decide(grid, Pose(1.0, 1.0)).frontiers  # as if nothing had been asked


@pytest.mark.parametrize("resolution", [0.03, 0.25, 1.0, 3.0])
def test_cells_may_be_small_or_large(resolution: float) -> None:
    grid = OccupancyGrid(opening().cells, resolution)
    here = Pose(*grid.cell_to_world(12, 12))
    decision = RobotMap("layout", robot_radius=1e-3).decide(grid, here)
    assert len(decision.frontiers) == 1 and decision.rooms is not None
    assert decision.rooms.labels.max() > 0
