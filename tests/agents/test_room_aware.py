"""Agents that read predicted rooms, and when they stop."""

from __future__ import annotations

import dataclasses

import pytest

from layoutexplore.agents import make_agent
from layoutexplore.frontiers.decision import STOP
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.predictors import make_predictor
from layoutexplore.simulation.simulation import Simulation, SimulationConfig
from tests.plans import THREE_OFFICES


@pytest.mark.parametrize(
    "name", ["layout-nearest", "layout-tour", "layout-gain", "closed-first", "open-first"]
)
def test_layout_strategies_finish_with_predicted_rooms(name: str) -> None:
    plan = floorplan_from_ascii(THREE_OFFICES, resolution=0.9)
    agent = make_agent(name)
    agent.reset(0)
    simulation = Simulation(plan, SimulationConfig(sensor="indoor"), make_predictor("layout"))
    decision = simulation.reset(seed=1)
    while not simulation.done:
        decision = simulation.step(agent.act(decision))
    assert simulation.stop_reason == "coverage"


def test_an_early_stop_saves_metres() -> None:
    plan = floorplan_from_ascii(THREE_OFFICES, resolution=0.9)
    runs = []
    for spec in ("layout-tour", "layout-tour:stop_area=4"):
        agent = make_agent(f"{spec}{',' if ':' in spec else ':'}predictor=oracle")
        simulation = Simulation(
            plan, SimulationConfig(sensor="indoor", coverage_goal=1.0), make_predictor("oracle")
        )
        decision = simulation.reset(seed=1)
        while not simulation.done:
            decision = simulation.step(agent.act(decision))
        runs.append((simulation.distance, simulation.coverage, simulation.stop_reason))
    assert runs[1][0] < runs[0][0] and runs[1][1] > 0.8 and runs[1][2] == "agent"


@pytest.mark.parametrize(
    ("confidence", "asked", "stops"),
    [(0.95, ",stop_sure=0.9", True), (0.8, ",stop_sure=0.9", False), (0.75, "", True), (0.65, "", False)],
)
def test_who_doubts_that_all_is_closed_does_not_stop(confidence: float, asked: str, stops: bool) -> None:
    simulation = Simulation(
        floorplan_from_ascii(THREE_OFFICES, resolution=0.9),
        SimulationConfig(sensor="indoor"),
        make_predictor("none"),
    )
    decision = simulation.reset(seed=1)
    judged = tuple(
        dataclasses.replace(f, is_closed=True, expected_area=0.5, confidence=confidence)
        for f in decision.frontiers
    )
    judged_so, known = dataclasses.replace(decision, frontiers=judged), decision.grid.free_area
    agent = make_agent(f"layout-nearest:stop_area=1,stop_known={known}{asked}")
    assert (agent.act(judged_so) == STOP) == stops
    for doubt in ("stop_sure=0.99", f"stop_known={known + 0.01}"):
        assert judged and make_agent(f"layout-nearest:stop_area=1,{doubt}").act(judged_so) != STOP


def test_nobody_stops_in_the_first_room_unless_nothing_is_left() -> None:
    simulation = Simulation(
        floorplan_from_ascii(THREE_OFFICES, resolution=0.5),
        SimulationConfig(sensor="indoor"),
        make_predictor("none"),
    )
    decision = simulation.reset(seed=1)
    done = tuple(
        dataclasses.replace(f, is_closed=True, expected_area=0.0, confidence=1.0) for f in decision.frontiers
    )
    agent = make_agent("layout-tour:stop_area=4")
    assert 0 < decision.grid.free_area < 60
    assert done and agent.act(dataclasses.replace(decision, frontiers=done)) != STOP
    assert agent.act(dataclasses.replace(decision, frontiers=())) == STOP
