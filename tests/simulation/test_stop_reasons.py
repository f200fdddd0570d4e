"""Why runs end."""

from __future__ import annotations

import numpy as np

from layoutexplore.envs.base import STOP_REASONS
from layoutexplore.frontiers.decision import STOP
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
