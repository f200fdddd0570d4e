"""Imitation: the policy comes to agree with its teacher."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("sb3_contrib")
pytest.importorskip("tensorboard")


from layoutexplore.agents import make_agent  # noqa: E402
from layoutexplore.agents.rl.agent import NetworkPolicy  # noqa: E402
from layoutexplore.agents.rl.imitation import Demonstrations, attend, imitate  # noqa: E402
from layoutexplore.agents.rl.networks.actor_critic import Actor  # noqa: E402
from layoutexplore.agents.rl.training import Run  # noqa: E402
from layoutexplore.envs.frontier import FrontierEnv  # noqa: E402
from layoutexplore.envs.observation import ObservationConfig  # noqa: E402
from layoutexplore.errors import ConfigError  # noqa: E402
from layoutexplore.frontiers.decision import STOP, Decision  # noqa: E402
from layoutexplore.simulation.episode import play  # noqa: E402
from layoutexplore.simulation.simulation import Simulation  # noqa: E402
from tests.agents.rl.cases import Silent, random_actor, small_config, spec, train  # noqa: E402


def test_imitation_comes_to_agree(tmp_path: Path) -> None:
    config = small_config(
        tmp_path,
        imitation={"teacher": "nearest-0.4", "episodes": 4, "rounds": 2, "epochs": 30, "batch_size": 32},
        network={"tour_weight": 0.0, "detour_weight": 0.0},
    )
    assert config.network is not None
    watcher = Silent()
    torch.manual_seed(0)
    run = Run(config, tmp_path / "run", device="cpu", resume=False, watcher=watcher)
    assert run.spec is not None
    imitate(Actor(run.spec), config, watcher.say)
    shares = [float(line.split(", ")[-1].split("%")[0]) for line in watcher.lines]
    assert len(shares) == 2 and shares[-1] > 80


def test_a_teacher_that_knows_the_plan(tmp_path: Path) -> None:
    config = small_config(
        tmp_path, imitation={"teacher": "clairvoyant", "episodes": 1, "rounds": 1, "epochs": 1}
    )
    watcher = Silent()
    run = Run(config, tmp_path / "run", device="cpu", resume=False, watcher=watcher)
    assert run.spec is not None
    imitate(Actor(run.spec), config, watcher.say)
    assert watcher.lines


def test_a_teacher_with_another_predictor(tmp_path: Path) -> None:
    config = small_config(tmp_path, imitation={"teacher": "layout-tour"})
    with pytest.raises(ConfigError, match="needs predictor = 'layout'"):
        train(config, tmp_path / "run")


class Farthest:
    """Goes to the farthest frontier, for which there may be no slot, and stops after some decisions."""

    name = "farthest"

    def __init__(self, most: int = 1000) -> None:
        self.most = most

    def reset(self, seed: int) -> None:
        self.left = self.most

    def act(self, decision: Decision) -> int:
        self.left -= 1
        return len(decision.frontiers) - 1 if self.left >= 0 else STOP


class Batched(Farthest):
    """Answers as a policy does that is asked for a batch of one decision."""

    def act(self, decision: Decision) -> Any:
        return np.array([super().act(decision)])


def few_slots() -> FrontierEnv:
    observation = ObservationConfig(max_frontiers=2, local_map=False, global_map=False)
    return FrontierEnv("apartment-01", sensor="short", observation=observation)


@pytest.mark.parametrize("most", [6, 1000])
def test_a_teacher_is_followed_beyond_the_slots_and_until_it_stops(most: int) -> None:
    env, learnt, teacher = few_slots(), Demonstrations(), Farthest(most)
    attend(env, teacher, None, learnt, seed=0)
    alone = Simulation(env.simulation.plan, env.simulation.config)
    seed = env.reset(seed=0)[1]["simulation_seed"]
    attend(env, teacher, None, Demonstrations(), seed=0)
    offered: list[int] = []
    play(alone, teacher, seed=seed, on_step=lambda s: offered.append(len(s.decision.frontiers)))
    assert env.simulation.track.tolist() == alone.track.tolist()
    assert max(offered) > 2 and (alone.stop_reason == "agent") == (most == 6)
    asked = offered[:most] if most == 6 else offered[:-1]
    assert learnt.choices == [count - 1 for count in asked if count <= 2]


def test_a_teacher_may_answer_with_an_array_of_one_number() -> None:
    env, tracks = few_slots(), []
    for teacher in (Farthest(6), Batched(6)):
        attend(env, teacher, None, Demonstrations(), seed=0)
        tracks.append(env.simulation.track.tolist())
    assert tracks[0] == tracks[1]


def test_a_policy_that_leads_is_taught_until_the_teacher_stops(tmp_path: Path) -> None:
    config = small_config(tmp_path, observation={"max_frontiers": 2})
    run = Run(config, tmp_path / "run", device="cpu", resume=False, watcher=Silent())
    env, learnt = few_slots(), Demonstrations()
    attend(env, Farthest(5), run.actor(), learnt, seed=0)
    assert env.simulation.decisions == 5 and len(learnt.choices) < 5
    run.envs.close()


def test_a_policy_that_leads_looks_around_as_it_will() -> None:
    """So it is taught where it comes to when it explores by itself."""
    kind, actor = replace(spec(), look_every=2.0), random_actor()
    observation = ObservationConfig(local_map=False, global_map=False, detour=True)
    env = FrontierEnv("apartment-01", sensor="stage", observation=observation, look_every=2.0)
    seed = env.reset(seed=0)[1]["simulation_seed"]
    alone = Simulation(env.simulation.plan, env.simulation.config)
    play(alone, NetworkPolicy("policy", actor, kind), seed=seed)
    attend(env, make_agent("nearest"), actor, Demonstrations(), seed=0)
    assert env.simulation.track.tolist() == alone.track.tolist()


def test_a_run_that_is_stopped_in_its_first_evaluation_imitates_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    imitation = {"teacher": "nearest-0.4", "episodes": 1, "rounds": 1, "epochs": 1}
    config, watcher = small_config(tmp_path, steps=16, imitation=imitation), Silent()
    monkeypatch.setattr(Run, "evaluate", lambda run: setattr(run, "stopping", True))
    first = train(config, tmp_path / "run", watcher=watcher)
    assert first.progress.steps == 0 and first.progress.imitated
    again = train(config, tmp_path / "run", resume=True, watcher=watcher)
    taught = [line for line in watcher.lines if line.startswith("imitation")]
    assert len(taught) == 1 and again.progress.imitated
    assert all(
        torch.equal(a, b) for a, b in zip(first.weights().values(), again.weights().values(), strict=True)
    )
