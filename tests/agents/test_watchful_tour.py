"""The tour that is planned anew after every step: what it walks, when it changes its mind, what it weighs."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import pytest
import shapely

from layoutexplore.agents import make_agent
from layoutexplore.agents.watchful_tour import promised_areas
from layoutexplore.frontiers.decision import Decision
from layoutexplore.grids.grid import UNKNOWN, OccupancyGrid
from layoutexplore.maps.floorplan import FloorPlan, Room
from layoutexplore.planning.first_steps import first_steps
from layoutexplore.predictors import make_predictor
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.simulation import Simulation
from tests.agents.cases import CORRIDOR, decide, run

NEAR_RIGHT = "####################\n#...........R......#\n####################"
"""The corridor of `CORRIDOR` with the robot further to the right."""


def judged(
    decision: Decision, closed: Sequence[bool], area: Sequence[float], confidence: float = 0.9
) -> Decision:
    """The decision with classes and areas of its frontiers, nearest first."""
    frontiers = [
        dataclasses.replace(frontier, is_closed=ends, expected_area=left, confidence=confidence)
        for frontier, ends, left in zip(decision.frontiers, closed, area, strict=True)
    ]
    return dataclasses.replace(decision, frontiers=tuple(frontiers))


def with_unknown(decision: Decision, count: int) -> Decision:
    """The decision with so many unknown cells in the wall."""
    cells = decision.grid.cells.copy()
    cells[0, :count] = UNKNOWN
    return dataclasses.replace(decision, grid=OccupancyGrid(cells, decision.grid.resolution))


def test_a_closed_frontier_is_worth_what_is_left_behind_it() -> None:
    decision = decide(CORRIDOR, (1, 4, 2.0, 9.0), (1, 9, 2.0, 9.0), (1, 17, 2.0, 50.0))
    decision = judged(decision, closed=[True, False, False], area=[2.0, 2.0, 60.0])
    assert [f.viewpoint.col for f in decision.frontiers] == [9, 4, 17]
    assert promised_areas(decision, np.arange(3)).tolist() == [2.0, 9.0, 30.0]
    assert promised_areas(decision, np.array([2, 0])).tolist() == [30.0, 2.0]


def test_a_closed_frontier_that_may_be_open_does_not_wait() -> None:
    decision = decide(CORRIDOR, (1, 9, 2.0, 50.0), (1, 2, 2.0, 9.0))
    decision = judged(decision, closed=[True, False], area=[0.5, 9.0])
    assert [f.viewpoint.col for f in decision.frontiers] == [9, 2]
    for option, goes in ((":doubted=3.5", 1), ("", 0)):
        agent = make_agent(f"watchful-tour{option}")
        agent.reset(0)
        assert agent.plan(decision) == goes


@pytest.mark.parametrize(("in_view", "first"), [(1.0, 6), (29.0, 17)])
def test_where_all_frontiers_wait_the_one_with_much_in_view_comes_first(in_view: float, first: int) -> None:
    """Its class may be wrong; six small remainders nearby do not come before it."""
    small = [(1, col, 2.0, 1.0) for col in range(1, 7)]
    decision = decide(CORRIDOR, *small, (1, 17, 2.0, in_view))
    decision = judged(decision, closed=[True] * 7, area=[0.1] * 6 + [0.9], confidence=0.98)
    agent = make_agent("watchful-tour")
    agent.reset(0)
    assert decision.viewpoints[agent.plan(decision), 1] == first


def test_it_goes_a_step_at_a_time() -> None:
    decision = judged(decide(CORRIDOR, (1, 17, 2.0, 9.0)), closed=[False], area=[9.0])
    agent = make_agent("watchful-tour:step=2")
    agent.reset(0)
    steps = agent.act(decision)
    assert isinstance(steps, np.ndarray)
    assert steps.tolist() == [[1, 7], [1, 8], [1, 9]]
    # Eleven metres are left: what is as near as that is gone to as a frontier, which ends when it is gone.
    agent = make_agent("watchful-tour:step=10")
    agent.reset(0)
    assert agent.act(decision) == 0


def test_where_turning_costs_it_decides_where_it_arrives() -> None:
    decision = judged(decide(CORRIDOR, (1, 17, 2.0, 9.0)), closed=[False], area=[9.0])
    agent = make_agent("watchful-tour:step=2")
    agent.reset(0)
    assert agent.act(dataclasses.replace(decision, turn_cost=0.1)) == 0


def test_a_path_of_no_length_has_no_first_steps() -> None:
    assert first_steps(np.array([[3, 4]], np.int32), 0.1, 0.5) is None


def test_the_goal_is_held_until_something_new_is_seen() -> None:
    """From the middle the tour begins on the left, from further right on the right."""
    frontiers = (1, 2, 2.0, 9.0), (1, 17, 2.0, 9.0)
    first = judged(decide(CORRIDOR, *frontiers), closed=[False] * 2, area=[9.0] * 2)
    later = judged(decide(NEAR_RIGHT, *frontiers), closed=[False] * 2, area=[9.0] * 2)
    agent = make_agent("watchful-tour")

    def columns(decision: Decision) -> list[int]:
        steps = agent.act(decision)
        assert isinstance(steps, np.ndarray)
        return steps[:, 1].tolist()

    agent.reset(0)
    assert columns(later) == [12, 13]
    agent.reset(0)
    assert columns(with_unknown(first, 1)) == [7, 6]
    assert columns(with_unknown(later, 1)) == [12, 11], "nothing new: on to the goal"
    assert columns(later) == [12, 13], "a cell more is known: the tour is planned anew"
    agent.reset(0)
    assert columns(later) == [12, 13], "a new run begins with no goal"


@pytest.mark.parametrize("sensor", ["stage", "indoor"])
def test_it_finishes_and_goes_no_long_way_round(sensor: str) -> None:
    watchful, plain = (run(f"{name}-tour", sensor, 3, predictor="layout") for name in ("watchful", "layout"))
    assert watchful.stop_reason == "coverage"
    assert watchful.distance < 1.2 * plain.distance


def test_it_crosses_a_hall_wider_than_its_lidar_reaches() -> None:
    """The frontier runs around the robot: what it is shown of it lies on one side, and then on the other."""
    hall = FloorPlan(name="hall", rooms=(Room(id=1, polygon=shapely.box(0.0, 0.0, 36.0, 30.0)),))
    simulation = Simulation(hall, SimulationConfig(sensor="indoor", resolution=0.4), make_predictor("none"))
    decision, agent = simulation.reset(seed=0), make_agent("watchful-tour:predictor=none")
    agent.reset(0)
    while not simulation.done:
        decision = simulation.step(agent.act(decision))
    assert simulation.stop_reason == "coverage" and simulation.distance < 120.0


def test_noise_does_not_hold_it_up() -> None:
    assert run("watchful-tour", seed=3, predictor="layout", noise="middle").coverage > 0.97
