"""Trained networks as agents."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("safetensors")

from layoutexplore.agents import make_agent  # noqa: E402
from layoutexplore.agents.rl.agent import NetworkPolicy  # noqa: E402
from layoutexplore.benchmark.rows import prepare  # noqa: E402
from layoutexplore.errors import ConfigError, MissingExtraError  # noqa: E402
from layoutexplore.grids.grid import Pose  # noqa: E402
from layoutexplore.simulation.config import SimulationConfig  # noqa: E402
from layoutexplore.simulation.episode import play  # noqa: E402
from tests.agents.cases import CORRIDOR, decide, looking  # noqa: E402
from tests.agents.rl.cases import spec  # noqa: E402


def test_without_torch_the_line_to_install_it_is_named(monkeypatch: pytest.MonkeyPatch, saved: Path) -> None:
    monkeypatch.setitem(__import__("sys").modules, "torch", None)
    with pytest.raises(MissingExtraError, match=r"layoutexplore\[rl\]"):
        make_agent(f"policy:{saved}")


def test_its_name_and_predictor(saved: Path) -> None:
    agent = make_agent(f"policy:{saved}")
    assert isinstance(agent, NetworkPolicy)
    assert (agent.name, agent.predictor) == (f"policy:{saved}", "none")
    assert make_agent(f"policy:path={saved}").name == agent.name


@pytest.mark.parametrize("encoder", ["attention", "deep-sets", "none"])
def test_an_untrained_policy_explores_as_the_tour(encoder: str) -> None:
    from layoutexplore.agents.rl.networks.actor_critic import Actor

    config = SimulationConfig(sensor="indoor")
    simulation, tour = prepare("apartment-01", config, "latency-tour")
    expected = play(simulation, tour, seed=3)
    agent = NetworkPolicy("untrained", Actor(spec(encoder)).eval(), spec(encoder))
    np.testing.assert_array_equal(play(simulation, agent, seed=3).curve, expected.curve)
    np.testing.assert_array_equal(play(simulation, agent, seed=3).curve, expected.curve)


@pytest.mark.parametrize(
    ("part", "wrong", "message"),
    [
        ("pose", None, "pose that is no Pose"),
        ("pose", Pose(float("nan"), 0.0, 0.0), "pose whose values"),
        ("grid", np.zeros((3, 3)), "grid that is no OccupancyGrid"),
        ("field", None, "no field of distances"),
        ("sensor", None, "sensor that is no LidarConfig"),
        ("distance", "far", "distance that is no finite number"),
        ("frontiers", [3], "frontiers that are no Frontier"),
        ("frontiers", 5, "no frontiers"),
    ],
)
def test_decisions_made_by_hand_are_told_what_they_lack(part: str, wrong: Any, message: str) -> None:
    from layoutexplore.agents.rl.networks.actor_critic import Actor

    good = looking(decide(CORRIDOR, (1, 2, 2.0, 9.0), (1, 17, 2.0, 9.0)))
    for agent in (NetworkPolicy("mine", Actor(spec()).eval(), spec()), make_agent("policy")):
        agent.reset(0)
        with pytest.raises(ConfigError, match=message):
            agent.act(dataclasses.replace(good, **{part: wrong}))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"cells": np.zeros((0, 2), np.int32)}, "frontier 0 without cells"),
        ({"centroid": (float("nan"), 0.0)}, "frontier 0 whose lengths"),
        ({"path_length": "x"}, "frontier 0 whose lengths"),
        ({"viewpoint": None}, "frontier 0 whose viewpoint is no cell"),
    ],
)
def test_frontiers_made_by_hand(changes: dict[str, Any], message: str) -> None:
    good = looking(decide(CORRIDOR, (1, 2, 2.0, 9.0), (1, 17, 2.0, 9.0)))
    frontiers = [dataclasses.replace(good.frontiers[0], **changes), good.frontiers[1]]
    with pytest.raises(ConfigError, match=message):
        make_agent("policy").act(dataclasses.replace(good, frontiers=frontiers))


def test_a_network_made_by_hand_without_its_spec() -> None:
    from layoutexplore.agents.rl.networks.actor_critic import Actor

    with pytest.raises(ConfigError, match="spec must be PolicySpec"):
        NetworkPolicy("mine", Actor(spec()), None)  # type: ignore[arg-type]
