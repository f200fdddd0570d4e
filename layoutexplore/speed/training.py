"""Throughput of training: environments, policy and learner together, on plans of 1000 to 2500 square metres.

The policy is asked at every step of the environments and learns from the steps between two updates, as `layoutexplore train` has
it; what each part takes stands in the note. Wall time, once: an update is long enough. The learner keeps to one thread, as
what is measured does everywhere: where others use the processor too, threads that wait for each other cost far more.
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

from layoutexplore.speed.measurement import Row
from layoutexplore.speed.vector import AREAS

_STEPS = 64
"""Steps of every environment between two updates."""

_SETTINGS: tuple[tuple[str, str, bool, str, float], ...] = (
    ("attention", "none", False, "no prediction", 1000.0),
    ("deep-sets", "none", False, "no prediction", 0.0),
    ("attention", "layout", True, "tour, prediction", 150.0),
)
"""Encoder, predictor, whether the tour's features are computed, what to call it, and the goal in decisions a second."""


def training() -> Iterator[Row]:
    """Decisions a second of `maskable-ppo` with the hyper-parameters that ship; nothing without the extra `rl`."""
    if importlib.util.find_spec("sb3_contrib") is None:
        return
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        for encoder, predictor, detour, name, goal in _SETTINGS:
            yield _row(encoder, predictor, detour, name, goal)
    finally:
        torch.set_num_threads(threads)


def _row(encoder: str, predictor: str, detour: bool, name: str, goal: float) -> Row:
    stepping, learning, total, decisions = _learn(encoder, predictor, detour)
    shares = {"environments": stepping, "learner": learning, "policy and rest": total - stepping - learning}
    rate = decisions / total
    return Row(
        name=f"training, {name}, {encoder}",
        ours=rate,
        unit="decisions/s",
        goal=f">= {goal:.0f} on 2 cores" if goal else "",
        reached=rate / goal if goal else None,
        note=", ".join(f"{part} {1e3 * seconds / decisions:.2f} ms" for part, seconds in shares.items()),
    )


def _learn(encoder: str, predictor: str, detour: bool) -> tuple[float, float, float, int]:
    """Seconds of the environments' steps, of the updates and in all, and the number of decisions, of one update's learning."""
    from stable_baselines3.common.logger import configure

    from layoutexplore.agents.rl.card import spec_of
    from layoutexplore.agents.rl.environments import make_envs
    from layoutexplore.agents.rl.hyperparameters import read_config
    from layoutexplore.agents.rl.training import build

    config = read_config()
    assert config.network is not None
    config = replace(
        config,
        predictor=predictor,
        network=replace(config.network, encoder=encoder),
        observation={**config.observation, "detour": detour},
        generator={"families": {"office": 1.0}, "area": (AREAS[0], AREAS[-1]), "seeds": 2, "shipped_share": 0.0},
        learning={**config.learning, "n_steps": _STEPS},
    )
    envs = make_envs(config)
    try:
        model = build(config, envs, spec_of(config), "cpu")
        model.set_logger(configure(None, []))
        count = _STEPS * config.envs
        model.learn(count)  # The plans are drawn and everything is compiled.
        stepping, learning = _timed(envs, "step_wait"), _timed(model, "train")
        start = time.perf_counter()
        model.learn(count, reset_num_timesteps=False)
        return stepping(), learning(), time.perf_counter() - start, count
    finally:
        envs.close()


def _timed(owner: Any, name: str) -> Callable[[], float]:
    """Measure a method from now on: a function that tells the seconds spent in it."""
    method, spent = getattr(owner, name), 0.0

    def timed(*arguments: Any, **named: Any) -> Any:
        nonlocal spent
        start = time.perf_counter()
        try:
            return method(*arguments, **named)
        finally:
            spent += time.perf_counter() - start

    setattr(owner, name, timed)
    return lambda: spent
