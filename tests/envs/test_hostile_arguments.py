"""Arguments that make no sense end in an error of ours that names them: quickly, and never in a hang."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded

import layoutexplore
from layoutexplore.agents import make_agent
from layoutexplore.envs.curriculum import PlanSampler, Randomisation
from layoutexplore.envs.frontier import FrontierEnv
from layoutexplore.envs.motion import MotionConfig
from layoutexplore.envs.observation import ObservationConfig
from layoutexplore.errors import ConfigError, LayoutExploreError, UnknownNameError, shortened
from layoutexplore.maps import expand_plans
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.predictors import make_predictor
from layoutexplore.sensing.lidar import LidarConfig
from layoutexplore.simulation.config import SimulationConfig
from tests.envs.cases import FRONTIER, MOTION, make, rooms


class Shy:
    """An object that cannot show itself."""

    def __repr__(self) -> str:
        raise RuntimeError


HOSTILE: tuple[Any, ...] = (
    None, True, 3.7, -1, 10**400, math.nan, math.inf, -math.inf, -1e300, 1e300, "", "nonsense", b"x", 1j,
    [], {}, (), [None], ["nonsense"], {"a": 1}, (1, 2, 3, 4, 5), np.zeros(3), np.array(["x"]), object(), int,
    Shy(), [Shy()], range(10**12),
)  # fmt: skip
CONFIGS: dict[type, dict[str, Any]] = {
    SimulationConfig: {},
    ObservationConfig: {},
    MotionConfig: {},
    PlanSampler: {},
    Randomisation: {},
    LidarConfig: {"range_max": 8.0, "fov": 3.0, "beams": 90},
}


def fields() -> list[tuple[type, str]]:
    return [(kind, field.name) for kind in CONFIGS for field in dataclasses.fields(kind)]


@pytest.mark.parametrize(("kind", "name"), fields(), ids=lambda value: getattr(value, "__name__", value))
def test_options_take_what_they_can_use_and_refuse_the_rest(kind: type, name: str) -> None:
    good = getattr(kind(**CONFIGS[kind]), name)
    number = isinstance(good, (int, float)) and not isinstance(good, bool)
    refused = 0
    for value in HOSTILE:
        try:
            kept = getattr(kind(**{**CONFIGS[kind], name: value}), name)
        except LayoutExploreError:
            refused += 1
            continue
        if number:
            assert kept is None or (math.isfinite(kept) and abs(kept) <= 1e7), (name, value)
    assert refused >= 10


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        (SimulationConfig, {"gain_rays": 100_000}),
        (SimulationConfig, {"scan_spacing": 1e-9}),
        (SimulationConfig, {"resolution": 1e-3}),
        (SimulationConfig, {"robot_radius": 1e6}),
        (ObservationConfig, {"local_span": 1e6}),
        (ObservationConfig, {"local_size": 10**6}),
        (ObservationConfig, {"global_size": 10**6}),
        (ObservationConfig, {"max_frontiers": 10**9}),
        (ObservationConfig, {"local_map": 1}),
        (MotionConfig, {"local_span": 1e6}),
        (MotionConfig, {"scan_beams": 10**9}),
        (MotionConfig, {"forward": 1e-12}),
    ],
)
def test_what_would_take_for_ever_has_a_bound(kind: Callable[..., Any], options: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=next(iter(options))):
        kind(**options)


def test_no_vector_and_no_range_of_plans_is_endless() -> None:
    with pytest.raises(ConfigError, match="num_envs must be a whole number from 1 to"):
        gymnasium.make_vec(FRONTIER, num_envs=10**6, plan=rooms(), sensor="indoor")
    with pytest.raises(LayoutExploreError, match="at most"):
        expand_plans("office:1-9999999999")


def endless() -> Iterator[FloorPlan]:
    while True:
        yield rooms()


@pytest.mark.parametrize(
    ("plans", "message"),
    [
        (range(10**9), "a plan is a FloorPlan"),
        (endless(), "plan is a generator"),
        ([], "no floor plan to explore"),
        ([rooms(), 3], "a plan is a FloorPlan"),
        (["apartment-01"] * 300_000, "more than 200000 floor plans"),
        ({"apartment-01", "apartment-02"}, "plan is a set"),
        (rooms, "called with a random generator alone"),
        (FloorPlan, "called with a random generator alone"),
        (PlanSampler, "called with a generator and a progress"),
    ],
)
@pytest.mark.parametrize("name", [FRONTIER, MOTION])
def test_what_is_no_sequence_of_plans_is_told_at_once(name: str, plans: Any, message: str) -> None:
    for make_one in (gymnasium.make, partial(gymnasium.make_vec, num_envs=2, backend="serial")):
        with pytest.raises(ConfigError, match=message):
            make_one(name, plan=plans)


@pytest.mark.parametrize("workers", [0, -1, 10**6, 1.5, True])
def test_numbers_of_workers_that_make_no_sense(workers: Any) -> None:
    with pytest.raises(ConfigError, match="workers must be a whole number from 1 to 1024"):
        gymnasium.make_vec(FRONTIER, num_envs=2, plan=rooms(), workers=workers)


@pytest.mark.parametrize(
    ("name", "option", "closest"),
    [
        (FRONTIER, "senosr", "sensor"),
        (FRONTIER, "observations", "observation"),
        (MOTION, "max_step", "max_steps"),
    ],
)
def test_unknown_options_are_told_with_the_closest_ones(name: str, option: str, closest: str) -> None:
    with pytest.raises(UnknownNameError, match=f"{option}': did you mean '{closest}'"):
        gymnasium.make(name, plan=rooms(), **{option: 1})
    with pytest.raises(UnknownNameError, match=f"{option}': did you mean '{closest}'"):
        gymnasium.make_vec(name, num_envs=2, plan=rooms(), **{option: 1})
    with pytest.raises(UnknownNameError, match="worker': did you mean 'workers'"):
        gymnasium.make_vec(name, num_envs=2, plan=rooms(), worker=1)


def test_options_of_gymnasium_and_of_a_class_of_ones_own_are_none_of_ours() -> None:
    class Mine(FrontierEnv):
        def __init__(self, *, colour: str, **options: Any) -> None:
            super().__init__(**options)
            self.colour = colour

    assert Mine(colour="red", plan=rooms()).colour == "red"
    env = gymnasium.make(MOTION, plan=rooms(), max_episode_steps=2, disable_env_checker=True)
    assert env.spec is not None and env.spec.max_episode_steps == 2
    for mode in ("sync", "vector_entry_point"):
        gymnasium.make_vec(FRONTIER, 2, mode, plan=rooms()).close()


def test_masks_before_reset_say_what_is_missing() -> None:
    with pytest.raises(ResetNeeded, match="reset"):
        make(FRONTIER).unwrapped.action_masks()  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", [FRONTIER, MOTION])
def test_only_whole_numbers_are_discrete_actions(name: str) -> None:
    env = make(name)
    env.reset(seed=0)
    fractions, flags = (0.5, 1.0, math.nan, np.float32(1)), (True, np.True_, np.array(True))
    for action in (*fractions, *flags, "0", None, [0], np.array([0, 1]), -1, 10**6):
        with pytest.raises(ConfigError, match="action"):
            env.unwrapped.step(action)
    for action in (0, np.int64(0), np.uint8(0), np.array(0)):
        env.unwrapped.step(action)


def test_only_two_numbers_are_continuous_actions() -> None:
    env = make(MOTION, actions="continuous").unwrapped
    env.reset(seed=0)
    for action in (
        0.5, None, "ab", (0.1,), (0.1, 0.2, 0.3), (math.nan, 0.0), (0.0, math.inf), ("a", "b"), (True, False),
        np.zeros((1, 2)), (2.0, 0.0), [None, None],
    ):  # fmt: skip
        with pytest.raises(ConfigError, match="action"):
            env.step(action)
    for action in ((0, 0), [0.5, -0.5], np.zeros(2, np.float32)):
        env.step(action)


def calls(folder: Path) -> dict[str, Callable[[Any], Any]]:
    """Calls with one argument that makes no sense, by name."""
    plan, grid = rooms(), rooms().rasterize(0.5).grid

    def env(name: str) -> Callable[[Any], Any]:
        return lambda value: gymnasium.make(FRONTIER, **({"plan": plan, "sensor": "indoor"} | {name: value}))

    def motion(name: str) -> Callable[[Any], Any]:
        return lambda value: gymnasium.make(MOTION, **({"plan": plan, "sensor": "indoor"} | {name: value}))

    def run(**options: Any) -> Any:
        return layoutexplore.Simulation(plan, SimulationConfig(sensor="indoor")).reset(**options)

    made = make(FRONTIER)
    vector = gymnasium.make_vec(FRONTIER, num_envs=2, plan=plan, sensor="indoor", backend="serial")
    vector.reset(seed=0)

    def optioned(key: str) -> Callable[[Any], Any]:
        return lambda value: made.reset(options={key: value})

    names = "plan", "sensor", "simulation", "randomisation", "predictor", "reward", "observation"
    more = "invalid_penalty", "max_invalid_actions", "render_size", "resolution", "robot_radius"
    return {
        **{f"Frontier {name}": env(name) for name in (*names, *more)},
        **{f"Motion {name}": motion(name) for name in ("plan", "actions", "reward", "motion", "max_steps")},
        "FrontierEnv render_mode": lambda value: FrontierEnv(plan, render_mode=value),
        "Simulation plan": layoutexplore.Simulation,
        "Simulation config": lambda value: layoutexplore.Simulation(plan, value),
        "Simulation predictor": lambda value: layoutexplore.Simulation(plan, None, value),
        "environment seed": lambda value: made.reset(seed=value),
        "environment options": lambda value: made.reset(options=value),
        **{f"environment {key}": optioned(key) for key in ("plan", "start", "strat")},
        "vector seed": lambda value: vector.reset(seed=value),
        "vector seeds": lambda value: vector.reset(seed=[value, 1]),
        "vector options": lambda value: vector.reset(options=value),
        "vector mask": lambda value: vector.reset(options={"reset_mask": value}),
        "vector actions": vector.step,
        "vector action": lambda value: vector.step([value, 0]),
        "reset seed": lambda value: run(seed=value),
        "reset start": lambda value: run(start=value),
        "make_agent": make_agent,
        "make_predictor": make_predictor,
        "load_plan": layoutexplore.load_plan,
        "expand_plans": expand_plans,
        "load_grid": layoutexplore.load_grid,
        "load_simulation": layoutexplore.load_simulation,
        "save_grid grid": lambda value: layoutexplore.save_grid(value, folder / "map.yaml"),
        "save_grid mode": lambda value: layoutexplore.save_grid(grid, folder / "map.yaml", mode=value),
        "save_plan plan": lambda value: layoutexplore.save_plan(value, folder / "plan.geojson"),
        "reconstruct grid": layoutexplore.reconstruct,
        "reconstruct method": lambda value: layoutexplore.reconstruct(grid, value),
        "draw_layout": layoutexplore.draw_layout,
        "layout_to_geojson": layoutexplore.layout_to_geojson,
        "SimulationConfig sensor": lambda value: SimulationConfig(sensor=value),
        "SimulationConfig noise": lambda value: SimulationConfig(odometry_noise=value),
    }


def attempt(call: Callable[[Any], Any], value: Any) -> str:
    """What came of a call, if it is no error of ours."""
    try:
        call(value)
    except (LayoutExploreError, gymnasium.error.Error):
        return ""
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return ""


@pytest.mark.parametrize("name", calls(Path()))
def test_wrong_arguments_end_in_an_error_of_ours(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    call = calls(tmp_path)[name]
    assert not {shortened(value)[:30]: said for value in HOSTILE if (said := attempt(call, value))}


def test_two_thousand_wrong_calls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same with nested values: lists, tables and arrays of what makes no sense."""
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(0)
    known = list(calls(tmp_path).items())

    def value(depth: int) -> Any:
        kind = rng.integers(0, 8 if depth else 5)
        if kind < 5:
            return HOSTILE[rng.integers(len(HOSTILE))]
        inside = [value(depth - 1) for _ in range(rng.integers(0, 4))]
        return (inside, tuple(inside), {str(k): v for k, v in enumerate(inside)})[kind - 5]

    failures = {}
    for _ in range(2000):
        name, call = known[rng.integers(len(known))]
        given = value(2)
        if said := attempt(call, given):
            failures[name, shortened(given)[:60]] = said
    assert not failures
