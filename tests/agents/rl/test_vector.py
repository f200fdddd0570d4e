"""A vector environment as stable-baselines3 takes it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("sb3_contrib")
pytest.importorskip("tensorboard")


from layoutexplore.agents.rl.environments import make_envs  # noqa: E402
from tests.agents.rl.cases import small_config  # noqa: E402


def test_episodes_are_told_and_stopping_is_masked(tmp_path: Path) -> None:
    envs = make_envs(small_config(tmp_path))
    envs.seed(1)
    envs.reset()
    episodes = []
    for _ in range(60):
        masks = envs.action_masks()
        assert not masks[:, -1].any() or not masks[:, :-1][masks[:, -1]].any()
        _, rewards, dones, infos = envs.step(masks.argmax(axis=1))
        assert (rewards <= 0).all()
        episodes += [(infos[k], k) for k in np.flatnonzero(dones)]
    envs.close()
    info, _ = episodes[0]
    assert info["episode"]["coverage"] >= 0.95 and 0 < info["episode"]["d95_share"] <= 1
    assert info["terminal_observation"].keys() == envs.observation_space.spaces.keys()
    assert info["episode"]["r"] < 0 and info["episode"]["l"] > 1 and not info["TimeLimit.truncated"]


def test_some_environments_are_asked_and_changed(tmp_path: Path) -> None:
    envs = make_envs(small_config(tmp_path))
    envs.seed(1)
    envs.reset()
    assert envs.num_envs > 1
    (mask,) = envs.env_method("action_masks", indices=[1])
    np.testing.assert_array_equal(mask, envs.action_masks()[1])
    assert envs.get_attr("plan_name") == list(envs.env.call("plan_name"))
    envs.set_attr("progress", 0.5)
    envs.set_attr("progress", 0.25, indices=0)
    assert envs.get_attr("progress") == [0.25, *[0.5] * (envs.num_envs - 1)]
    envs.set_attr("kept", (1.0, 2.0))
    assert envs.get_attr("kept") == [(1.0, 2.0)] * envs.num_envs
    assert envs.get_attr("progress", indices=[0]) == [0.25] and envs.env_is_wrapped(object, [0]) == [False]
    envs.close()
