"""Episodes: arguments, options, actions, ends, and that an environment is nothing but the simulation."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded

from layoutexplore import STOP, Pose, Simulation, SimulationConfig
from layoutexplore.agents import make_agent
from layoutexplore.envs.base import STOP_REASONS
from layoutexplore.envs.motion import MotionConfig
from layoutexplore.envs.observation import ObservationConfig, encode_frontiers
from layoutexplore.envs.plans import PlanSource
from layoutexplore.errors import ConfigError, LayoutExploreError, StartError, UnknownNameError
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.predictors import make_predictor
from layoutexplore.sensing.lidar import LidarConfig, sensor
from layoutexplore.simulation.episode import play
from layoutexplore.simulation.robot import OdometryNoise
from tests.envs.cases import FRONTIER, IDS, MOTION, cases, choose, make, rollout, rooms
from tests.plans import SIX_ROOMS


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
        ({"plan": 3}, ConfigError),
        ({"render_mode": "rgb_array", "render_size": (0, 720)}, ConfigError),
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


def test_a_plan_that_is_none_is_told_by_the_option() -> None:
    with pytest.raises(
        ConfigError, match=r'options\["plan"\] must be a FloorPlan or a str or a PathLike, got 3'
    ):
        make(IDS[0]).unwrapped.reset(options={"plan": 3})


@cases
def test_actions_outside_of_the_space_are_refused(name: str, options: dict[str, Any]) -> None:
    env = make(name, **options).unwrapped
    env.reset(seed=0)
    with pytest.raises(ConfigError, match="outside"):
        env.step([2.0, 0.0] if options else 99)


@pytest.mark.parametrize("action", [1.5, "1", None, [0, 1]])
def test_a_frontier_is_chosen_by_a_whole_number(action: Any) -> None:
    env = make(FRONTIER).unwrapped
    env.reset(seed=0)
    with pytest.raises(ConfigError, match="whole number"):
        env.step(action)


@pytest.mark.parametrize("name", IDS)
def test_reset_options_choose_plan_and_start(name: str) -> None:
    env = make(name).unwrapped
    other = floorplan_from_ascii(SIX_ROOMS, resolution=0.5, name="other")
    _, info = env.reset(seed=0, options={"plan": other, "start": (2.0, 1.25, 1.0)})
    assert env.simulation.plan is other and info["plan_index"] == -1
    assert env.simulation.pose == Pose(2.0, 1.25, 1.0)
    _, info = env.reset(seed=0, options={"start": (2.0, 1.25)})
    assert env.simulation.plan is not other and info["plan_index"] == 0
    assert env.simulation.pose == Pose(2.0, 1.25, 0.0)


@pytest.mark.parametrize("name", IDS)
def test_a_reset_that_fails_ends_the_episode(name: str) -> None:
    """It went on, and its info told the seed of the one that did not begin."""
    env = make(name).unwrapped
    env.reset(seed=0)
    env.step(0)
    with pytest.raises(StartError):
        env.reset(options={"start": (99.0, 1.0)})
    with pytest.raises(ResetNeeded, match="over"):
        env.step(0)
    env.reset()
    env.step(0)


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


@pytest.mark.parametrize(
    ("name", "options"),
    [
        (FRONTIER, {"invalid_penalty": float("nan")}),
        (FRONTIER, {"invalid_penalty": -1.0}),
        (FRONTIER, {"max_invalid_actions": 0}),
        (FRONTIER, {"look_every": -0.5}),
        (MOTION, {"max_steps": 0}),
        (MOTION, {"max_steps": 2.5}),
    ],
)
def test_bad_limits_are_refused(name: str, options: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=next(iter(options))):
        make(name, **options)


@pytest.mark.parametrize("name", IDS)
def test_noise_stays_within_the_spaces(name: str) -> None:
    lidar = LidarConfig(range_max=5.0, fov=2 * np.pi, beams=180, range_noise_std=0.05, dropout=0.1)
    config = SimulationConfig(sensor=lidar, odometry_noise=OdometryNoise(translation=0.05, rotation=0.02))
    env = make(name, sensor=None, simulation=config)
    assert all(env.observation_space.contains(step[0]) for step in rollout(env, seed=1, steps=25))


def noisy(std: float = 0.0, drift: float = 0.0) -> SimulationConfig:
    """A simulation of the indoor sensor with noisy readings or drifting odometry."""
    return SimulationConfig(
        sensor=replace(sensor("indoor"), range_noise_std=std),
        odometry_noise=OdometryNoise(translation=drift, rotation=drift),
    )


@pytest.mark.parametrize(
    "config", [noisy(), noisy(std=0.02), noisy(drift=0.02)], ids=["exact", "noise", "drift"]
)
@pytest.mark.parametrize("agent", ["nearest", "latency-tour", None])
def test_frontier_env_is_the_simulation(agent: str | None, config: SimulationConfig) -> None:
    """An agent's choices in a simulation drive an environment along the same trajectory."""
    env = make(FRONTIER, sensor=None, simulation=config).unwrapped
    _, info = env.reset(seed=11)
    simulation = Simulation(env.simulation.plan, config)
    decision = simulation.reset(seed=info["simulation_seed"])
    chooser, rng = make_agent(agent) if agent else None, np.random.default_rng(0)
    if chooser:
        chooser.reset(0)
    while not simulation.done:
        choice = chooser.act(decision) if chooser else int(rng.integers(len(decision.frontiers)))
        decision = simulation.step(choice)
        observation, _, terminated, _, info = env.step(choice)
        assert terminated == simulation.done and info["distance"] == simulation.distance
        expected = encode_frontiers(decision, ObservationConfig())
        np.testing.assert_array_equal(observation["frontiers"], expected)
    for name in ("track", "curve", "seen"):
        np.testing.assert_array_equal(getattr(env.simulation, name), getattr(simulation, name))
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
        assert (
            info["action_mask"][:-1].sum() == min(info["frontier_count"], 64) and info["action_mask"][-1] == 1
        )
    observation, _ = env.reset(seed=2)
    masks = env.action_masks()
    assert masks.dtype == np.bool_
    np.testing.assert_array_equal(masks, observation["action_mask"].astype(bool))
    env.action_space.seed(0)
    assert masks[env.action_space.sample(mask=observation["action_mask"])]


def test_stopping_early_can_be_ruled_out() -> None:
    env = make(FRONTIER, observation=ObservationConfig(early_stop=False)).unwrapped
    observation, info = env.reset(seed=1)
    stop, distance = len(info["action_mask"]) - 1, info["distance"]
    assert info["frontier_count"] and not observation["action_mask"][stop]
    *_, terminated, truncated, info = env.step(stop)
    assert not (terminated or truncated) and (info["invalid_actions"], info["distance"]) == (1, distance)
    while not (terminated or truncated):
        assert info["action_mask"][stop] == (info["frontier_count"] == 0)
        *_, terminated, truncated, info = env.step(0)
    assert STOP_REASONS[info["stop_reason"]] in ("coverage", "no_frontier")


def test_looking_around_is_choosing_as_a_policy_that_does() -> None:
    agent = make_agent("policy")
    options = {"plan": "apartment-01", "sensor": "stage", "predictor": "layout"}
    env = make(FRONTIER, look_every=0.5, **options).unwrapped
    for seed in (0, 1):
        _, info = env.reset(seed=seed)
        over, steps = False, 0
        while not over:
            *_, terminated, truncated, info = env.step(np.argmax(agent.logits(env.simulation.decision)))
            over, steps = terminated or truncated, steps + 1
        alone = Simulation(env.simulation.plan, SimulationConfig(sensor="stage"), make_predictor("layout"))
        curve = play(alone, agent, seed=info["simulation_seed"]).curve
        np.testing.assert_array_equal(curve[:, :2], env.simulation.curve[:, :2])
        assert steps < info["decisions"], "without news the robot goes on"


def test_an_episode_tells_its_plan() -> None:
    env = make(FRONTIER).unwrapped
    with pytest.raises(ResetNeeded):
        _ = env.plan_name
    env.reset(seed=1)
    assert env.plan_name == env.simulation.plan.name != ""


@pytest.mark.parametrize("returned", [None, "much", [1.0, 2.0], float("nan")])
def test_a_reward_that_is_no_number_is_named(returned: Any) -> None:
    env = make(FRONTIER, reward=lambda transition: returned).unwrapped
    env.reset(seed=1)
    with pytest.raises(ConfigError, match="a reward function returns a number, got"):
        env.step(0)


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
    plans = [floorplan_from_ascii(SIX_ROOMS, resolution=0.5, name=name) for name in "abc"]
    source, rng = PlanSource(plans), np.random.default_rng(0)
    drawn = [source.draw(rng) for _ in range(30)]
    assert {index for index, _ in drawn} == {0, 1, 2}
    assert all(plan is plans[index] for index, plan in drawn)
    assert PlanSource(lambda rng: plans[int(rng.integers(3))]).draw(rng)[1] in plans
    nested = PlanSource([plans[:2], plans[2]])
    assert len({nested.draw(rng)[1].name for _ in range(30)}) == 3


def test_a_plan_file_is_loaded_once_and_again_when_it_changes(tmp_path: Path) -> None:
    path = tmp_path / "rooms.geojson"
    save_plan(rooms(), path)
    source, rng = PlanSource(path), np.random.default_rng(0)
    first = source.draw(rng)[1]
    assert source.draw(rng)[1] is first
    os.utime(path, (1, 1))
    assert source.draw(rng)[1] is not first
