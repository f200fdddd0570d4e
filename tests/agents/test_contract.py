"""What every agent has in common."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
import time

import numpy as np
import pytest
from numpy.typing import NDArray

from layoutexplore.agents import agent_names, describe_agents, make_agent
from layoutexplore.benchmark.rows import prepare
from layoutexplore.errors import LayoutExploreError
from layoutexplore.frontiers.decision import STOP, Agent, Privileged
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.episode import play
from layoutexplore.simulation.simulation import Simulation
from tests.agents.cases import CORRIDOR, decide, run
from tests.plans import offices

NEEDS_A_FILE = {"policy"}


AGENTS = [agent.name for agent in describe_agents() if agent.name not in NEEDS_A_FILE]


@functools.cache
def explored(agent: str) -> Simulation:
    """A run that has ended."""
    simulation, chosen = prepare(offices(), SimulationConfig(sensor="stage"), agent)
    play(simulation, chosen, seed=1)
    return simulation


def walls_crossed(track: NDArray[np.float64], raster: PlanRaster) -> int:
    """How many points of a track, a fifth of a cell apart, lie in cells that the lidar sees as walls."""
    count = 0
    for (x0, y0), (x1, y1) in itertools.pairwise(track[:, :2].tolist()):
        for t in np.linspace(0, 1, 2 + math.ceil(5 * math.hypot(x1 - x0, y1 - y0) / raster.resolution)):
            count += bool(raster.occupied[raster.world_to_cell(x0 + t * (x1 - x0), y0 + t * (y1 - y0))])
    return count


def longest_step(track: NDArray[np.float64]) -> float:
    """Metres between consecutive poses, the most."""
    return float(np.hypot(*np.diff(track[:, :2], axis=0).T).max(initial=0.0))


def test_ghosts_and_teleports_are_found() -> None:
    simulation = explored("nearest")
    through = np.array([simulation.track[0], simulation.track[-1], simulation.track[0]])
    assert walls_crossed(through, simulation.raster) > 0 and longest_step(through) > 1.0


@pytest.mark.parametrize("agent", AGENTS)
def test_no_agent_passes_walls_or_jumps(agent: str) -> None:
    simulation = explored(agent)
    resolution = simulation.raster.resolution
    assert walls_crossed(simulation.track, simulation.raster) == 0
    # Where a wall has stopped it, the robot stands off the middle of its cell by half a cell at most.
    assert longest_step(simulation.track) <= 1.5 * math.sqrt(2) * resolution + 1e-6
    walked = np.hypot(*np.diff(simulation.track[:, :2], axis=0).T).sum()
    assert simulation.distance == pytest.approx(walked) and simulation.curve[-1, 0] == simulation.distance


@pytest.mark.parametrize("agent", AGENTS)
def test_time_decides_nothing(agent: str, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = explored(agent).track
    ticks = itertools.count()
    for name in ("perf_counter", "monotonic", "time", "process_time"):
        # Every look at the clock is eleven days later.
        monkeypatch.setattr(time, name, lambda: 1e6 * next(ticks))
    simulation, chosen = prepare(offices(), SimulationConfig(sensor="stage"), agent)
    episode = play(simulation, chosen, seed=1)
    assert episode.seconds >= 1e6, "the clock that was looked at is not the one that was changed"
    assert np.array_equal(simulation.track, expected)


REQUIRED = [
    "random",
    "nearest",
    "nearest-0.4",
    "nearest-straight",
    "cost-utility-0.5",
    "cost-utility-0.9",
    "gain-over-distance",
    "gain-exp",
    "wait-3",
    "wait-8",
    "tour",
    "tour-0.4",
    "distance-advantage",
    "clairvoyant",
]


def test_every_arm_of_the_benchmark_is_there() -> None:
    assert set(REQUIRED) <= set(agent_names())
    described = {row.name: row for row in describe_agents()}
    assert set(described) == set(agent_names()) and all(row.summary for row in described.values())
    assert described["nearest-0.4"].parameters[0][:2] == ("min_size", "0.4")


@pytest.mark.parametrize("name", agent_names())
def test_agents_keep_the_protocol(name: str) -> None:
    agent = make_agent(name)
    assert isinstance(agent, Agent) and agent.name == name and name in repr(agent)
    if not isinstance(agent, Privileged):
        assert agent.act(dataclasses.replace(decide(CORRIDOR), frontiers=())) == STOP


@pytest.mark.parametrize("name", REQUIRED)
def test_agents_explore_and_repeat_themselves(name: str) -> None:
    spec = "clairvoyant:rounds=2" if name == "clairvoyant" else name
    one, same = run(spec), run(spec)
    assert one.stop_reason == "coverage"
    assert np.array_equal(one.track, same.track)


@pytest.mark.parametrize("name", AGENTS)
def test_agents_choose_the_same_again_and_leave_the_decision_alone(name: str) -> None:
    choices = []
    for _ in range(2):
        simulation, agent = prepare(offices(), SimulationConfig(sensor="stage"), name)
        decision = simulation.reset(seed=3)
        agent.reset(3)
        if isinstance(agent, Privileged):
            agent.reveal(simulation.truth)
        cells, table = decision.grid.cells.copy(), np.array(decision.table)
        choices.append(agent.act(decision))
        assert np.array_equal(decision.grid.cells, cells)
        assert np.array_equal(np.array(decision.table), table, equal_nan=True)
    assert np.array_equal(*choices)


@pytest.mark.parametrize("name", agent_names())
def test_parameters_that_an_agent_does_not_have_are_named(name: str) -> None:
    with pytest.raises(LayoutExploreError, match="nonsense"):
        make_agent(f"{name}:nonsense=1")
