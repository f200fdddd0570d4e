"""Trained policies as agents: what ships needs no torch and chooses as the network does."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import safetensors.numpy

from layoutexplore.agents import make_agent
from layoutexplore.agents.policy import load_policy
from layoutexplore.agents.rl.card import WEIGHTS, find_policy, read_card, read_spec
from layoutexplore.agents.rl.linear import LinearPolicy, PolicyAgent, linear_shapes
from layoutexplore.agents.rl.pooled import PooledPolicy, pooled_shapes
from layoutexplore.agents.watchful_tour import WatchfulTourOptions, plan_watchful_tour
from layoutexplore.benchmark.rows import prepare
from layoutexplore.errors import ConfigError, ResultsError, checks_arguments
from layoutexplore.files import parse_toml, to_toml
from layoutexplore.frontiers.decision import Decision
from layoutexplore.grids.arrays import Floats32
from layoutexplore.grids.grid import UNKNOWN, OccupancyGrid
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.episode import play
from tests.agents.cases import CORRIDOR, decide, looking

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
        np.testing.assert_allclose(agent.logits(decision), network.logits(decision), rtol=1e-5, atol=1e-3)
        choice = agent.act(decision)
        assert np.array_equal(choice, network.act(decision))
        decision = simulation.step(choice)


@pytest.mark.parametrize("name", SHIPPED)
def test_the_card_beside_the_weights_is_the_one_in_their_file(name: str) -> None:
    path = find_policy(name)
    assert parse_toml(path.with_suffix(".toml").read_text(), name) == read_card(path)


@pytest.mark.parametrize("encoder", ["none", "pooled"])
def test_all_that_is_read_is_weighed_as_by_the_network(tmp_path: Path, encoder: str) -> None:
    torch = pytest.importorskip("torch")
    from layoutexplore.agents.rl.agent import NetworkPolicy
    from layoutexplore.agents.rl.torch_policy_files import load_actor, save_policy
    from tests.agents.rl.cases import random_actor, spec

    torch.manual_seed(0)
    path = tmp_path / "trained.safetensors"
    save_policy(path, random_actor(encoder).state_dict(), {"policy": spec(encoder).as_table()})
    simulation, agent = prepare("apartment-01", SimulationConfig(sensor="indoor"), f"policy:{path}")
    network = NetworkPolicy("network", *load_actor(path))
    decision = simulation.reset(seed=0)
    network.reset(0)
    for _ in range(5):
        assert isinstance(agent, LinearPolicy)
        np.testing.assert_allclose(agent.logits(decision), network.logits(decision), rtol=1e-5, atol=1e-5)
        decision = simulation.step(agent.act(decision))


@pytest.mark.parametrize("name", ["layout", "tour"])
def test_weights_of_another_card(tmp_path: Path, name: str) -> None:
    path = tmp_path / "mine.safetensors"
    card = read_card(find_policy(name))
    card["policy"]["frontier_features"] = ["ahead", "tour_rank"]
    weights = safetensors.numpy.load_file(find_policy(name))
    safetensors.numpy.save_file(weights, path, metadata={"card": to_toml(card)})
    with pytest.raises(ResultsError, match=r"direct.weight has the shape \(1, \d+\), expected \(1, 2\)"):
        load_policy("mine", str(path))


@pytest.mark.parametrize(
    ("kind", "shapes_of", "name"),
    [(LinearPolicy, linear_shapes, "tour"), (PooledPolicy, pooled_shapes, "layout")],
)
def test_weights_that_do_not_fit_are_told_when_a_policy_is_made(kind: Any, shapes_of: Any, name: str) -> None:
    spec = read_spec(find_policy(name))
    shapes = shapes_of(spec)
    weights = {key: np.zeros(shape, np.float32) for key, shape in shapes.items()}
    assert kind("mine", weights, spec).name == "mine"
    for key, shape in shapes.items():
        for wrong in (np.zeros((2, 3, 4), np.float32), np.full(shape, "x"), np.zeros((), np.float32)):
            if wrong.shape != shape or wrong.dtype.kind == "U":
                with pytest.raises(ConfigError, match=f"weights: '{key}' must"):
                    kind("mine", {**weights, key: wrong}, spec)
        with pytest.raises(ConfigError, match=f"weights must have '{key}'"):
            kind("mine", {one: weights[one] for one in weights if one != key}, spec)
    with pytest.raises(ConfigError, match="weights must be a Mapping"):
        kind("mine", list(weights), spec)
    for alone in (np.float32(1.0), np.ones(1, np.float32)):
        assert kind("mine", {**weights, "tour_weight": alone}, spec)


def test_weights_without_dimensions_are_not_blamed_for_something_else() -> None:
    @checks_arguments
    def scale(weights: Mapping[str, Floats32], by: float) -> Any:
        return weights["one"] * by.real.conjugate(0)  # type: ignore[call-arg]

    with pytest.raises(TypeError):
        scale({"one": np.ones((), np.float32)}, 1.0)


def test_the_name_and_predictor_of_what_ships() -> None:
    agents = {spec: make_agent(spec) for spec in ("policy", "policy:tour", "policy:no-layout")}
    assert [agent.name for agent in agents.values()] == list(agents)
    assert [agent.predictor for agent in agents.values()] == ["layout", "layout", "none"]
    assert [make_agent(spec).remembers for spec in agents] == [True, False, False]


@dataclass
class Favourite(PolicyAgent):
    """Likes the frontier of one column, as long as it is asked."""

    column: int = 17
    watchful: float = 0.0

    def __post_init__(self) -> None:
        spec = read_spec(find_policy("layout"))
        super().__init__("favourite", dataclasses.replace(spec, look_every=2.0, watchful=self.watchful))

    def logits(self, decision: Decision) -> Floats32:
        return (decision.viewpoints[:, 1] == self.column).astype(np.float32)


def test_it_looks_around_on_its_way_and_keeps_to_its_frontier_without_news() -> None:
    agent, both = Favourite(), looking(decide(CORRIDOR, (1, 2, 2.0, 9.0), (1, 17, 2.0, 9.0)))
    assert np.array_equal(agent.act(both), [[1, 7], [1, 8], [1, 9]])
    agent.column = 2
    assert np.array_equal(agent.act(both), [[1, 7], [1, 8], [1, 9]]), "it likes the other by now"
    agent.reset(0)
    assert np.array_equal(agent.act(both), [[1, 7], [1, 6], [1, 5]]), "a new run begins with no goal"


def test_it_chooses_anew_as_soon_as_it_sees_anything_on_its_way() -> None:
    agent, both = Favourite(), looking(decide(CORRIDOR, (1, 2, 2.0, 9.0), (1, 17, 2.0, 9.0)))
    cells = both.grid.cells.copy()
    cells[0, 0] = UNKNOWN
    before = dataclasses.replace(both, grid=OccupancyGrid(cells, both.grid.resolution))
    assert np.array_equal(agent.act(before), [[1, 7], [1, 8], [1, 9]])
    agent.column = 2
    assert np.array_equal(agent.act(both), [[1, 7], [1, 6], [1, 5]])


@pytest.mark.parametrize(("watchful", "goes"), [(0.0, 17), (1.5, 17), (2.5, 2)])
def test_the_tour_of_watchful_tour_counts_where_the_lidar_sees_all_around(watchful: float, goes: int) -> None:
    """The tour begins on the left: the weight is whole there and half on the right, whose logit is 1 more."""
    both = decide(CORRIDOR, (1, 2, 2.0, 9.0), (1, 17, 2.0, 9.0))
    assert both.viewpoints[plan_watchful_tour(both, WatchfulTourOptions()), 1].tolist() == [2, 17]
    agent, step = Favourite(watchful=watchful), 1 if goes == 17 else -1
    assert np.array_equal(agent.act(looking(both)), [[1, 7], [1, 8], [1, 9]]), "its own favourite"
    agent.reset(0)
    choice = agent.act(looking(both, fov=2 * np.pi))
    if watchful:  # it makes steps there, too, as `watchful-tour` does
        assert np.array_equal(choice, [[1, 7], [1, 7 + step], [1, 7 + 2 * step]])
    else:
        assert isinstance(choice, int) and both.viewpoints[choice, 1] == goes
