"""The environments that a configuration trains in."""

from __future__ import annotations

from typing import Any

import gymnasium

import layoutexplore  # noqa: F401  (registers the environments)
from layoutexplore.agents.rl.hyperparameters import TrainingConfig
from layoutexplore.agents.rl.vector import VectorAdapter
from layoutexplore.envs.curriculum import PlanSampler, Randomisation
from layoutexplore.envs.observation import ObservationConfig
from layoutexplore.envs.plans import PlanSpec
from layoutexplore.envs.rewards import PathToMarks
from layoutexplore.errors import ConfigError, checks_arguments, shortened
from layoutexplore.files import is_there
from layoutexplore.maps.formats.building_files import split_level
from layoutexplore.maps.library import find_plans, load_plan
from layoutexplore.options import from_table

GENERATED = "generated"
"""The word for plans without end, drawn by a `PlanSampler`."""


@checks_arguments
def make_envs(config: TrainingConfig) -> VectorAdapter:
    """The environments of a run, side by side, as stable-baselines3 takes them."""
    arguments = environment_arguments(config)
    arguments["backend"] = "serial" if config.workers == 1 else None
    return VectorAdapter(
        gymnasium.make_vec(config.environment, config.envs, workers=config.workers or None, **arguments)
    )


def environment_arguments(config: TrainingConfig) -> dict[str, Any]:
    """Keyword arguments of one environment."""
    arguments: dict[str, Any] = {
        "plan": plan_source(config),
        "randomisation": Randomisation(sensors=config.sensors),
    }
    if config.chooses_frontiers:
        arguments["predictor"] = config.predictor
        arguments["look_every"] = config.look_every
        arguments["reward"] = PathToMarks(**config.reward)
        arguments["observation"] = ObservationConfig(local_map=False, tour=config.tour, **config.observation)
    elif config.max_steps:
        arguments["max_steps"] = config.max_steps
    return arguments


def plan_source(config: TrainingConfig) -> PlanSpec:
    """What the environments draw their floor plans from."""
    return (
        from_table(PlanSampler, config.generator, "[generator]")
        if config.plans == (GENERATED,)
        else config.plans
    )


def check_plans(config: TrainingConfig) -> None:
    """See that the floor plans from files can be read, before hours of training meet the first that cannot.

    Raises:
        ConfigError: Plans without end stand beside others.
        MapError: One is missing, broken, or of no known format.
    """
    generated = config.plans == (GENERATED,)
    if GENERATED in config.plans and not generated:
        raise ConfigError(
            f"plans: {GENERATED!r} stands alone, got {shortened(config.plans)}; "
            "generator.shipped_share mixes plans that ship with generated ones"
        )
    for source in find_plans((*(() if generated else config.plans), *config.evaluation.plans)):
        if is_there(split_level(source)[0]):
            load_plan(source)
