"""Throughput of training: environments, policy and learner together, on plans of 1000 to 2500 square metres.

What runs is what `layoutexplore train --algorithm maskable-ppo` runs, with hyper-parameters as shipped: from
new episodes on, over a few rollouts, each learnt from in full, the last one too; beside it sb3-contrib's
learner, with the same networks on the same environments. Wall time, once: it takes long enough.
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

from layoutexplore.processes import usable_cores
from layoutexplore.speed.measurement import SpeedRow
from layoutexplore.speed.vector import AREAS, CORES

if TYPE_CHECKING:
    from sb3_contrib import MaskablePPO

    from layoutexplore.agents.rl.hyperparameters import TrainingConfig
    from layoutexplore.agents.rl.vector import VectorAdapter

_ROLLOUTS = 8
"""So many that every environment comes to the end of an episode: decisions cost more as maps grow."""

_SETTINGS: tuple[tuple[str, str, bool, float], ...] = (
    ("no tour, no prediction", "none", False, 1000.0),
    ("tour, prediction", "layout", True, 150.0),
)
"""Name, predictor, whether the tour's features are computed, and the goal in decisions a second."""


class Spent(NamedTuple):
    """Seconds in all, waiting for environments, and in the updates, of so many decisions."""

    decisions: int
    total: float
    waiting: float
    learning: float


def training() -> Iterator[SpeedRow]:
    """Decisions a second of `maskable-ppo` and of sb3-contrib's learner; nothing without the extra `rl`."""
    if importlib.util.find_spec("sb3_contrib") is None:
        return
    for name, predictor, detour, goal in _SETTINGS:
        yield _row(name, predictor, detour, goal)


def throughput_config(predictor: str, *, detour: bool) -> TrainingConfig:
    """What is trained: the hyper-parameters as shipped, on four large offices.

    Args:
        predictor: Asked at every decision.
        detour: Whether the features of a tour are computed.
    """
    from layoutexplore.agents.rl.hyperparameters import read_config

    plans = {"families": {"office": 1.0}, "area": [AREAS[0], AREAS[-1]], "seeds": 4, "shipped_share": 0.0}
    changed = {"predictor": predictor, "observation": {"detour": detour}, "generator": plans}
    return read_config(None, {"algorithm": "maskable-ppo", **changed})


def _row(name: str, predictor: str, detour: bool, goal: float) -> SpeedRow:
    config = throughput_config(predictor, detour=detour)
    ours, stock = _learn(config), _learn(config, stock=True)
    rate, reference = (spent.decisions / spent.total for spent in (ours, stock))
    shares = {
        "environments": ours.waiting,
        "acting and rest": ours.total - ours.waiting,
        "beside them the learner": ours.learning,
    }
    assert config.network is not None
    return SpeedRow(
        name=f"training, {name}, {config.network.encoder}",
        ours=rate,
        unit="decisions/s",
        reference=reference,
        reference_name="sb3-contrib MaskablePPO",
        goal=f">= {goal:.0f} on {CORES} cores",
        reached=rate / goal if usable_cores() >= CORES else None,
        note=", ".join(f"{part} {1e3 * spent / ours.decisions:.2f} ms" for part, spent in shares.items()),
    )


def _learn(config: TrainingConfig, *, stock: bool = False) -> Spent:
    """What the rollouts take, after one in which the plans are drawn and everything is compiled."""
    from stable_baselines3.common.logger import configure

    from layoutexplore.agents.rl.environments import make_envs

    envs = make_envs(config)
    try:
        model = _stock_learner(config, envs) if stock else _our_learner(config, envs)
        model.set_logger(configure(None, []))
        rollout = config.envs * config.learning["n_steps"]
        model.learn(rollout)
        model.set_random_seed(0)
        model._last_obs, envs.waiting_seconds = None, 0.0
        learnt = getattr(model, "learning_seconds", 0.0)
        start = time.perf_counter()
        model.learn(_ROLLOUTS * rollout, reset_num_timesteps=False)
        total = time.perf_counter() - start
        learning = getattr(model, "learning_seconds", 0.0) - learnt
        return Spent(_ROLLOUTS * rollout, total, envs.waiting_seconds, learning)
    finally:
        envs.close()


def _our_learner(config: TrainingConfig, envs: VectorAdapter) -> MaskablePPO:
    from layoutexplore.agents.rl.card import spec_of
    from layoutexplore.agents.rl.ppo.algorithm import FrontierPPO
    from layoutexplore.agents.rl.training import build

    model = build(config, envs, spec_of(config), "cpu")
    assert isinstance(model, FrontierPPO)
    return model


def _stock_learner(config: TrainingConfig, envs: VectorAdapter) -> MaskablePPO:
    from sb3_contrib import MaskablePPO

    from layoutexplore.agents.rl.card import spec_of
    from layoutexplore.agents.rl.maskable_policy import FrontierPolicy

    networks = {"spec": spec_of(config)}
    return MaskablePPO(FrontierPolicy, envs, policy_kwargs=networks, device="cpu", seed=0, **config.learning)
