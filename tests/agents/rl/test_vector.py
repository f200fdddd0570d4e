"""A vector environment as stable-baselines3 takes it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("sb3_contrib")
pytest.importorskip("tensorboard")


from sb3_contrib.common.maskable.utils import is_masking_supported  # noqa: E402
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor  # noqa: E402

from layoutexplore.agents.rl.environments import make_envs  # noqa: E402
from layoutexplore.agents.rl.vector import VectorAdapter  # noqa: E402
from layoutexplore.envs.observation import ObservationConfig  # noqa: E402
from layoutexplore.errors import ConfigError  # noqa: E402
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


def small_vectors(**more: Any) -> tuple[VectorAdapter, DummyVecEnv]:
    """Two environments, as our adapter hands them on and as stable-baselines3 steps them itself."""
    options = more | {
        "plan": "apartment-01",
        "observation": ObservationConfig(
            local_map=False, global_map=False, max_frontiers=8, early_stop=False
        ),
    }
    name = "LayoutExplore/Frontier-v0"
    ours = VectorAdapter(gymnasium.make_vec(name, 2, backend="serial", **options))
    return ours, DummyVecEnv([lambda: gymnasium.make(name, **options)] * 2)


def test_infos_and_options_of_reset_are_those_of_stable_baselines3() -> None:
    both = small_vectors()
    for envs in both:
        envs.seed(3)
        envs.set_options({"plan": "apartment-02"})
        envs.reset()
    ours, theirs = both
    assert ours.get_attr("plan_name") == ["apartment-02"] * 2
    dones = np.zeros(2, np.bool_)
    while not dones.any():  # From then on `reset_infos` of theirs are those of the next episodes.
        for info, other in zip(ours.reset_infos, theirs.reset_infos, strict=True):
            np.testing.assert_equal(info, other)
        actions = ours.action_masks().argmax(axis=1)
        (_, _, dones, infos), (_, _, others, expected) = ours.step(actions), theirs.step(actions)
        np.testing.assert_array_equal(dones, others)
        for info, other in zip(infos, expected, strict=True):
            episode = info.pop("episode", {"coverage": info["coverage"]})
            assert episode["coverage"] == info["coverage"]
            np.testing.assert_equal({"TimeLimit.truncated": False} | info, other)
    ours.reset()
    assert ours.get_attr("plan_name") == ["apartment-01"] * 2
    ours.set_options([{"plan": "apartment-02"}, {}])
    with pytest.raises(ConfigError, match="same options"):
        ours.reset()
    ours.close()


def test_wrappers_of_stable_baselines3_find_what_they_need() -> None:
    envs, _ = small_vectors(render_mode="rgb_array", render_size=(320, 240))
    assert is_masking_supported(envs)  # An evaluation asks before its first reset.
    monitored = VecMonitor(envs, info_keywords=("coverage", "stop_reason"))
    monitored.reset()
    image = monitored.render("rgb_array")
    assert image is not None and image.shape[2] == 3 and image.any()
    ended: list[dict[str, Any]] = []
    while not ended:
        _, _, _, infos = monitored.step(envs.action_masks().argmax(axis=1))
        ended = [info["episode"] for info in infos if "episode" in info]
    assert ended[0]["coverage"] > 0.9 and ended[0]["stop_reason"] > 0
    monitored.close()
