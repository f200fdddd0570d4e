"""What agents with a trained policy share; the policy that is a weighted sum of features, without torch."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from layoutexplore.agents.rl.card import PolicySpec
from layoutexplore.envs.observation import ObservationConfig, encode_frontiers
from layoutexplore.errors import ResultsError, checks_making
from layoutexplore.frontiers.decision import STOP, Choice, Decision
from layoutexplore.grids.arrays import Floats32
from layoutexplore.options import SEED, check_kind


class PolicyAgent:
    """Goes to the frontier with the highest logit; it stops only when none is left.

    Args:
        name: What it is called in results.
        spec: What it reads.
        fingerprint: Of its file, if there is one.
    """

    def __init__(self, name: str, spec: PolicySpec, fingerprint: str = "") -> None:
        self.name = name
        self.spec = spec
        self.fingerprint = fingerprint

    @property
    def predictor(self) -> str:
        """The predictor that the policy was trained with."""
        return self.spec.predictor

    def reset(self, seed: int) -> None:
        """Begin a new run."""
        SEED.convert("seed", seed)

    def act(self, decision: Decision) -> Choice:
        """The frontier to go to, or `STOP` when there is none.

        Raises:
            ResultsError: A logit is not finite.
        """
        check_kind("decision", decision, Decision)
        if not decision.frontiers:
            return STOP
        logits = self.logits(decision)
        if not np.isfinite(logits).all():
            raise ResultsError(f"{self.name}: a logit is not finite: its weights are damaged, train it again")
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
        weights: "direct.weight" float32 (1, features), and "tour_weight", of 1 / the place in the tour.
        spec: What it reads.
        fingerprint: Of its file, if there is one.
    """

    def __init__(
        self, name: str, weights: Mapping[str, Floats32], spec: PolicySpec, fingerprint: str = ""
    ) -> None:
        super().__init__(name, spec, fingerprint)
        self._weights, self._tour_weight = weights["direct.weight"][0], weights["tour_weight"]

    def logits(self, decision: Decision) -> Floats32:
        """float32 (n,): a logit for each of the decision's frontiers."""
        count, rank = len(decision.frontiers), self.spec.rank_column
        table = encode_frontiers(decision, self.observed(count)).reshape(count, -1)
        features = table[:, self.spec.frontier_columns]
        read = np.arcsinh(features)
        if rank is not None:
            read[:, rank] = features[:, rank]
        scores: Floats32 = read @ self._weights
        return scores if rank is None else scores + self._tour_weight * read[:, rank]
