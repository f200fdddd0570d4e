"""Acting in groups of environments that do not wait for each other."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import gymnasium
import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("sb3_contrib")


from layoutexplore.agents.rl.environments import environment_arguments, make_envs  # noqa: E402
from layoutexplore.agents.rl.networks.actor_critic import Actor  # noqa: E402
from layoutexplore.agents.rl.ppo.collector import Collector, Filling  # noqa: E402
from layoutexplore.agents.rl.ppo.rollout import Rollout  # noqa: E402
from layoutexplore.agents.rl.vector import VectorAdapter  # noqa: E402
from tests.agents.rl.cases import random_actor, small_config, spec  # noqa: E402

STEPS = 6


def collector_of(env: VectorAdapter, next_actor: Callable[[bool], Actor | None], steps: int) -> Collector:
    """One that begins in new episodes."""
    template = Rollout(steps, env.observation_space, env.action_space, "cpu", n_envs=env.num_envs)
    env.seed(3)
    seen, starts = env.reset(), np.ones(env.num_envs, np.bool_)
    return Collector(env, template, next_actor, seen, starts, torch.Generator().manual_seed(6))


def actors(count: int) -> Iterator[Actor]:
    """Actors that want different things."""
    for seed in range(count):
        yield random_actor("pooled", seed)


def filled(env: VectorAdapter, *, waits: bool = False, rollouts: int = 3) -> list[Filling]:
    """Rollouts of one actor each, which is ready at once or only when it is waited for."""
    made = actors(rollouts)

    def next_actor(wait: bool) -> Actor | None:
        return next(made) if wait or not waits else None

    collector = collector_of(env, next_actor, STEPS)
    found = []
    for k in range(rollouts):
        counted: list[int] = []

        def on_decisions(decisions: int, counted: list[int] = counted) -> bool:
            counted.append(decisions)
            return True

        filling = collector.collect(on_decisions, more=k + 1 < rollouts)
        assert filling is not None and sum(counted) == filling.decisions == STEPS * env.num_envs
        found.append(filling)
    return found


def side_by_side(tmp_path: Path, slow: int | None, monkeypatch: pytest.MonkeyPatch) -> VectorAdapter:
    """Three environments in two groups on threads, one of which is slow; without, one after the other."""
    config = small_config(tmp_path, envs=3)
    if slow is None:
        return make_envs(config)
    arguments = environment_arguments(config)
    env = VectorAdapter(gymnasium.make_vec(config.environment, 3, workers=2, backend="threads", **arguments))
    member = env._native._workers.members[slow]  # type: ignore[attr-defined]
    step = member.step
    monkeypatch.setattr(member, "step", lambda: (time.sleep(0.02), step()))
    return env


@pytest.mark.parametrize("waits", [False, True])
@pytest.mark.parametrize("slow", [0, 1])
def test_it_does_not_matter_which_group_is_quicker(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, slow: int, waits: bool
) -> None:
    """Groups of which one is held up, and actors that are late, against one environment after the other."""
    found = []
    for held_up, late in ((None, True), (slow, waits)):
        env = side_by_side(tmp_path, held_up, monkeypatch)
        found.append(filled(env, waits=late))
        env.close()
    for one, other in zip(*found, strict=True):
        assert one.ends.keys() == other.ends.keys()
        np.testing.assert_array_equal(one.starts, other.starts)
        for name in ("actions", "rewards", "episode_starts", "action_masks"):
            np.testing.assert_array_equal(getattr(one.rollout, name), getattr(other.rollout, name))
        np.testing.assert_allclose(one.rollout.log_probs, other.rollout.log_probs, atol=1e-5)
        for name, array in one.rollout.observations.items():
            np.testing.assert_array_equal(array, other.rollout.observations[name])
            np.testing.assert_array_equal(one.seen[name], other.seen[name])


def test_a_quick_group_goes_on_while_another_is_held_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The other one makes no step before the second rollout is begun: they would wait for each other."""
    env = side_by_side(tmp_path, 1, monkeypatch)
    member = env._native._workers.members[1]  # type: ignore[attr-defined]
    step, gone_on = member.step, threading.Event()
    monkeypatch.setattr(member, "step", lambda: (gone_on.wait(60), step()))
    asked: list[bool] = []

    def next_actor(wait: bool) -> Actor:
        asked.append(wait)
        if len(asked) == 2:
            gone_on.set()
        return random_actor("pooled")

    collector = collector_of(env, next_actor, STEPS)
    for more in (True, False):
        assert collector.collect(lambda decisions: True, more=more) is not None
    env.close()
    assert asked == [True, False]


def test_a_collector_stops_when_told_and_leaves_nothing_unanswered(tmp_path: Path) -> None:
    env = make_envs(small_config(tmp_path))
    counted: list[int] = []

    def on_decisions(decisions: int) -> bool:
        counted.append(decisions)
        return len(counted) < 3

    collector = collector_of(env, lambda wait: Actor(spec()), 8)
    assert collector.collect(on_decisions, more=True) is None
    assert counted == [2, 2, 2]
    env.step(np.zeros(2, np.int64))
    env.close()
