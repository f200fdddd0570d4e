"""Fixtures that the tests of predictors share."""

from __future__ import annotations

import pytest

from layoutexplore.frontiers.decision import Decision
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.simulation.simulation import Simulation, SimulationConfig
from tests.plans import THREE_OFFICES


@pytest.fixture(scope="module")
def simulation() -> Simulation:
    return Simulation(floorplan_from_ascii(THREE_OFFICES, resolution=0.9), SimulationConfig(sensor="short"))


@pytest.fixture(scope="module")
def decision(simulation: Simulation) -> Decision:
    return simulation.reset(seed=2)
