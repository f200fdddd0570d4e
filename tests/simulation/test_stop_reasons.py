"""Why runs end."""

from __future__ import annotations

import math

import numpy as np
import pytest

from layoutexplore.agents import make_agent
from layoutexplore.envs.base import STOP_REASONS
from layoutexplore.frontiers.decision import STOP
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.sensing.lidar import LidarConfig
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.simulation import Simulation
from layoutexplore.simulation.stop_reasons import StopReason
from tests.plans import offices


def test_every_reason_has_a_sentence_and_a_number_in_the_environments() -> None:
    assert len({reason.sentence for reason in StopReason}) == len(StopReason)
    assert {reason.value for reason in StopReason} <= set(STOP_REASONS)


def test_runs_end_for_the_reason_that_they_say() -> None:
    for options, expected in (
        ({"max_distance": 2.0}, StopReason.BUDGET),
        ({"coverage_goal": 0.5}, StopReason.COVERAGE),
        ({}, StopReason.AGENT),
    ):
        simulation = Simulation(offices(), SimulationConfig(sensor="short", **options))
        simulation.reset(seed=0)
        assert simulation.stop_reason is StopReason.GOES_ON
        while not simulation.done:
            simulation.step(STOP if expected == StopReason.AGENT else 0)
        assert simulation.stop_reason is expected and f"{simulation.stop_reason}" == expected.value


def test_a_run_ends_where_looking_at_all_that_is_left_was_in_vain() -> None:
    simulation = Simulation(offices(), SimulationConfig(sensor="short"))
    simulation.reset(seed=0)
    simulation.state.selector.blacklist(
        np.argwhere(np.ones(simulation.raster.shape, np.bool_)).astype(np.int32)
    )
    simulation.step(0)
    assert simulation.done and simulation.stop_reason is StopReason.NO_FRONTIER


def test_distances_of_the_last_decision_of_a_noisy_run_can_be_asked_for() -> None:
    rows = ["#" + "." * 9 + ("." if 3 <= row <= 7 else "#") + "." * 9 + "#" for row in range(10)]
    plan = floorplan_from_ascii("\n".join(["#" * 21, *rows, "#" * 21]), resolution=0.1)
    sensor = LidarConfig(range_max=8.0, fov=2 * math.pi, beams=90, range_noise_std=0.06)
    config = SimulationConfig(sensor=sensor, robot_radius=0.24, coverage_goal=1.0)
    simulation, agent = Simulation(plan, config), make_agent("nearest")
    for seed in range(10):
        decision = simulation.reset(seed=seed)
        agent.reset(seed)
        while not simulation.done:
            decision = simulation.step(agent.act(decision))
        assert decision is simulation.decision and np.isfinite(decision.distances).any()
        if simulation.stop_reason == StopReason.NO_FRONTIER:
            return
    pytest.fail("no run has ended for want of frontiers")
