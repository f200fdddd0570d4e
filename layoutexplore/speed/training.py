"""Throughput of training: environments, policy and learner together, on plans of 1000 to 2500 square metres.

What runs is what `layoutexplore train` runs, with the hyper-parameters that ship: from new episodes on, over
a few rollouts, each learnt from in full, the last one too. Wall time, once: it takes long enough.
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from layoutexplore.speed.measurement import SpeedRow
from layoutexplore.speed.vector import AREAS

_ROLLOUTS = 8
"""So many that every environment comes to the end of an episode."""

_SETTINGS: tuple[tuple[str, str, bool, float], ...] = (
    ("no tour, no prediction", "none", False, 1000.0),
    ("tour, prediction", "layout", True, 150.0),
)
"""What to call it, predictor, whether the tour's features are computed, and the goal in decisions a second."""


def training() -> Iterator[SpeedRow]:
    """Decisions a second of `maskable-ppo`; nothing without the extra `rl`."""
    if importlib.util.find_spec("sb3_contrib") is None:
        return
    for name, predictor, detour, goal in _SETTINGS:
        yield _row(name, predictor, detour, goal)


def _row(name: str, predictor: str, detour: bool, goal: float) -> SpeedRow:
    from layoutexplore.agents.rl.hyperparameters import read_config

    config = read_config()
    config = replace(
        config,
        predictor=predictor,
        observation={**config.observation, "detour": detour},
        generator={
            "families": {"office": 1.0},
            "area": (AREAS[0], AREAS[-1]),
            "seeds": 4,
            "shipped_share": 0.0,
        },
    )
    decisions = _ROLLOUTS * config.envs * config.learning["n_steps"]
    total, waiting, learning = _learn(config, decisions)
    rate = decisions / total
    shares = {
        "environments": waiting,
        "acting and rest": total - waiting,
        "beside them the learner": learning,
    }
    assert config.network is not None
    return SpeedRow(
        name=f"training, {name}, {config.network.encoder}",
        ours=rate,
        unit="decisions/s",
        goal=f">= {goal:.0f} on 2 cores",
        reached=rate / goal,
        note=", ".join(f"{part} {1e3 * seconds / decisions:.2f} ms" for part, seconds in shares.items()),
    )


def _learn(config: Any, decisions: int) -> tuple[float, float, float]:
    """Seconds in all, those spent waiting for environments, and those of the updates, of so many decisions."""
    from stable_baselines3.common.logger import configure

    from layoutexplore.agents.rl.card import spec_of
    from layoutexplore.agents.rl.environments import make_envs
    from layoutexplore.agents.rl.ppo import FrontierPPO
    from layoutexplore.agents.rl.training import build

    envs = make_envs(config)
    try:
        model = build(config, envs, spec_of(config), "cpu")
        assert isinstance(model, FrontierPPO)
        model.set_logger(configure(None, []))
        model.learn(
            config.envs * config.learning["n_steps"]
        )  # The plans are drawn and everything is compiled.
        model.set_random_seed(0)
        model._last_obs, model.learning_seconds, envs.waiting_seconds = None, 0.0, 0.0
        start = time.perf_counter()
        model.learn(decisions, reset_num_timesteps=False)
        return time.perf_counter() - start, envs.waiting_seconds, model.learning_seconds
    finally:
        envs.close()
