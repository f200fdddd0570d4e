"""Trained policies as agents: what ships needs no torch and chooses as the network does."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import safetensors.numpy

from layoutexplore.agents import make_agent
from layoutexplore.agents.policy import load_policy
from layoutexplore.agents.rl.card import WEIGHTS, find_policy, read_card
from layoutexplore.agents.rl.linear import LinearPolicy
from layoutexplore.benchmark.rows import prepare
from layoutexplore.errors import ResultsError
from layoutexplore.files import to_toml
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.episode import play

SHIPPED = sorted(path.stem for path in WEIGHTS.glob("*.safetensors"))

WITHOUT_TORCH = """
import sys
sys.modules["torch"] = None
from layoutexplore.benchmark.rows import prepare
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.episode import play
simulation, agent = prepare("apartment-01", SimulationConfig(sensor="indoor"), sys.argv[1])
play(simulation, agent, seed=3)
print(simulation.stop_reason, simulation.distance.hex())
"""


@pytest.mark.parametrize("name", SHIPPED)
def test_what_ships_explores_without_torch_as_with_it(name: str) -> None:
    simulation, agent = prepare("apartment-01", SimulationConfig(sensor="indoor"), f"policy:{name}")
    play(simulation, agent, seed=3)
    command = [sys.executable, "-c", WITHOUT_TORCH, f"policy:{name}"]
    found = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    assert found == ["coverage", simulation.distance.hex()]


@pytest.mark.parametrize("sensor", ["indoor", "stage"])
@pytest.mark.parametrize("name", SHIPPED)
def test_what_ships_chooses_as_its_network_does(name: str, sensor: str) -> None:
    pytest.importorskip("torch")
    from layoutexplore.agents.rl.agent import NetworkPolicy
    from layoutexplore.agents.rl.torch_policy_files import load_actor

    simulation, agent = prepare("apartment-03", SimulationConfig(sensor=sensor), f"policy:{name}")
    assert isinstance(agent, LinearPolicy)
    network = NetworkPolicy("network", *load_actor(find_policy(name)))
    decision = simulation.reset(seed=1)
    network.reset(1)
    while not simulation.done:
        np.testing.assert_allclose(agent.logits(decision), network.logits(decision), rtol=1e-6, atol=1e-6)
        choice = agent.act(decision)
        assert choice == network.act(decision)
        decision = simulation.step(choice)


def test_all_features_of_a_frontier_are_weighed_as_by_the_network(tmp_path: Path) -> None:
    torch = pytest.importorskip("torch")
    from layoutexplore.agents.rl.agent import NetworkPolicy
    from layoutexplore.agents.rl.torch_policy_files import load_actor, save_policy
    from tests.agents.rl.cases import random_actor, spec

    torch.manual_seed(0)
    path = tmp_path / "trained.safetensors"
    save_policy(path, random_actor("none").state_dict(), {"policy": spec("none").as_table()})
    simulation, agent = prepare("apartment-01", SimulationConfig(sensor="indoor"), f"policy:{path}")
    network = NetworkPolicy("network", *load_actor(path))
    decision = simulation.reset(seed=0)
    network.reset(0)
    for _ in range(5):
        assert isinstance(agent, LinearPolicy)
        np.testing.assert_allclose(agent.logits(decision), network.logits(decision), rtol=1e-5, atol=1e-5)
        decision = simulation.step(agent.act(decision))


def test_weights_of_another_card(tmp_path: Path) -> None:
    path = tmp_path / "mine.safetensors"
    card = read_card(find_policy("layout"))
    card["policy"]["frontier_features"] = ["ahead", "tour_rank"]
    weights = safetensors.numpy.load_file(find_policy("layout"))
    safetensors.numpy.save_file(weights, path, metadata={"card": to_toml(card)})
    with pytest.raises(ResultsError, match=r"direct.weight has the shape \(1, \d+\), expected \(1, 2\)"):
        load_policy("mine", str(path))


def test_the_name_and_predictor_of_what_ships() -> None:
    assert [make_agent(spec).name for spec in ("policy", "policy:no-layout")] == [
        "policy",
        "policy:no-layout",
    ]
    assert [load_policy("p", name).predictor for name in ("layout", "no-layout")] == ["layout", "none"]
