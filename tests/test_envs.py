"""The contract of every registered environment, and what is particular to each."""

from __future__ import annotations

import copy
import hashlib
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
from gymnasium.error import DependencyNotInstalled, ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import FlattenObservation, RecordEpisodeStatistics, RecordVideo, TimeLimit

import layoutexplore
from layoutexplore import STOP, FloorPlan, Pose, Simulation, SimulationConfig
from layoutexplore.envs.base import STOP_REASONS
from layoutexplore.envs.motion import MotionConfig
from layoutexplore.envs.observation import ObservationConfig
from layoutexplore.envs.plans import PlanSource
from layoutexplore.errors import ConfigError, LayoutExploreError, MissingExtraError, StartError, UnknownNameError
from layoutexplore.floorplan import floorplan_from_ascii
from layoutexplore.lidar import LidarConfig
from layoutexplore.robot import OdometryNoise

ROOMS = """
#########################
#.......#.......#.......#
#.......#.......#.......#
#.......#.......#.......#
####.#######.######.#####
#.......................#
#.......................#
#####.#####.#######.#####
#.......#.......#.......#
#.......#.......#.......#
#.......#.......#.......#
#########################
"""
"""Six rooms along a corridor; a letter is half a metre."""

FRONTIER, MOTION = "LayoutExplore/Frontier-v0", "LayoutExplore/Motion-v0"
IDS = sorted(name for name in gymnasium.registry if name.startswith("LayoutExplore/"))
CASES = [(name, {}) for name in IDS] + [(MOTION, {"actions": "continuous"})]
cases = pytest.mark.parametrize(("name", "options"), CASES, ids=lambda value: str(value))

Step = tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]


def rooms() -> FloorPlan:
    return floorplan_from_ascii(ROOMS, resolution=0.5, name="six-rooms")


def make(name: str, **options: Any) -> gymnasium.Env[Any, Any]:
    return gymnasium.make(name, **{"plan": rooms(), "sensor": "indoor"} | options)


def rollout(env: gymnasium.Env[Any, Any], seed: int | None, steps: int = 12) -> list[Step]:
    """Seeded random valid actions; a new episode begins where one ends."""
    observation, info = env.reset(seed=seed)
    rng = np.random.default_rng(seed)
    taken: list[Step] = [(observation, 0.0, False, False, info)]
    for _ in range(steps):
        taken.append(env.step(choose(env, taken[-1][4], rng)))
        if taken[-1][2] or taken[-1][3]:
            env.reset()
    return taken


def choose(env: gymnasium.Env[Any, Any], info: dict[str, Any], rng: np.random.Generator) -> Any:
    if "action_mask" in info:
        valid = np.flatnonzero(env.unwrapped.action_masks()[:-1])
        return rng.choice(valid) if len(valid) else env.action_space.n - 1
    if isinstance(env.action_space, gymnasium.spaces.Box):
        return rng.uniform(-1, 1, 2).astype(np.float32)
    return rng.choice([0, 0, 0, 1, 2])


def digest(steps: list[Step]) -> str:
    """A hash of everything that an environment returned."""
    total = hashlib.sha256()
    for observation, reward, terminated, truncated, info in steps:
        for key in sorted(observation):
            total.update(observation[key].tobytes())
        total.update(repr((reward, terminated, truncated)).encode())
        for key in sorted(info):
            total.update(np.asarray(info[key]).tobytes())
    return total.hexdigest()


def test_the_ids_are_registered_once() -> None:
    assert IDS == [FRONTIER, MOTION]
    before = dict(gymnasium.registry)
    layoutexplore._register()
    assert gymnasium.registry == before


@cases
def test_gymnasium_finds_nothing_to_complain_about(name: str, options: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
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
        assert all(isinstance(value, (int, float, np.ndarray)) and key.islower() for key, value in info.items())
    coverage = [info["coverage"] for *_, info in steps if info["simulation_seed"] == steps[0][4]["simulation_seed"]]
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
    script = "import sys; sys.path.insert(0, sys.argv[1]); import test_envs as t\n"
    script += "for name, options in t.CASES: print(t.digest(t.rollout(t.make(name, **options), 5)))"
    here = Path(__file__).parent
    environment = os.environ | {"PYTHONHASHSEED": "7", "PYTHONPATH": str(here.parent)}
    told = subprocess.run([sys.executable, "-c", script, str(here)], env=environment, capture_output=True, text=True, check=True)
    assert told.stdout.split() == [digest(rollout(make(name, **options), 5)) for name, options in CASES]


@cases
@pytest.mark.parametrize("mode", ["sync", "async"])
def test_vectors_of_environments_step_like_single_ones(name: str, options: dict[str, Any], mode: str) -> None:
    vector = gymnasium.make_vec(name, num_envs=2, vectorization_mode=mode, plan=rooms(), sensor="indoor", **options)
    singles = [make(name, **options) for _ in range(2)]
    try:
        observations, infos = vector.reset(seed=[4, 9])
        expected = [env.reset(seed=seed) for env, seed in zip(singles, (4, 9), strict=True)]
        for _ in range(3):
            for k, (observation, info) in enumerate(expected):
                for key, value in observation.items():
                    np.testing.assert_array_equal(observations[key][k], value)
                assert all(np.array_equal(infos[key][k], value) for key, value in info.items())
            actions = [choose(env, info, np.random.default_rng(0)) for env, (_, info) in zip(singles, expected, strict=True)]
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
@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["deepcopy", "pickle"])
def test_a_copy_goes_on_where_the_original_is(name: str, options: dict[str, Any], duplicate: Any) -> None:
    env = make(name, **options).unwrapped
    rollout(env, seed=2, steps=3)
    other = duplicate(env)
    rng = np.random.default_rng(1)
    for _ in range(4):
        action = choose(env, env._info() if name == MOTION else {"action_mask": 0}, rng)
        assert digest([env.step(action)]) == digest([other.step(action)])


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
def test_the_window_opens_and_closes(name: str, options: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
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


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"sensor": "stagee"}, UnknownNameError),
        ({"reward": "path_lenght"}, UnknownNameError),
        ({"reward": 3}, ConfigError),
        ({"render_mode": "rgb"}, ConfigError),
        ({"resolution": 0.0}, ConfigError),
        ({"robot_radius": float("nan")}, ConfigError),
        ({"plan": []}, ConfigError),
        ({"plan": "no-such-plan"}, LayoutExploreError),
    ],
)
def test_bad_arguments_are_refused(name: str, options: dict[str, Any], error: type[Exception]) -> None:
    entry = gymnasium.registry[name].entry_point
    cls = gymnasium.envs.registration.load_env_creator(entry)
    with pytest.raises(error):
        cls(**{"plan": rooms()} | options)


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"start": (0.2, 0.2)}, StartError),
        ({"start": (99.0, 1.0)}, StartError),
        ({"start": (1.0,)}, StartError),
        ({"begin": (1.0, 1.0)}, ConfigError),
        ({"plan": "no-such-plan"}, LayoutExploreError),
    ],
)
def test_bad_reset_options_are_refused(name: str, options: dict[str, Any], error: type[Exception]) -> None:
    with pytest.raises(error):
        make(name).unwrapped.reset(seed=0, options=options)


@cases
def test_actions_outside_of_the_space_are_refused(name: str, options: dict[str, Any]) -> None:
    env = make(name, **options).unwrapped
    env.reset(seed=0)
    with pytest.raises(ConfigError, match="outside"):
        env.step([2.0, 0.0] if options else 99)


@pytest.mark.parametrize("name", IDS)
def test_reset_options_choose_plan_and_start(name: str) -> None:
    env = make(name).unwrapped
    other = floorplan_from_ascii(ROOMS, resolution=0.5, name="other")
    _, info = env.reset(seed=0, options={"plan": other, "start": (2.0, 1.25, 1.0)})
    assert env.simulation.plan is other and info["plan_index"] == -1
    assert env.simulation.pose == Pose(2.0, 1.25, 1.0)
    _, info = env.reset(seed=0, options={"start": (2.0, 1.25)})
    assert env.simulation.plan is not other and info["plan_index"] == 0
    assert env.simulation.pose == Pose(2.0, 1.25, 0.0)


@pytest.mark.parametrize("name", IDS)
def test_stepping_needs_a_running_episode(name: str) -> None:
    env = make(name, simulation=SimulationConfig(coverage_goal=0.05)).unwrapped
    with pytest.raises(ResetNeeded):
        env.step(0)
    with pytest.raises(ResetNeeded):
        env.simulation  # noqa: B018
    env.reset(seed=0)
    # The first scan has reached the goal: the first step ends the episode and does nothing else.
    *_, terminated, truncated, info = env.step(0)
    assert (terminated, truncated) == (True, False)
    assert (info["scans"], info["distance"]) == (1, 0.0)
    with pytest.raises(ResetNeeded, match="over"):
        env.step(0)


@pytest.mark.parametrize("name", IDS)
def test_noise_stays_within_the_spaces(name: str) -> None:
    lidar = LidarConfig(range_max=5.0, fov=2 * np.pi, beams=180, range_noise_std=0.05, dropout=0.1)
    config = SimulationConfig(sensor=lidar, odometry_noise=OdometryNoise(translation=0.05, rotation=0.02))
    env = make(name, sensor=None, simulation=config)
    assert all(env.observation_space.contains(step[0]) for step in rollout(env, seed=1, steps=25))


def test_frontier_env_is_the_simulation() -> None:
    env = make(FRONTIER).unwrapped
    _, info = env.reset(seed=11)
    simulation = Simulation(env.simulation.plan, SimulationConfig(sensor="indoor"))
    simulation.reset(seed=info["simulation_seed"])
    rng = np.random.default_rng(0)
    while not simulation.done:
        choice = int(rng.integers(len(simulation.decision.frontiers)))
        simulation.step(choice)
        *_, terminated, _, info = env.step(choice)
        assert terminated == simulation.done
    np.testing.assert_array_equal(env.simulation.track, simulation.track)
    np.testing.assert_array_equal(env.simulation.curve, simulation.curve)
    np.testing.assert_array_equal(env.simulation.mapper.grid.cells, simulation.mapper.grid.cells)
    assert STOP_REASONS[info["stop_reason"]] == simulation.stop_reason


def test_motion_env_is_the_simulation() -> None:
    env = make(MOTION).unwrapped
    _, info = env.reset(seed=11)
    simulation = Simulation(env.simulation.plan, SimulationConfig(sensor="indoor"))
    simulation.reset(seed=info["simulation_seed"])
    turn = env.motion.turn
    for action in np.random.default_rng(0).integers(3, size=60):
        simulation.drive(*((0.25, 0.0), (0.0, turn), (0.0, -turn))[action])
        env.step(action)
    np.testing.assert_array_equal(env.simulation.track, simulation.track)
    np.testing.assert_array_equal(env.simulation.mapper.grid.cells, simulation.mapper.grid.cells)


def test_the_mask_is_the_same_in_three_places() -> None:
    env = make(FRONTIER).unwrapped
    for observation, *_, info in rollout(env, seed=1):
        assert observation["action_mask"].dtype == info["action_mask"].dtype == np.int8
        np.testing.assert_array_equal(observation["action_mask"], info["action_mask"])
        assert info["action_mask"][:-1].sum() == min(info["frontier_count"], 64) and info["action_mask"][-1] == 1
    observation, _ = env.reset(seed=2)
    masks = env.action_masks()
    assert masks.dtype == np.bool_
    np.testing.assert_array_equal(masks, observation["action_mask"].astype(bool))
    env.action_space.seed(0)
    assert masks[env.action_space.sample(mask=observation["action_mask"])]


def test_an_invalid_action_moves_nothing_and_costs() -> None:
    env = make(FRONTIER, max_invalid_actions=3, invalid_penalty=0.25).unwrapped
    observation, _ = env.reset(seed=0)
    invalid = int(np.flatnonzero(~env.action_masks())[0])
    for count in (1, 2, 3):
        after, reward, terminated, truncated, info = env.step(invalid)
        np.testing.assert_array_equal(after["global_map"], observation["global_map"])
        assert (info["invalid_actions"], info["scans"], info["decisions"]) == (count, 1, 0)
        assert (terminated, truncated) == (False, count == 3)
        if not truncated:
            assert reward == -0.25
    assert STOP_REASONS[info["stop_reason"]] == "invalid_actions"


def test_the_last_action_stops() -> None:
    env = make(FRONTIER).unwrapped
    _, first = env.reset(seed=0)
    *_, terminated, truncated, info = env.step(64)
    assert (terminated, truncated, STOP_REASONS[info["stop_reason"]]) == (True, False, "agent")
    assert info["coverage"] == first["coverage"]
    assert STOP == -1


@pytest.mark.parametrize("name", IDS)
def test_the_budget_truncates(name: str) -> None:
    options = {"max_steps": 1000} if name == MOTION else {}
    env = make(name, simulation=SimulationConfig(max_distance=2.0), **options).unwrapped
    _, info = env.reset(seed=0)
    over = terminated = truncated = False
    rng = np.random.default_rng(0)
    while not over:
        *_, terminated, truncated, info = env.step(choose(env, info, rng))
        over = terminated or truncated
    assert (terminated, truncated, STOP_REASONS[info["stop_reason"]]) == (False, True, "budget")


def test_turning_on_the_spot_ends_too() -> None:
    env = make(MOTION, max_steps=5).unwrapped
    env.reset(seed=0)
    steps = [env.step(1) for _ in range(5)]
    assert [step[3] for step in steps] == [False] * 4 + [True]
    assert STOP_REASONS[steps[-1][4]["stop_reason"]] == "steps"
    assert MotionConfig().turn == pytest.approx(np.pi / 6)


def test_more_frontiers_than_slots_leaves_out_the_farthest() -> None:
    env = make(FRONTIER, observation=ObservationConfig(max_frontiers=2)).unwrapped
    counts = [info["frontier_count"] for *_, info in rollout(env, seed=0)]
    assert max(counts) > 2
    assert env.action_space.n == 3


def test_plans_are_drawn_from_several_and_from_a_function() -> None:
    plans = [floorplan_from_ascii(ROOMS, resolution=0.5, name=name) for name in "abc"]
    source, rng = PlanSource(plans), np.random.default_rng(0)
    drawn = [source.draw(rng) for _ in range(30)]
    assert {index for index, _ in drawn} == {0, 1, 2}
    assert all(plan is plans[index] for index, plan in drawn)
    assert PlanSource(lambda rng: plans[int(rng.integers(3))]).draw(rng)[1] in plans
    nested = PlanSource([plans[:2], plans[2]])
    assert len({nested.draw(rng)[1].name for _ in range(30)}) == 3


def test_a_plan_file_is_loaded_once_and_again_when_it_changes(tmp_path: Path) -> None:
    path = tmp_path / "rooms.geojson"
    rooms().save(path)
    source, rng = PlanSource(path), np.random.default_rng(0)
    first = source.draw(rng)[1]
    assert source.draw(rng)[1] is first
    os.utime(path, (1, 1))
    assert source.draw(rng)[1] is not first
