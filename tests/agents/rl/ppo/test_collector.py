"""Acting in groups of environments that do not wait for each other."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("sb3_contrib")


from layoutexplore.agents.rl.environments import make_envs  # noqa: E402
from layoutexplore.agents.rl.networks.actor_critic import Actor  # noqa: E402
from layoutexplore.agents.rl.ppo.collector import Collector  # noqa: E402
from layoutexplore.agents.rl.ppo.rollout import Rollout  # noqa: E402
from layoutexplore.agents.rl.vector import VectorAdapter  # noqa: E402
from tests.agents.rl.cases import small_config, spec  # noqa: E402


def filled(env: VectorAdapter, steps: int = 6) -> tuple[Rollout, Any]:
    """A rollout of an actor in environments, and the episodes that ended in it."""
    torch.manual_seed(5)
    actor = Actor(spec())
    rollout = Rollout(steps, env.observation_space, env.action_space, "cpu", n_envs=env.num_envs)
    env.seed(3)
    seen, starts = env.reset(), np.ones(env.num_envs, np.bool_)
    torch.manual_seed(6)
    return rollout, Collector(actor, env, rollout, seen, starts, lambda count: count > 0).run()


def test_it_does_not_matter_which_group_is_quicker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Groups on threads, each held up in turn, against all environments one after the other."""
    config = small_config(tmp_path, envs=3)
    found = []
    for slow in (None, 0, 1):
        env = make_envs(config)
        if slow is not None:
            import gymnasium

            from layoutexplore.agents.rl.environments import environment_arguments

            env.close()
            env = VectorAdapter(
                gymnasium.make_vec(
                    config.environment, 3, workers=2, backend="threads", **environment_arguments(config)
                )
            )
            member = env._native._workers.members[slow]  # type: ignore[attr-defined]
            step = member.step
            monkeypatch.setattr(member, "step", lambda step=step: (time.sleep(0.02), step()))
        found.append(filled(env))
        env.close()
    (first, ends), others = found[0], found[1:]
    assert ends is not None
    for other, told in others:
        assert told is not None and told.keys() == ends.keys()
        for name in ("actions", "rewards", "episode_starts", "action_masks"):
            np.testing.assert_array_equal(getattr(first, name), getattr(other, name))
        np.testing.assert_allclose(first.log_probs, other.log_probs, atol=1e-5)
        for name, array in first.observations.items():
            np.testing.assert_array_equal(array, other.observations[name])


def test_a_collector_stops_when_told_and_leaves_nothing_unanswered(tmp_path: Path) -> None:
    env = make_envs(small_config(tmp_path))
    env.seed(0)
    seen, starts = env.reset(), np.ones(2, np.bool_)
    rollout = Rollout(8, env.observation_space, env.action_space, "cpu", n_envs=2)
    counted: list[int] = []

    def on_decisions(decisions: int) -> bool:
        counted.append(decisions)
        return len(counted) < 3

    assert Collector(Actor(spec()), env, rollout, seen, starts, on_decisions).run() is None
    assert counted == [2, 2, 2]
    env.step(np.zeros(2, np.int64))
    env.close()
