"""Speed of the simulation and the environments in an office of 2600 m2 at 0.1 m; memory and import time."""

from __future__ import annotations

import subprocess
import sys
import time
import tracemalloc
from collections.abc import Iterator
from statistics import median
from typing import Any

import gymnasium
import numpy as np

from layoutexplore.envs.observation import ObservationConfig
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.simulation import Simulation
from layoutexplore.speed.floors import plan
from layoutexplore.speed.measurement import SpeedRow, milliseconds

_BASE = "import time; s = time.process_time(); {}; print(time.process_time() - s)"


def frontier_steps() -> Iterator[SpeedRow]:
    """Decisions of the strategy "nearest" without layout.

    Walk, scans, map, frontiers, distances and gains.
    """
    for sensor in ("stage", "indoor"):
        simulation = Simulation(plan(), SimulationConfig(sensor=sensor))
        rates = []
        for seed in range(3):
            simulation.reset(seed=seed)
            start = time.process_time()
            while not simulation.done:
                simulation.step(0)
            rates.append(simulation.decisions / (time.process_time() - start))
        yield SpeedRow(
            name=f"frontier steps, {sensor}",
            ours=median(rates),
            unit="steps/s",
            goal=">= 100 steps/s",
            reached=median(rates) / 100.0,
        )


def map_steps() -> Iterator[SpeedRow]:
    """Steps of Frontier-v0 with the default observation and predicted rooms, beside completed rooms."""
    rates = {}
    for name, predictor, rooms, steps in (
        ("sketched", "layout", "sketched", 150),
        ("completed", "layout", "completed", 15),
        ("none", None, "sketched", 150),
    ):
        environment = gymnasium.make(
            "LayoutExplore/Frontier-v0",
            plan=plan(),
            predictor=predictor,
            observation=ObservationConfig(rooms=rooms),
        )
        rates[name] = _nearest_rate(environment, steps)
        environment.close()
    yield SpeedRow(
        name="Frontier-v0 steps, maps, layout",
        ours=rates["sketched"],
        unit="steps/s",
        reference=rates["completed"],
        reference_name="completed rooms",
        goal=">= 60 steps/s",
        reached=rates["sketched"] / 60.0,
        note=f"{rates['none']:.0f} steps/s without a predictor",
    )


def _nearest_rate(environment: gymnasium.Env[Any, Any], steps: int) -> float:
    """Steps a CPU second to the nearest frontier, after a few to warm up; episodes follow each other."""
    environment.reset(seed=0)
    for k in range(3 + steps):
        if k == 3:
            start = time.process_time()
        _, _, terminated, truncated, _ = environment.step(0)
        if terminated or truncated:
            environment.reset()
    return steps / (time.process_time() - start)


def motion_steps() -> Iterator[SpeedRow]:
    """Random moves with the observation of each."""
    environment = gymnasium.make("LayoutExplore/Motion-v0", plan=plan())
    environment.reset(seed=0)
    actions = np.random.default_rng(0).integers(0, 3, 1000)

    def drive() -> None:
        for action in actions:
            _, _, terminated, truncated, _ = environment.step(int(action))
            if terminated or truncated:
                environment.reset(seed=0)

    (taken,) = milliseconds(drive, repeats=5)
    rate = len(actions) / taken * 1e3
    environment.close()
    yield SpeedRow(
        name="Motion-v0 steps", ours=rate, unit="steps/s", goal=">= 4 000 steps/s", reached=rate / 4000.0
    )


def resets() -> Iterator[SpeedRow]:
    """Reset to another start on a plan that is already loaded."""
    simulation = Simulation(plan())
    seeds = iter(range(10_000))
    (taken,) = milliseconds(lambda: simulation.reset(seed=next(seeds)), repeats=15)
    yield SpeedRow(name="reset, plan cached", ours=taken, unit="ms", goal="<= 20 ms", reached=20.0 / taken)


def memory() -> Iterator[SpeedRow]:
    """What one more environment on the same plan holds, as numpy and Python count it."""
    first = gymnasium.make("LayoutExplore/Frontier-v0", plan=plan())
    first.reset(seed=0)
    tracemalloc.start()
    further = []
    for seed in range(3):
        environment = gymnasium.make("LayoutExplore/Frontier-v0", plan=plan())
        environment.reset(seed=seed)
        environment.step(0)
        further.append(environment)
    held = tracemalloc.get_traced_memory()[0] / len(further) / 1e6
    tracemalloc.stop()
    rows, cols = plan().rasterize(0.1).shape
    yield SpeedRow(
        name=f"memory per env, {rows} x {cols}", ours=held, unit="MB", goal="< 5 MB", reached=5.0 / held
    )


def import_time() -> Iterator[SpeedRow]:
    """`import layoutexplore` in a fresh interpreter."""

    def child(statement: str) -> float:
        done = subprocess.run(
            [sys.executable, "-c", _BASE.format(statement)], capture_output=True, text=True, check=True
        )
        return float(done.stdout)

    child("import layoutexplore")
    taken = median(child("import layoutexplore") for _ in range(5))
    yield SpeedRow(name="import layoutexplore", ours=taken, unit="s", goal="< 0.5 s", reached=0.5 / taken)
