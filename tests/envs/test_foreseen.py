"""What environments show of foresight: channels, a vector and a reward; zero where nothing is foreseen."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import layoutexplore.envs  # noqa: F401  (registers the environments)
from layoutexplore.envs.foreseen import FORESIGHT_FEATURES
from layoutexplore.envs.observation import ObservationConfig
from layoutexplore.envs.rewards import REWARDS, Transition, reads_foresight
from layoutexplore.frontiers.decision import Decision
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN
from tests.plans import offices

CONFIG = ObservationConfig(foresight=True)


def made(predictor: str | None, **options: Any) -> gymnasium.Env[Any, Any]:
    options = {"observation": CONFIG, "sensor": "indoor", **options}
    return gymnasium.make("LayoutExplore/Frontier-v0", plan=offices(), predictor=predictor, **options)


def due(env: gymnasium.Env[Any, Any]) -> Decision:
    decision: Decision = env.unwrapped.simulation.decision  # type: ignore[attr-defined]
    return decision


@pytest.mark.parametrize("predictor", ["oracle:horizon=inf", None])
def test_the_checker_of_gymnasium_accepts_it(predictor: str | None) -> None:
    check_env(made(predictor).unwrapped, skip_render_check=True)


def test_channels_show_foreseen_cells_that_are_not_known() -> None:
    env = made("oracle:horizon=inf")
    observation, _ = env.reset(seed=1)
    decision, shown = due(env), observation["local_map"]
    assert shown.shape[0] == len(CONFIG.channels) and CONFIG.channels[-2:] == (
        "foreseen_floor",
        "foreseen_wall",
    )
    foresight = decision.foresight
    assert foresight is not None
    unknown = decision.grid.cells == UNKNOWN
    assert shown[-2].any() and shown[-1].any()
    # The whole map at a cell a pixel or more: a channel is lit exactly where there are such cells.
    for channel, value in ((-2, FREE), (-1, OCCUPIED)):
        assert bool(observation["global_map"][channel].any()) == bool(
            (unknown & (foresight.cells == value)).any()
        )
    confidence, floor, rooms = observation["foresight"]
    assert confidence == 1.0 and rooms >= 1
    assert floor == pytest.approx(foresight.hidden(decision.grid.cells).sum() * 0.01 / 10, rel=1e-4)


def test_without_foresight_all_of_it_is_zero_and_the_rest_as_before() -> None:
    observation, _ = made(None).reset(seed=1)
    plain, _ = made(None, observation=ObservationConfig()).reset(seed=1)
    assert not observation["foresight"].any() and observation["foresight"].shape == (len(FORESIGHT_FEATURES),)
    assert not observation["global_map"][-2:].any() and not observation["local_map"][-2:].any()
    assert "foresight" not in plain
    for name in plain:
        shared = observation[name][:-2] if name.endswith("_map") else observation[name]
        assert np.array_equal(shared, plain[name])


def test_the_channels_do_not_depend_on_those_of_the_layout() -> None:
    bare = ObservationConfig(foresight=True, layout_channels=False)
    with_layout, _ = made("oracle:horizon=inf").reset(seed=1)
    without, _ = made("oracle:horizon=inf", observation=bare).reset(seed=1)
    assert np.array_equal(with_layout["global_map"][-2:], without["global_map"][-2:])
    assert without["global_map"].shape[0] == 6


def test_floor_that_was_foreseen_is_counted_when_it_comes_into_view() -> None:
    steps: list[Transition] = []

    def kept(transition: Transition) -> float:
        steps.append(transition)
        return 0.0

    env = made("oracle:horizon=inf", reward=kept)
    env.reset(seed=1)
    hidden = due(env).foresight.hidden(due(env).grid.cells)  # type: ignore[union-attr]
    env.step(0)
    seen = (hidden & (due(env).grid.cells == FREE)).sum() * 0.01
    assert steps[0].foreseen_area == pytest.approx(seen) and 0 < seen <= steps[0].new_area + 1e-9
    assert REWARDS["foreseen_area"](steps[0]) == pytest.approx(seen / max(steps[0].metres, 1.0))
    steps.clear()
    blind = made(None, reward=kept)
    blind.reset(seed=1)
    blind.step(0)
    assert steps[0].foreseen_area == 0.0 < steps[0].new_area


def test_only_rewards_that_may_read_it_are_given_foresight() -> None:
    assert [name for name, function in REWARDS.items() if reads_foresight(function)] == ["foreseen_area"]
    assert reads_foresight(lambda transition: 0.0)
