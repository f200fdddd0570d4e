"""The goal of a decision."""

from __future__ import annotations

from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.simulation import Simulation
from tests.plans import TWO_ROOMS


def test_the_goal_is_what_the_robot_was_last_sent_to() -> None:
    plan = floorplan_from_ascii(TWO_ROOMS, resolution=1.0)
    simulation = Simulation(plan, SimulationConfig(sensor="indoor"))
    decision = simulation.reset(seed=0)
    assert decision.goal is None
    while not simulation.done:
        sent_to = decision.frontiers[0].centroid
        decision = simulation.step(0)
        assert decision.goal == sent_to
    assert simulation.reset(seed=0).goal is None
