"""The policy with the encoder "pooled", without torch."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from layoutexplore.agents.rl.card import PolicySpec
from layoutexplore.agents.rl.linear import LinearPolicy, linear_shapes
from layoutexplore.envs.egocentric_maps import NOWHERE
from layoutexplore.envs.observation import encode_frontiers, encode_robot
from layoutexplore.errors import checks_making
from layoutexplore.frontiers.decision import Decision
from layoutexplore.grids.arrays import Floats32

FEW = 10.0
"""The number of frontiers that counts as 1."""


@checks_making
class PooledPolicy(LinearPolicy):
    """Each frontier beside the mean and the greatest values over all: `networks.encoders.PooledEncoder`.

    Args:
        name: What it is called in results.
        weights: float32, by the names and shapes of `pooled_shapes`.
        spec: What it reads; no map.
        fingerprint: Of its file, if there is one.

    Raises:
        ConfigError: A weight is missing, has another shape or is none of numbers.
    """

    def __init__(
        self, name: str, weights: Mapping[str, Floats32], spec: PolicySpec, fingerprint: str = ""
    ) -> None:
        super().__init__(name, weights, spec, fingerprint)
        self._robot = spec.robot_columns

    @staticmethod
    def _shapes(spec: PolicySpec) -> dict[str, tuple[int, ...]]:
        """The names and shapes of its weights."""
        return pooled_shapes(spec)

    def logits(self, decision: Decision) -> Floats32:
        """float32 (n,): a logit for each of the decision's frontiers."""
        count = len(decision.frontiers)
        observed = self.observed(count)
        read = self._read(encode_frontiers(decision, observed))
        of_robot = np.arcsinh(encode_robot(decision, observed, NOWHERE)[self._robot])
        robot = np.append(of_robot, np.log1p(np.float32(count / FEW)))
        scores: Floats32 = self._of_features(read) + self._apply("score", self._encode(read, robot))[:, 0]
        return scores

    def _encode(self, read: Floats32, robot: Floats32) -> Floats32:
        """The frontiers float32 (n, width) as they see each other, from their features and the robot's."""
        tokens = _positive(self._apply("encode.frontier", read) + self._apply("encode.robot", robot))
        for layer in range(self.spec.network.layers):
            at = f"encode.layers.{layer}"
            pooled = np.concatenate([tokens.mean(axis=0), tokens.max(axis=0)])
            tokens = _positive(
                self._apply(f"{at}.own", tokens) + self._weights[f"{at}.shared.weight"] @ pooled
            )
        return tokens

    def _apply(self, layer: str, values: Floats32) -> Floats32:
        """A linear layer of values (..., in): float32 (..., out)."""
        result: Floats32 = values @ self._weights[f"{layer}.weight"].T + self._weights[f"{layer}.bias"]
        return result


def pooled_shapes(spec: PolicySpec) -> dict[str, tuple[int, ...]]:
    """The names and shapes of the weights that such a policy needs."""
    width, columns = spec.network.width, len(spec.frontier_features)
    layers = {
        "encode.frontier": (width, columns),
        "encode.robot": (width, len(spec.robot_features) + 1),
        "score": (1, width),
        **{f"encode.layers.{k}.own": (width, width) for k in range(spec.network.layers)},
    }
    shapes = linear_shapes(spec)
    for name, shape in layers.items():
        shapes |= {f"{name}.weight": shape, f"{name}.bias": shape[:1]}
    shapes |= {f"encode.layers.{k}.shared.weight": (width, 2 * width) for k in range(spec.network.layers)}
    return shapes


def _positive(values: Floats32) -> Floats32:
    return np.maximum(values, np.float32(0.0))
