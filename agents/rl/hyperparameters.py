"""Hyper-parameters as data: `agents/hyperparameters.toml`, then the user's file, then flags.

The shipped file is also the schema: a key that it does not have for an algorithm is an error, and a value
must have the type of the one it replaces.
"""

from __future__ import annotations

import copy
import dataclasses
import functools
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from layoutexplore.agents.rl.tour_search.config import SearchConfig
from layoutexplore.envs.curriculum import PlanSampler, Randomisation
from layoutexplore.envs.observation import ObservationConfig
from layoutexplore.envs.rewards import PathToMarks
from layoutexplore.errors import ConfigError, checks_arguments, checks_making, shortened, unknown_name
from layoutexplore.files import blaming, read_toml
from layoutexplore.frontiers.tour_features import TourConfig
from layoutexplore.options import SHARE, Rule, check, check_keys, check_kind, from_table, rule_like

DEFAULTS = Path(__file__).resolve().parent.parent / "hyperparameters.toml"
"""The shipped hyper-parameters."""

DEFAULT_ALGORITHM = "tour-search"

SEED = Rule(kind=int, low=0, high=4e9)
"""NumPy's and torch's generators take 32 bits."""

LONGEST_WAY = 1e6
"""Metres: more than any robot goes between two looks around."""

ENCODERS = ("pooled", "attention", "deep-sets", "none")

MOST_WEIGHTS = 2e7
"""So many numbers a network may have: with its average, its critic and the optimizer a gigabyte."""

MOST_PARALLEL = 4096
"""Side by side; memory ends it sooner."""

MOST_DECISIONS = 1e7
"""So many decisions may be made between two updates; memory ends it sooner."""

MOST_CELLS = 100_000
"""So many explorations one evaluation may take: they would take days."""

_STEPS = Rule(kind=int, low=1, high=1e10)
_COUNT = Rule(kind=int, low=1, high=1e6)
_RATE = Rule(above=0.0, high=1.0)
_WEIGHT = Rule(low=0.0, high=1e3)
_LEARNING = {
    "learning_rate": _RATE,
    "n_steps": _COUNT,
    "batch_size": _COUNT,
    "n_epochs": Rule(kind=int, low=1, high=1e4),
    "gamma": SHARE,
    "gae_lambda": SHARE,
    "clip_range": Rule(above=0.0, high=10.0),
    "ent_coef": _WEIGHT,
    "vf_coef": _WEIGHT,
    "max_grad_norm": Rule(above=0.0, high=1e6),
    "target_kl": Rule(above=0.0, high=1e3),
    "buffer_size": Rule(kind=int, low=1, high=1e8),
    "learning_starts": Rule(kind=int, low=0, high=1e10),
    "train_freq": _COUNT,
    "gradient_steps": Rule(kind=int, low=-1, high=1e6),
    "target_update_interval": _STEPS,
    "exploration_fraction": _RATE,
    "exploration_final_eps": SHARE,
}
"""Which values the keyword arguments of the algorithms may have."""


@dataclass(frozen=True, kw_only=True)
class NetworkConfig:
    """The shape of the network that scores frontiers.

    Attributes:
        encoder: "pooled", "attention" or "deep-sets", how frontiers see each other; "none" scores each by its
            features alone.
        width: Numbers in which a frontier is described.
        layers: Layers of the encoder.
        heads: Attention heads; divides the width.
        tour_weight: Where the weight of 1 / the place in the tour starts in the logits.
        detour_weight: Where the weight of a detour of 10 m starts in the logits, with the sign changed; where
            no tour is computed (`observation.detour`), that of a way of 10 m.
    """

    encoder: str = "attention"
    width: int = 64
    layers: int = 2
    heads: int = 4
    tour_weight: float = 2.0
    detour_weight: float = 5.0

    def __post_init__(self) -> None:
        encoder = Rule(kind=str, choices=ENCODERS)
        size, weight = Rule(kind=int, low=1, high=4096), Rule(low=-1e6, high=1e6)
        check(
            self, "network.", encoder=encoder, width=size, layers=Rule(kind=int, low=1, high=64), heads=size
        )
        check(self, "network.", tour_weight=weight, detour_weight=weight)
        if self.width % self.heads:
            raise ConfigError(f"network.heads must divide network.width, got {self.heads} and {self.width}")
        # A layer of attention has 12 squares of the width; no other has more.
        if self.encoder != "none" and 12 * self.layers * self.width**2 > MOST_WEIGHTS:
            raise ConfigError(
                f"network.width {self.width} and network.layers {self.layers} make a network of more than "
                f"{MOST_WEIGHTS:.0e} numbers: 12 * layers * width squared must be at most that"
            )


@dataclass(frozen=True, kw_only=True)
class ImitationConfig:
    """Imitation of an agent by DAgger before learning by reward.

    The explorations take place on plans of the whole range of sizes, also where plans grow with the training
    (`first_area`): a teacher needs no easy beginning.

    Attributes:
        teacher: Name of the agent; "" for none.
        episodes: Explorations of all rounds together.
        rounds: In the first round the robot follows the teacher, then the policy; the teacher labels every
            decision.
        epochs: Passes over all decisions so far, a round.
        learning_rate: Of Adam.
        batch_size: Decisions per step.
    """

    teacher: str = ""
    episodes: int = 200
    rounds: int = 4
    epochs: int = 4
    learning_rate: float = 1e-3
    batch_size: int = 256

    def __post_init__(self) -> None:
        check(self, "imitation.", teacher=Rule(kind=str), learning_rate=_RATE)
        check(self, "imitation.", episodes=_COUNT, rounds=_COUNT, epochs=_COUNT, batch_size=_COUNT)


@dataclass(frozen=True, kw_only=True)
class EvaluationConfig:
    """Explorations on fixed cells at intervals, paired with reference agents.

    Attributes:
        every: Steps between evaluations.
        plans: Floor plans as the benchmark names them.
        starts: Starts on each.
        references: Agents to compare with; the first one decides which policy is the best.
    """

    every: int = 32768
    plans: tuple[str, ...] = ("validation",)
    starts: int = 2
    references: tuple[str, ...] = ("tour", "nearest")

    def __post_init__(self) -> None:
        check(self, "evaluation.", every=_STEPS, starts=Rule(kind=int, low=1, high=1e3))
        names = Rule(kind=str, count=-1)
        check(self, "evaluation.", plans=names, references=names)
        if not all(self.plans or ("",)):
            raise ConfigError(f"evaluation.plans must name floor plans, got {shortened(self.plans)}")


_PARTS = {"network": NetworkConfig, "imitation": ImitationConfig, "tour": TourConfig, "search": SearchConfig}
"""Tables of the algorithms that have them, and what they are read into."""


@checks_making
@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """Everything that decides a training run.

    Attributes:
        algorithm: "maskable-ppo", "tour-search", "ppo" or "dqn".
        environment: Id of the environment.
        steps: Steps of all environments together; of "tour-search", explorations.
        envs: Environments side by side; not of "tour-search".
        workers: Processes that step them, and as many that explore in an evaluation; 0 for as many as there
            are cores, 1 for none but this one.
        seed: Of everything.
        plans: Where episodes take place.
        sensors: Names of lidars; each episode draws one.
        predictor: Name of the predictor of rooms.
        checkpoint_every: Steps between checkpoints; "tour-search" keeps every exploration.
        observation: Keyword arguments of `ObservationConfig`; of Frontier-v0 only.
        reward: Keyword arguments of `PathToMarks`; of Frontier-v0 only.
        critic_steps: Steps at the start from which only the critic learns; of Frontier-v0 only.
        averaging: Share of the actor's running average that an update leaves; of Frontier-v0 only.
        final_learning_rate: To which the learning rate changes evenly until the last step, 0 for one that
            stays; of Frontier-v0 only.
        max_steps: Steps after which an episode is cut off, 0 for never; of Motion-v0 only.
        network: Of Frontier-v0 only.
        imitation: Of "maskable-ppo" only.
        look_every: Metres after which the robot looks all around on its way and may choose anew, where the
            lidar sees a part of it and turning is free, 0 for never. Of "maskable-ppo" only.
        start_from: A policy to go on from, as agents name it (a file, a training folder, a shipped name): the
            run takes its weights over, its network and its tour; "" for none. Of "maskable-ppo" only.
        start_temperature: By what its logits are divided then. A policy that has learnt for long tries hardly
            anything else any more; above 1 it chooses as before and tries more. Of "maskable-ppo" only.
        tour: The tour behind the frontiers' features, where "tour-search" starts; of Frontier-v0 only.
        search: Of "tour-search" only.
        generator: Keyword arguments of `PlanSampler`, for generated plans.
        learning: Keyword arguments of the algorithm.
        evaluation: Evaluation while training.
    """

    algorithm: str
    environment: str
    steps: int
    workers: int
    seed: int
    plans: tuple[str, ...]
    sensors: tuple[str, ...]
    predictor: str
    generator: Mapping[str, Any]
    evaluation: EvaluationConfig
    learning: Mapping[str, Any] = field(default_factory=dict)
    envs: int = 1
    checkpoint_every: int = 1
    observation: Mapping[str, Any] = field(default_factory=dict)
    reward: Mapping[str, Any] = field(default_factory=dict)
    critic_steps: int = 0
    averaging: float = 0.0
    final_learning_rate: float = 0.0
    max_steps: int = 0
    network: NetworkConfig | None = None
    imitation: ImitationConfig | None = None
    look_every: float = 0.0
    start_from: str = ""
    start_temperature: float = 1.0
    tour: TourConfig = field(default_factory=TourConfig)
    search: SearchConfig | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.algorithm, str) or self.algorithm not in _defaults():
            raise unknown_name("algorithm", self.algorithm, _defaults())
        check(self, steps=_STEPS, envs=Rule(kind=int, low=1, high=MOST_PARALLEL), checkpoint_every=_STEPS)
        check(self, workers=Rule(kind=int, low=0, high=1024), seed=SEED, averaging=Rule(low=0.0, below=1.0))
        check(self, critic_steps=Rule(kind=int, low=0, high=1e10), max_steps=Rule(kind=int, low=0, high=1e7))
        check(self, final_learning_rate=SHARE, look_every=Rule(low=0.0, high=LONGEST_WAY))
        names, name = Rule(kind=str, count=-1), Rule(kind=str)
        check(self, predictor=name, start_from=name, plans=names, sensors=names)
        check(self, start_temperature=Rule(above=0.0, high=1e3))
        if not self.sensors or not all(self.plans or ("",)):
            raise ConfigError("training needs at least one of plans and of sensors, and no plan is ''")
        self._check_parts()
        self._check_tables()

    def _check_parts(self) -> None:
        """Raise `ConfigError` unless every part is there that the algorithm has, and of its kind."""
        defaults = _defaults()[self.algorithm]
        for name, kind in (*_PARTS.items(), ("evaluation", EvaluationConfig)):
            check_kind(name, getattr(self, name), kind, optional=name not in defaults)
        environment = defaults["environment"]
        if self.environment != environment:
            raise unknown_name(f"environment for {self.algorithm!r}", self.environment, [environment])
        if self.evaluation.references and "network" not in defaults:
            raise ConfigError(
                f"evaluation.references: no agent drives as {self.algorithm!r} does, so none can be compared "
                f"with it; leave them out, got {shortened(self.evaluation.references)}"
            )

    def _check_tables(self) -> None:
        """Raise `ConfigError` unless the tables of keyword arguments are complete and make sense."""
        defaults = _defaults()[self.algorithm]
        for name in ("generator", "learning", "observation", "reward"):
            table, known = getattr(self, name), defaults.get(name, {})
            check_kind(name, table, Mapping)
            if name != "generator":
                check_keys(table, known, f"[{name}]")
            if lacking := [key for key in known if key not in table]:
                raise ConfigError(f"[{name}]: missing {', '.join(lacking)}")
        from_table(PlanSampler, self.generator, "[generator]")
        from_table(ObservationConfig, self.observation, "[observation]")
        Randomisation(sensors=self.sensors)
        reward = from_table(PathToMarks, self.reward, "[reward]")
        if not reward.weight_95 + reward.weight_99:
            raise ConfigError("reward.weight_95 and reward.weight_99 are both 0: one must be above")
        for key, value in self.learning.items():
            _LEARNING[key].convert(f"learning.{key}", value)
        if "n_epochs" in self.learning:  # Advantages are measured against others of the same batch.
            if self.learning["batch_size"] < 2:
                raise ConfigError("learning.batch_size must be a whole number, 2 or more, got 1")
            if not 2 <= self.envs * self.learning["n_steps"] <= MOST_DECISIONS:
                raise ConfigError(
                    f"envs * learning.n_steps must be from 2 to {MOST_DECISIONS:g}, "
                    f"got {self.envs} * {self.learning['n_steps']}"
                )

    @property
    def chooses_frontiers(self) -> bool:
        """Whether the policy chooses frontiers, as the agents of the benchmark do."""
        return self.network is not None

    def as_table(self) -> dict[str, Any]:
        """Nested plain values, as `read_config` takes them from TOML."""
        known = _defaults()[self.algorithm]
        values = {k: _plain(v) for k, v in dataclasses.asdict(self).items() if k in known}
        return {"algorithm": self.algorithm, **values}


def algorithms() -> list[str]:
    """The names of the algorithms."""
    return list(_defaults())


@checks_arguments
def read_config(
    path: str | os.PathLike[str] | None = None, flags: Mapping[str, Any] | None = None
) -> TrainingConfig:
    """The configuration of a run.

    Args:
        path: A TOML file with `algorithm` and any keys of `agents/hyperparameters.toml`; None for none.
        flags: Top-level keys that win over the file; values of None are ignored.

    Raises:
        ConfigError: The file cannot be read, a key is unknown, or a value makes no sense.
    """
    table, where = ({}, "the flags") if path is None else (read_toml(Path(path)), str(path))
    given = {key: value for key, value in (flags or {}).items() if value is not None}
    whose = "algorithm" if "algorithm" in given else f"algorithm of {where}:"
    algorithm = given.pop("algorithm", table.pop("algorithm", DEFAULT_ALGORITHM))
    if not isinstance(algorithm, str) or algorithm not in _defaults():
        raise unknown_name(whose, algorithm, _defaults())
    merged = merge(_defaults()[algorithm], table, f"of {algorithm!r} in {where}")
    with blaming(None if path is None else Path(path), ConfigError, lambda: _build(algorithm, merged)):
        return _build(algorithm, merge(merged, given, f"of {algorithm!r}"))


def merge(defaults: Mapping[str, Any], changes: Mapping[str, Any], where: str) -> dict[str, Any]:
    """The defaults with some values changed, table by table.

    Raises:
        ConfigError: A key that the defaults do not have, or a value of another type.

    Example:
        >>> merge({"a": 1.0, "t": {"b": "x"}}, {"t": {"b": "y"}}, "here")
        {'a': 1.0, 't': {'b': 'y'}}
    """
    merged = copy.deepcopy(dict(defaults))
    for key, value in changes.items():
        if key not in merged:
            raise unknown_name(f"hyper-parameter {where}:", key, merged)
        old = merged[key]
        if isinstance(old, dict) and isinstance(value, dict):
            # An empty table of the defaults is open: who reads it knows its keys.
            merged[key] = merge(old, value, f"{where} [{key}]") if old else value
        else:
            plain = rule_like(old).convert(f"{key} {where}", value)
            merged[key] = type(old)(plain)
    return merged


def _build(algorithm: str, table: dict[str, Any]) -> TrainingConfig:
    evaluation = dict(table.pop("evaluation"))
    evaluation |= {name: tuple(evaluation[name]) for name in ("plans", "references")}
    parts: dict[str, Any] = {"evaluation": EvaluationConfig(**evaluation)}
    for name in ("plans", "sensors"):
        parts[name] = tuple(table.pop(name))
    parts |= {name: kind(**table.pop(name)) for name, kind in _PARTS.items() if name in table}
    return TrainingConfig(algorithm=algorithm, **parts, **table)


@functools.cache
def _defaults() -> dict[str, dict[str, Any]]:
    return read_toml(DEFAULTS)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    return list(value) if isinstance(value, tuple) else value
