"""The environments that a configuration trains in."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

import layoutexplore  # noqa: F401  (registers the environments)
from layoutexplore.agents.rl.hyperparameters import TrainingConfig
from layoutexplore.agents.rl.vector import VectorAdapter
from layoutexplore.envs.observation import ObservationConfig
from layoutexplore.envs.plans import PlanSpec
from layoutexplore.envs.rewards import PathToMarks
from layoutexplore.floorplan import FloorPlan

GENERATED = "generated"
"""The word for plans without end, drawn from the generator's families."""

AREAS = (200.0, 900.0)
"""Least and greatest area of generated plans in square metres, drawn log-uniformly."""


def make_envs(config: TrainingConfig) -> VectorAdapter:
    """The environments of a run, side by side, as stable-baselines3 takes them; an equal share for each sensor."""
    count = len(config.sensors)
    shares = [config.envs // count + (k < config.envs % count) for k in range(count)]
    crews = {"workers": config.workers or None, "backend": "serial" if config.workers == 1 else None}
    return VectorAdapter(
        [
            gymnasium.make_vec(config.environment, share, **environment_arguments(config, sensor), **crews)
            for share, sensor in zip(shares, config.sensors, strict=True)
            if share
        ]
    )


def environment_arguments(config: TrainingConfig, sensor: str) -> dict[str, Any]:
    """Keyword arguments for `gymnasium.make`."""
    arguments: dict[str, Any] = {"plan": plan_source(config.plans), "sensor": sensor}
    if config.chooses_frontiers:
        arguments["predictor"] = config.predictor
        arguments["reward"] = PathToMarks(**config.reward)
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
