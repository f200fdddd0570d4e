"""The contract of every registered environment, and what is particular to each."""

from __future__ import annotations

import copy
import os
import pickle
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import FlattenObservation, RecordEpisodeStatistics, RecordVideo, TimeLimit

import layoutexplore
from layoutexplore.envs.motion import MotionEnv
from layoutexplore.errors import MissingExtraError, StartError
from layoutexplore.maps.tracing import floorplan_from_ascii
from tests.envs.cases import CASES, FRONTIER, IDS, MOTION, Step, cases, choose, digest, make, rollout, rooms


def test_the_ids_are_registered_once() -> None:
    assert IDS == [FRONTIER, MOTION]
    before = dict(gymnasium.registry)
    layoutexplore._register()
    assert gymnasium.registry == before


@cases
def test_gymnasium_finds_nothing_to_complain_about(
    name: str, options: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    pytest.importorskip("pygame")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(make(name, render_mode="rgb_array", render_size=(320, 240), **options).unwrapped)


@cases
def test_stable_baselines_finds_nothing_to_complain_about(name: str, options: dict[str, Any]) -> None:
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        checker.check_env(make(name, **options).unwrapped)


@cases
def test_everything_returned_is_as_declared(name: str, options: dict[str, Any]) -> None:
    env = make(name, **options)
    steps = rollout(env, seed=0, steps=30)
    keys = steps[0][4].keys()
    for observation, reward, terminated, truncated, info in steps:
        assert env.observation_space.contains(observation)
        assert type(reward) is float and type(terminated) is bool and type(truncated) is bool
        assert info.keys() == keys
        assert all(
            isinstance(value, (int, float, np.ndarray)) and key.islower() for key, value in info.items()
        )
    coverage = [
        info["coverage"] for *_, info in steps if info["simulation_seed"] == steps[0][4]["simulation_seed"]
    ]
    assert coverage == sorted(coverage)


@cases
def test_the_same_seed_gives_the_same_episode(name: str, options: dict[str, Any]) -> None:
    first, second = make(name, **options), make(name, **options)
    assert digest(rollout(first, 3)) == digest(rollout(second, 3))
    assert digest(rollout(first, 3)) == digest(rollout(second, 3))
    assert digest(rollout(first, 3)) != digest(rollout(second, 4))


@cases
def test_reset_without_a_seed_goes_on_with_the_stream(name: str, options: dict[str, Any]) -> None:
    env = make(name, **options)
    seeds = [env.reset(seed=1)[1]["simulation_seed"], *(env.reset()[1]["simulation_seed"] for _ in range(2))]
    again = [env.reset(seed=1)[1]["simulation_seed"], *(env.reset()[1]["simulation_seed"] for _ in range(2))]
    assert seeds == again
    assert len(set(seeds)) == 3


def test_another_process_gives_the_same_episodes() -> None:
    script = "import tests.envs.cases as t\n"
    script += "for name, options in t.CASES: print(t.digest(t.rollout(t.make(name, **options), 5)))"
    environment = os.environ | {"PYTHONHASHSEED": "7", "PYTHONPATH": str(Path(__file__).parents[2])}
    told = subprocess.run(
        [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True
    )
    assert told.stdout.split() == [digest(rollout(make(name, **options), 5)) for name, options in CASES]


@cases
@pytest.mark.parametrize("mode", ["sync", "async"])
def test_vectors_of_environments_step_like_single_ones(name: str, options: dict[str, Any], mode: str) -> None:
    vector = gymnasium.make_vec(
        name, num_envs=2, vectorization_mode=mode, plan=rooms(), sensor="indoor", **options
    )
    singles = [make(name, **options) for _ in range(2)]
    try:
        observations, infos = vector.reset(seed=[4, 9])
        expected = [env.reset(seed=seed) for env, seed in zip(singles, (4, 9), strict=True)]
        for _ in range(3):
            for k, (observation, info) in enumerate(expected):
                for key, value in observation.items():
                    np.testing.assert_array_equal(observations[key][k], value)
                assert all(np.array_equal(infos[key][k], value) for key, value in info.items())
            actions = [
                choose(env, info, np.random.default_rng(0))
                for env, (_, info) in zip(singles, expected, strict=True)
            ]
            observations, _, _, _, infos = vector.step(np.array(actions))
            steps = [env.step(action) for env, action in zip(singles, actions, strict=True)]
            expected = [(step[0], step[4]) for step in steps]
    finally:
        vector.close()


@cases
def test_the_usual_wrappers_work(name: str, options: dict[str, Any], tmp_path: Path) -> None:
    pytest.importorskip("moviepy")
    env: Any = make(name, render_mode="rgb_array", render_size=(320, 240), **options)
    env = FlattenObservation(RecordEpisodeStatistics(TimeLimit(RecordVideo(env, str(tmp_path / "films")), 3)))
    observation, info = env.reset(seed=0)
    over = False
    while not over:
        observation, _, terminated, truncated, info = env.step(choose(env, info, np.random.default_rng(0)))
        over = terminated or truncated
    env.close()
    assert env.observation_space.contains(observation)
    assert set(info["episode"]) == {"r", "l", "t"}
    assert [path.suffix for path in (tmp_path / "films").iterdir() if path.stat().st_size > 1000] == [".mp4"]


@cases
@pytest.mark.parametrize(
    "duplicate", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["deepcopy", "pickle"]
)
def test_a_copy_goes_on_where_the_original_is(name: str, options: dict[str, Any], duplicate: Any) -> None:
    env = make(name, **options).unwrapped
    rollout(env, seed=2, steps=3)
    other = duplicate(env)
    rng = np.random.default_rng(1)
    for _ in range(4):
        action = choose(env, env._info() if name == MOTION else {"action_mask": 0}, rng)
        assert digest([env.step(action)]) == digest([other.step(action)])


@pytest.mark.parametrize(
    "predictor",
    ["layout", "oracle:horizon=1", "prior:true", "reconstruct:doorways", "reconstruct:morphological"],
)
def test_an_environment_with_a_predictor_can_be_pickled(predictor: str) -> None:
    env = make(FRONTIER, predictor=predictor).unwrapped
    rollout(env, seed=2, steps=3)
    other = pickle.loads(pickle.dumps(env))
    for _ in range(3):
        assert digest([env.step(0)]) == digest([other.step(0)])


@cases
@pytest.mark.parametrize("mode", ["rgb_array", "ansi"])
def test_looking_changes_nothing(name: str, options: dict[str, Any], mode: str) -> None:
    shown = make(name, render_mode=mode, render_size=(320, 240), **options)
    expected = rollout(make(name, **options), seed=6)
    observation, info = shown.reset(seed=6)
    rng = np.random.default_rng(6)
    seen: list[Step] = [(observation, 0.0, False, False, info)]
    for _ in expected[1:]:
        assert shown.render() is not None
        seen.append(shown.step(choose(shown, seen[-1][4], rng)))
        if seen[-1][2] or seen[-1][3]:
            shown.reset()
    assert digest(seen) == digest(expected)


@cases
def test_frames_have_the_size_that_was_asked_for(name: str, options: dict[str, Any]) -> None:
    env = make(name, render_mode="rgb_array", render_size=(400, 300), **options)
    env.reset(seed=0)
    frame: Any = env.render()
    assert frame.shape == (300, 400, 3) and frame.dtype == np.uint8


@cases
def test_the_window_opens_and_closes(
    name: str, options: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = make(name, render_mode="human", render_size=(320, 240), **options)
    env.metadata["render_fps"] = 1000
    _, info = env.reset(seed=0)
    env.step(choose(env, info, np.random.default_rng(0)))
    assert env.render() is None
    pickle.dumps(env.unwrapped)
    env.close()
    env.close()


@pytest.mark.parametrize("name", IDS)
def test_a_window_without_pygame_names_the_extra(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(MissingExtraError, match=r"layoutexplore\[human\]") as raised:
        make(name, render_mode="human")
    assert isinstance(raised.value, DependencyNotInstalled)


@pytest.mark.parametrize("name", IDS)
def test_rendering_without_a_mode_warns(name: str) -> None:
    env = make(name).unwrapped
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="render_mode"):
        assert env.render() is None


def test_after_a_refused_start_the_scans_are_of_the_plan_that_is_asked_for() -> None:
    small = floorplan_from_ascii("\n".join(["." * 6] * 6), resolution=1.0, name="small")
    big = floorplan_from_ascii("\n".join(["." * 28] * 28), resolution=1.0, name="big")
    asked: dict[str, Any] = {"plan": big, "start": (5.0, 5.0, 0.0)}
    env, fresh = (MotionEnv(plan, sensor="indoor") for plan in (small, big))
    wanted = fresh.reset(seed=0, options=asked)[0]["scan"]
    env.reset(seed=0)
    with pytest.raises(StartError):
        env.reset(seed=0, options={"plan": big, "start": (1e5, 0.0)})
    np.testing.assert_array_equal(env.reset(seed=0, options=asked)[0]["scan"], wanted)
