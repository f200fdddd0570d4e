"""Reward functions: what they pay for, and that they are found by name."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from layoutexplore.envs.rewards import REWARDS, Transition, area, area_per_metre, coverage, path_length, reward
from layoutexplore.errors import ConfigError, UnknownNameError
from layoutexplore.floorplan import floorplan_from_ascii

STEP = Transition(metres=4.0, new_area=6.0, coverage=0.5, coverage_gain=0.1, distance=40.0, budget=200.0)


def total(distance: float, stop_reason: str, coverage: float, budget: float = 200.0, steps: int = 10) -> float:
    """The return of `path_length` for an episode of equal steps."""
    metres = distance / steps
    walked = [
        Transition(metres, 1.0, coverage, 0.01, metres * (k + 1), budget, stop_reason if k == steps - 1 else "")
        for k in range(steps)
    ]
    return sum(path_length(step) for step in walked)


def test_names_and_callables_are_found() -> None:
    assert reward("area") is area
    assert set(REWARDS) == {"path_length", "area", "area_per_metre", "coverage"}

    def mine(transition: Transition) -> float:
        return transition.metres

    assert reward(mine) is mine


def test_an_unknown_name_suggests_the_closest() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'path_length'"):
        reward("path_lenght")
    with pytest.raises(ConfigError, match="callable"):
        reward(1)  # type: ignore[arg-type]


def test_the_simple_ones() -> None:
    assert area(STEP) == 6.0
    assert area_per_metre(STEP) == 1.5
    assert area_per_metre(STEP._replace(metres=0.0)) == 6.0
    assert coverage(STEP) == pytest.approx(10.0)


@given(st.floats(1, 200), st.floats(1, 200))
def test_the_shorter_complete_exploration_earns_more(first: float, second: float) -> None:
    if first < second - 1e-6:
        assert total(first, "coverage", 0.99) > total(second, "coverage", 0.99)
    assert total(first, "coverage", 0.99) == pytest.approx(total(first, "coverage", 0.99, steps=3))


@given(st.floats(0, 100), st.floats(0, 99), st.floats(0, 0.98))
def test_finishing_within_half_of_the_budget_beats_stopping(stopped: float, rest: float, seen: float) -> None:
    assert total(stopped + rest, "coverage", 0.99) > total(stopped, "agent", seen)


def test_giving_up_at_once_earns_less_than_seeing_more() -> None:
    assert total(0.0, "agent", 0.1) < total(20.0, "agent", 0.5)


@pytest.mark.parametrize("name", ["LayoutExplore/Frontier-v0", "LayoutExplore/Motion-v0"])
def test_an_environment_hands_over_what_happened(name: str) -> None:
    plan = floorplan_from_ascii("##########\n#aaaa#bbb#\n#aaaa.bbb#\n#aaaa#bbb#\n##########", resolution=1.0)
    seen: list[Transition] = []

    def spy(transition: Transition) -> float:
        seen.append(transition)
        return float(len(seen))

    env = gymnasium.make(name, plan=plan, sensor="short", reward=spy, max_episode_steps=300)
    _, first = env.reset(seed=1)
    info, over, terminated = first, False, False
    rewards = []
    while not over:
        rng = np.random.default_rng(len(seen))
        action = 0 if "action_mask" in info else int(rng.choice([0, 0, 1]))
        _, value, terminated, truncated, info = env.step(action)
        rewards.append(value)
        over = terminated or truncated
    assert rewards == [float(k + 1) for k in range(len(seen))]
    assert sum(step.metres for step in seen) == pytest.approx(info["distance"])
    assert sum(step.new_area for step in seen) == pytest.approx(info["known_area"] - first["known_area"])
    assert sum(step.coverage_gain for step in seen) == pytest.approx(info["coverage"] - first["coverage"])
    assert all(step.stop_reason == "" for step in seen[:-1])
    assert seen[-1].stop_reason == ("coverage" if terminated else "")
