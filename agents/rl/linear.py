"""What agents with a trained policy share; the policy that is a weighted sum of features, without torch."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from layoutexplore.agents.rl.card import PolicySpec
from layoutexplore.agents.watchful_tour import WatchfulTourOptions, plan_watchful_tour
from layoutexplore.envs.observation import FRONTIER_FEATURES, ObservationConfig, encode_frontiers
from layoutexplore.errors import ConfigError, ResultsError, checks_calls, checks_making, shortened
from layoutexplore.frontiers.decision import STOP, Choice, Decision
from layoutexplore.frontiers.table import Frontier, FrontierList
from layoutexplore.grids.arrays import Floats32
from layoutexplore.options import SEED, check_kind
from layoutexplore.simulation.looking_around import LookingAround


@checks_calls
class PolicyAgent:
    """Goes to the frontier with the highest logit; it stops only when none is left.

    Where the spec says so, it looks all around on its way and chooses anew by what it sees (see
    `LookingAround`), and takes the advice of `watchful-tour` where its lidar sees all around.

    Args:
        name: What it is called in results.
        spec: What it reads.
        fingerprint: Of its file, if there is one.
    """

    def __init__(self, name: str, spec: PolicySpec, fingerprint: str = "") -> None:
        self.name = name
        self.spec = spec
        self.fingerprint = fingerprint
        self._looking = LookingAround(spec.look_every, with_any_lidar=spec.watchful > 0)

    @property
    def remembers(self) -> bool:
        """Whether it keeps in mind where it was going."""
        return self.spec.look_every > 0

    @property
    def predictor(self) -> str:
        """The predictor that the policy was trained with."""
        return self.spec.predictor

    def reset(self, seed: int) -> None:
        """Begin a new run."""
        SEED.convert("seed", seed)
        self._looking.forget()

    def act(self, decision: Decision) -> Choice:
        """The frontier to go to, the first steps there where it looks around then, `STOP` when there is none.

        Raises:
            ConfigError: The decision was made by hand and lacks something.
            ResultsError: A logit is not finite.
        """
        check_kind("decision", decision, Decision)
        if not decision.frontiers:
            return STOP
        # Those of a simulation are a `FrontierList`.
        if not isinstance(decision.frontiers, FrontierList) and not all(
            isinstance(one, Frontier) and len(one.cells) for one in decision.frontiers
        ):
            raise ConfigError(f"decision {decision.fault}")
        return self._looking.choose(decision, self._decide, anew=True)

    def _decide(self, decision: Decision) -> int:
        """The number of the frontier with the highest logit, what its place in a tour is worth added."""
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is told below
            logits = self.logits(decision)
        if not np.isfinite(logits).all():
            if decision.fault:
                raise ConfigError(f"decision {decision.fault}")
            raise ResultsError(f"{self.name}: a logit is not finite: its weights are damaged, train it again")
        if self.spec.watchful and decision.sensor.full_turn:
            tour = plan_watchful_tour(decision, WatchfulTourOptions())
            logits = logits.copy()
            logits[tour] += self.spec.watchful / np.arange(1, len(tour) + 1)
        return int(np.argmax(logits))

    def logits(self, decision: Decision) -> Floats32:
        """float32 (n,): a logit for each of the decision's frontiers."""
        raise NotImplementedError

    def observed(self, slots: int) -> ObservationConfig:
        """What has to be observed; the policy does not care how many slots there are, so none is left out."""
        maps, tour = bool(self.spec.map_channels), self.spec.reads_tour
        return ObservationConfig(
            max_frontiers=slots, local_map=False, global_map=maps, detour=tour, tour=self.spec.tour
        )

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.name}>"


@checks_making
class LinearPolicy(PolicyAgent):
    """A policy without encoder: the logit of a frontier is a weighted sum of its own features.

    Args:
        name: What it is called in results.
        weights: "direct.weight" float32 (1, features), and "tour_weight", of 1 / the place in the tour: one
            number, which may be left out where the spec does not read it.
        spec: What it reads.
        fingerprint: Of its file, if there is one.

    Raises:
        ConfigError: A weight is missing, has another shape or is none of numbers.
    """

    def __init__(
        self, name: str, weights: Mapping[str, Floats32], spec: PolicySpec, fingerprint: str = ""
    ) -> None:
        super().__init__(name, spec, fingerprint)
        check_kind("weights", weights, Mapping)
        _check_weights(weights, self._shapes(spec), spec)
        self._weights = weights

    @staticmethod
    def _shapes(spec: PolicySpec) -> dict[str, tuple[int, ...]]:
        """The names and shapes of its weights."""
        return linear_shapes(spec)

    def logits(self, decision: Decision) -> Floats32:
        """float32 (n,): a logit for each of the decision's frontiers."""
        frontiers = encode_frontiers(decision, self.observed(len(decision.frontiers)))
        return self._of_features(self._read(frontiers))

    def _read(self, frontiers: Floats32) -> Floats32:
        """float32 (n, columns): what it reads of the frontiers of an observation, (n * all columns,)."""
        features: Floats32 = frontiers.reshape(-1, len(FRONTIER_FEATURES))[:, self.spec.frontier_columns]
        read, rank = np.arcsinh(features), self.spec.rank_column
        if rank is not None:
            read[:, rank] = features[:, rank]
        return read

    def _of_features(self, read: Floats32) -> Floats32:
        """The weighed sums float32 (n,) of features (n, columns)."""
        rank = self.spec.rank_column
        scores: Floats32 = read @ self._weights["direct.weight"][0]
        return scores if rank is None else scores + self._weights["tour_weight"] * read[:, rank]


def linear_shapes(spec: PolicySpec) -> dict[str, tuple[int, ...]]:
    """The names and shapes of the weights that such a policy needs."""
    return {"direct.weight": (1, len(spec.frontier_features)), "tour_weight": ()}


def _check_weights(
    weights: Mapping[str, Floats32], shapes: dict[str, tuple[int, ...]], spec: PolicySpec
) -> None:
    """Raise `ConfigError` unless the weights have these names and shapes, as the spec reads them."""
    for name, shape in shapes.items():
        if name not in weights:
            if name == "tour_weight" and spec.rank_column is None:
                continue
            raise ConfigError(f"weights must have {name!r} of the shape {shape}, as the spec reads it")
        array = np.asarray(weights[name])
        if array.dtype.kind not in "biuf":
            raise ConfigError(f"weights: {name!r} must be numbers, got {shortened(weights[name])}")
        if array.shape != shape and not (shape == () and array.size == 1):
            raise ConfigError(f"weights: {name!r} must have the shape {shape}, got {array.shape}")
