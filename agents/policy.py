"""Trained policies as agents: `policy` ships, `policy:FILE` is one of your own.

A policy that scores every frontier by itself, as those that ship do, runs on NumPy alone; the network of any
other is torch's (`pip install 'layoutexplore[rl]'`) and is imported when such an agent is made.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import safetensors.numpy
from numpy.typing import NDArray

from layoutexplore.agents.base import register
from layoutexplore.agents.rl.card import PolicySpec, find_policy, read_spec
from layoutexplore.envs.observation import ObservationConfig, encode_frontiers
from layoutexplore.errors import ResultsError, require
from layoutexplore.files import fingerprint
from layoutexplore.frontiers.decision import STOP, Agent, Choice, Decision
from layoutexplore.options import Options, option


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

    def act(self, decision: Decision) -> Choice:
        """The frontier to go to, or `STOP` when there is none."""
        return int(np.argmax(self.logits(decision))) if decision.frontiers else STOP

    def logits(self, decision: Decision) -> NDArray[np.float32]:
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


class LinearPolicy(PolicyAgent):
    """A policy without encoder: the logit of a frontier is a weighted sum of its own features.

    Args:
        name: What it is called in results.
        weights: "direct.weight" float32 (1, features), and "tour_weight", of 1 / the place in the tour.
        spec: What it reads.
        fingerprint: Of its file, if there is one.
    """

    def __init__(
        self, name: str, weights: Mapping[str, NDArray[np.float32]], spec: PolicySpec, fingerprint: str = ""
    ) -> None:
        super().__init__(name, spec, fingerprint)
        self._weights, self._tour_weight = weights["direct.weight"][0], weights["tour_weight"]

    def logits(self, decision: Decision) -> NDArray[np.float32]:
        """float32 (n,): a logit for each of the decision's frontiers."""
        count, rank = len(decision.frontiers), self.spec.rank_column
        table = encode_frontiers(decision, self.observed(count)).reshape(count, -1)
        features = table[:, self.spec.frontier_columns]
        read = np.arcsinh(features)
        if rank is not None:
            read[:, rank] = features[:, rank]
        scores: NDArray[np.float32] = read @ self._weights
        return scores if rank is None else scores + self._tour_weight * read[:, rank]


def load_policy(name: str, policy: str) -> PolicyAgent:
    """The agent of a policy: a file, a training folder, or a name that ships.

    Raises:
        ConfigError: There is no such policy.
        ResultsError: Its file is damaged, or cannot be run by this version.
        MissingExtraError: Its network needs torch, which is not installed.
    """
    path = find_policy(policy)
    spec = read_spec(path)
    if spec.network.encoder == "none":
        return LinearPolicy(name, _linear_weights(path, spec), spec, fingerprint([path]))
    require("torch", "rl")
    from layoutexplore.agents.rl.agent import NetworkPolicy
    from layoutexplore.agents.rl.policy_file import load_actor

    return NetworkPolicy(name, load_actor(path)[0], spec, fingerprint([path]))


def _linear_weights(path: Path, spec: PolicySpec) -> Mapping[str, NDArray[np.float32]]:
    weights = safetensors.numpy.load_file(path)
    shapes = {"direct.weight": (1, len(spec.frontier_features)), "tour_weight": ()}
    for name, shape in shapes.items():
        if name not in weights or weights[name].shape != shape:
            raise ResultsError(f"{path}: the weights do not fit its card: {name} must have the shape {shape}")
    return weights


@dataclass(frozen=True, kw_only=True)
class PolicyOptions(Options):
    """Parameters of a trained policy."""

    path: str = option(
        "layout", "a policy's file, a folder of `layoutexplore train`, or a shipped policy", positional=True
    )


def _load(name: str, options: PolicyOptions) -> Agent:
    return load_policy(name, options.path)


register("policy", "a trained policy: policy:FILE, or a shipped one", _load, PolicyOptions())
