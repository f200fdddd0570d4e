"""Every seed decides what it is said to decide, and nothing else does."""

from __future__ import annotations

import math
import random
from collections.abc import Callable

import gymnasium
import numpy as np
import pytest

from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.rows import prepare
from layoutexplore.maps.generator import generate
from layoutexplore.sensing.lidar import LidarConfig
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.episode import play, run_seed, start_pose
from layoutexplore.simulation.robot import OdometryNoise
from layoutexplore.simulation.simulation import Simulation
from tests.plans import offices


def noisy(seed: int, **options: object) -> Simulation:
    config = SimulationConfig(max_distance=15.0, **options)  # type: ignore[arg-type]
    simulation = Simulation(offices(), config)
    start = start_pose(offices(), config, 0, 0)
    decision = simulation.reset(seed=seed, start=start)
    while not simulation.done:
        decision = simulation.step(len(decision.frontiers) // 2)
    return simulation


def env_start(seed: int) -> bytes:
    env = gymnasium.make("LayoutExplore/Frontier-v0", plan=offices())
    observation, _ = env.reset(seed=seed)
    return b"".join(np.asarray(observation[key]).tobytes() for key in sorted(observation))


LIDAR = LidarConfig(range_max=8.0, fov=math.pi, beams=181, range_noise_std=0.05)


SEEDED: dict[str, Callable[[int], bytes]] = {
    "start": lambda seed: np.array(Simulation(offices()).reset(seed=seed).pose).tobytes(),
    "lidar noise": lambda seed: noisy(seed, sensor=LIDAR).mapper.grid.cells.tobytes(),
    "drift": lambda seed: noisy(seed, odometry_noise=OdometryNoise(translation=0.05)).track.tobytes(),
    "random agent": lambda seed: play(
        *prepare(offices(), SimulationConfig(), "random"),
        seed=seed,
        start=start_pose(offices(), SimulationConfig(), 0, 0),
    ).track.tobytes(),
    "benchmark start": lambda seed: np.array(start_pose(offices(), SimulationConfig(), seed, 0)).tobytes(),
    "benchmark cells": lambda seed: str([run_seed(seed, "offices", start) for start in range(3)]).encode(),
    "configuration": lambda seed: BenchmarkConfig(seed=seed).config_hash.encode(),
    "generator": lambda seed: generate("office", seed, area=300.0).content_hash.encode(),
    "environment": env_start,
}


@pytest.mark.parametrize("what", SEEDED)
def test_every_seed_counts(what: str) -> None:
    """The same seed gives the same bytes, whatever the global generators are at; another gives others."""
    results = []
    for seed, other in ((5, 1), (5, 2), (6, 1)):
        np.random.seed(other)  # noqa: NPY002  (shows that nothing draws from the global generator)
        random.seed(other)
        results.append(SEEDED[what](seed))
    assert results[0] == results[1] != results[2]
