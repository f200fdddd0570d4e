"""Trained networks as agents."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("safetensors")

from layoutexplore.agents import make_agent  # noqa: E402
from layoutexplore.agents.rl.agent import NetworkPolicy  # noqa: E402
from layoutexplore.benchmark.rows import prepare  # noqa: E402
from layoutexplore.errors import MissingExtraError  # noqa: E402
from layoutexplore.simulation.config import SimulationConfig  # noqa: E402
from layoutexplore.simulation.episode import play  # noqa: E402
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
