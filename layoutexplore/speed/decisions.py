"""Seconds a decision as a map grows: offices of growing area, explored to the end, by quarter of a run.

The dearest of these runs is made once more in a process of its own, which does nothing else: what its middle
decision takes, and the most memory that the process holds, imports included.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from layoutexplore.agents.base import make_agent
from layoutexplore.agents.room_aware import RoomAwareHeuristic
from layoutexplore.grids.arrays import Floats
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.predictors import make_predictor
from layoutexplore.processes import peak_memory
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.simulation import Simulation
from layoutexplore.speed.floors import plan_of
from layoutexplore.speed.measurement import SpeedRow

AREAS = (500.0, 1000.0, 2000.0, 4000.0, 8000.0)
"""Square metres of floor."""

_WARMING_AREAS = (500.0, 2000.0)
"""Explored before anything is timed, so that all kernels are compiled: large maps have paths of their own."""

AGENTS = ("nearest", "latency-tour", "layout-tour")

RESOLUTION = 0.05
"""Metres a cell."""

_MOST_GROWTH = 2.0
"""The last quarter of a run is to take at most so many times as long as the first."""

ALONE = ("layout-tour", 8000.0)
"""The agent and the floor area in square metres that a process of its own is measured with."""

_MOST_MILLISECONDS, _MOST_MEGABYTES = 50.0, 400.0
"""Of the middle decision there, and of the whole process at its peak."""

_SCRIPT = "import sys; from layoutexplore.speed import decisions; decisions.tell_cost(*sys.argv[1:])"


class RunCost(NamedTuple):
    """What an exploration takes.

    Attributes:
        decision: Milliseconds of the processor that half of all decisions take at most.
        memory: The most megabytes (10^6 bytes) that the process has held.
    """

    decision: float
    memory: float


@dataclass(frozen=True, kw_only=True)
class GrowthRow(SpeedRow):
    """Milliseconds a decision in the last quarter of a run, beside those in the first.

    Attributes:
        agent: Whose decisions.
        area: Floor area in square metres.
        quarters: Mean milliseconds a decision in each quarter of the run, by number of decisions.
    """

    agent: str
    area: float
    quarters: tuple[float, ...]


def decisions() -> Iterator[SpeedRow]:
    """Choice, path, scans, map, frontiers, distances and prediction, by agent and floor area."""
    for agent in AGENTS:
        for area in _WARMING_AREAS:
            decision_times(plan_of(area), agent, RESOLUTION)
        for area in AREAS:
            times = 1e3 * decision_times(plan_of(area), agent, RESOLUTION)
            quarters = tuple(float(part.mean()) for part in np.array_split(times, 4))
            yield GrowthRow(
                name=f"decision, {agent}, {area:.0f} m2",
                ours=quarters[-1],
                unit="ms",
                reference=quarters[0],
                reference_name="in the first quarter",
                goal=f"<= {_MOST_GROWTH:g}x the first quarter",
                reached=_MOST_GROWTH * quarters[0] / quarters[-1],
                agent=agent,
                area=area,
                quarters=quarters,
                note=f"median {np.median(times):.1f} ms",
            )
            if (agent, area) == ALONE:
                yield from _cost_rows(agent, area)


def _cost_rows(agent: str, area: float) -> Iterator[SpeedRow]:
    """Median decision and most memory of a run in a process of its own, which loads kernels as it goes."""
    cost = cost_alone(agent, area)
    for name, ours, unit, most in (
        ("median decision", cost.decision, "ms", _MOST_MILLISECONDS),
        ("peak memory", cost.memory, "MB", _MOST_MEGABYTES),
    ):
        yield SpeedRow(
            name=f"{name}, {agent}, {area:.0f} m2",
            ours=ours,
            unit=unit,
            goal=f"<= {most:g} {unit}",
            reached=most / ours,
            note="in a process of its own",
        )


def cost_alone(agent: str, area: float) -> RunCost:
    """What an exploration takes in a fresh process that does nothing else, its imports included.

    Args:
        agent: Its name.
        area: Of the office, in square metres.
    """
    command = [sys.executable, "-c", _SCRIPT, agent, repr(area)]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    return RunCost(*json.loads(done.stdout))


def tell_cost(agent: str, area: str) -> None:
    """Explore on one thread, and print what it took as JSON: a `RunCost`."""
    cv2.setNumThreads(1)
    times = decision_times(plan_of(float(area)), agent, RESOLUTION)
    print(json.dumps(RunCost(1e3 * float(np.median(times)), peak_memory() / 1e6)))


def decision_times(plan: FloorPlan, name: str, resolution: float) -> Floats:
    """Processor seconds float64 (n,) of each decision of a run, from one choice to the next.

    Args:
        plan: What is explored, from the start of seed 0.
        name: Of the agent.
        resolution: Metres a cell.
    """
    agent = make_agent(name)
    predictor = make_predictor(agent.predictor) if isinstance(agent, RoomAwareHeuristic) else None
    simulation = Simulation(plan, SimulationConfig(resolution=resolution), predictor)
    agent.reset(0)
    decision, times = simulation.reset(0), []
    while not simulation.done:
        begun = time.process_time()
        decision = simulation.step(agent.act(decision))
        times.append(time.process_time() - begun)
    return np.array(times)
