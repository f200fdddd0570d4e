"""Robots that return to where they began."""

from __future__ import annotations

import math

import numpy as np
import pytest

from layoutexplore.errors import ConfigError
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.robot import OdometryNoise
from layoutexplore.simulation.simulation import Simulation
from layoutexplore.simulation.way_back import return_to_start
from tests.plans import offices


def explored(**options: object) -> Simulation:
    simulation = Simulation(offices(), SimulationConfig(sensor="indoor", **options))  # type: ignore[arg-type]
    simulation.reset(seed=2)
    while not simulation.done:
        simulation.step(0)
    return simulation


@pytest.mark.parametrize("turn_cost", [0.0, 0.5])
def test_the_way_back_is_counted_apart(turn_cost: float) -> None:
    simulation = explored(turn_cost=turn_cost)
    distance, curve, cells = simulation.distance, simulation.curve, simulation.mapper.grid.cells.copy()
    length, reason = len(simulation.track), simulation.stop_reason
    before = simulation.robot.walked
    metres, arrived = return_to_start(simulation)
    assert arrived and math.dist(simulation.pose[:2], simulation.track[0, :2]) < 0.5
    assert simulation.distance == distance and simulation.stop_reason == reason
    np.testing.assert_array_equal(simulation.curve, curve)
    np.testing.assert_array_equal(simulation.mapper.grid.cells, cells)
    steps = np.hypot(*np.diff(simulation.track[length - 1 :, :2], axis=0).T).sum()
    assert steps == pytest.approx(simulation.robot.walked - before)
    assert metres >= steps - 1e-9 and (metres > steps + 0.1) == (turn_cost > 0)
    again = return_to_start(simulation)
    assert again.arrived and again.metres < 0.5 and simulation.distance == distance


def test_a_robot_that_drifts_tries_and_says_whether_it_arrived() -> None:
    noise = OdometryNoise(translation=0.01, rotation=0.005)
    simulation = explored(odometry_noise=noise, max_distance=40.0)
    way = return_to_start(simulation)
    believed = simulation.robot.believed_track
    near = math.dist(believed[-1, :2], believed[0, :2]) <= 0.5
    assert way.arrived == near and way.metres > 0.0


def test_a_robot_returns_when_it_is_done() -> None:
    simulation = Simulation(offices())
    simulation.reset(seed=0)
    with pytest.raises(ConfigError, match="not over"):
        return_to_start(simulation)
