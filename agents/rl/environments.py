"""The environments that a configuration trains in."""

from __future__ import annotations

from functools import partial
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import layoutexplore  # noqa: F401  (registers the environments)
from layoutexplore.agents.rl.hyperparameters import TrainingConfig
from layoutexplore.agents.rl.rewards import MetresToGo
from layoutexplore.agents.rl.vector import VectorAdapter
from layoutexplore.envs.observation import ObservationConfig
from layoutexplore.envs.plans import PlanSpec
from layoutexplore.floorplan import FloorPlan
from layoutexplore.predictors import make_predictor

GENERATED = "generated"
"""The word for plans without end, drawn from the generator's families."""

AREAS = (150.0, 900.0)
"""Least and greatest area of generated plans in square metres, drawn log-uniformly."""


def make_envs(config: TrainingConfig) -> VectorAdapter:
    """The environments of a run, side by side, as stable-baselines3 takes them."""

    def one(sensor: str) -> gymnasium.Env[Any, Any]:
        return gymnasium.make(config.environment, **environment_arguments(config, sensor))

    sensors = [config.sensors[k % len(config.sensors)] for k in range(config.envs)]
    return VectorAdapter(SyncVectorEnv([partial(one, s) for s in sensors], autoreset_mode=AutoresetMode.SAME_STEP))


def environment_arguments(config: TrainingConfig, sensor: str) -> dict[str, Any]:
    """Keyword arguments for `gymnasium.make`."""
    arguments: dict[str, Any] = {"plan": plan_source(config.plans), "sensor": sensor}
    if config.chooses_frontiers:
        arguments["predictor"] = make_predictor(config.predictor)
        arguments["reward"] = MetresToGo(**config.reward)
        arguments["observation"] = ObservationConfig(local_map=False, **config.observation)
    elif config.max_steps:
        arguments["max_steps"] = config.max_steps
    return arguments


def plan_source(plans: tuple[str, ...]) -> PlanSpec:
    """What the environments draw their floor plans from."""
    return _generated if plans == (GENERATED,) else plans


def _generated(rng: np.random.Generator) -> FloorPlan:
    from layoutexplore.maps.generator import FAMILIES, generate

    family = str(rng.choice(sorted(FAMILIES)))
    return generate(family, int(rng.integers(1 << 40, 1 << 41)), area=float(np.exp(rng.uniform(*np.log(AREAS)))))
