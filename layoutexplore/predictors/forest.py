"""Boosted decision trees as plain numbers: read from JSON, evaluated in one kernel."""

from __future__ import annotations

import itertools
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError

FOLDER = Path(__file__).parent
"""Where the shipped models lie; `layoutexplore.predictors.training` makes them."""


@dataclass(frozen=True, eq=False)
class Forest:
    """A sum of decision trees.

    Attributes:
        feature: int32 (n,), the feature that a node asks for; -1 for a leaf.
        threshold: float32 (n,): go to `left` where the feature is at most this; a leaf's value.
        left: int32 (n,), next node.
        right: int32 (n,), next node.
        roots: int32 (t,), first node of each tree.
        bias: What the sum begins with.
    """

    feature: NDArray[np.int32]
    threshold: NDArray[np.float32]
    left: NDArray[np.int32]
    right: NDArray[np.int32]
    roots: NDArray[np.int32]
    bias: float

    def score(self, samples: NDArray[np.float32]) -> NDArray[np.float64]:
        """The sum of the trees float64 (k,) for samples float32 (k, features)."""
        table = np.ascontiguousarray(samples, np.float32)
        return _score(table, self.feature, self.threshold, self.left, self.right, self.roots, self.bias)

    def probability(self, samples: NDArray[np.float32]) -> NDArray[np.float64]:
        """The logistic function of the score, float64 (k,)."""
        return np.asarray(1.0 / (1.0 + np.exp(-self.score(samples))))


@njit(cache=True, nogil=True)
def _score(
    samples: NDArray[np.float32],
    feature: NDArray[np.int32],
    threshold: NDArray[np.float32],
    left: NDArray[np.int32],
    right: NDArray[np.int32],
    roots: NDArray[np.int32],
    bias: float,
) -> NDArray[np.float64]:
    score = np.full(len(samples), bias)
    for root in roots:
        for k in range(len(samples)):
            node = root
            while feature[node] >= 0:
                node = left[node] if samples[k, feature[node]] <= threshold[node] else right[node]
            score[k] += threshold[node]
    return score


def save_forests(path: Path, forests: dict[str, Forest], features: Sequence[str], note: str) -> None:
    """Write forests that look at the same features, a line a tree."""
    data: dict[str, Any] = {"note": note, "features": list(features)}
    parts = []
    for name, forest in forests.items():
        bounds = [*forest.roots.tolist(), len(forest.feature)]
        trees = [_tree(forest, begin, end) for begin, end in itertools.pairwise(bounds)]
        lines = ",\n".join(json.dumps(tree, separators=(",", ":")) for tree in trees)
        parts.append(f'"{name}": {{"bias": {json.dumps(forest.bias)}, "trees": [\n{lines}\n]}}')
    path.write_text(f'{json.dumps(data)[:-1]}, "forests": {{\n{",".join(parts)}\n}}}}\n', encoding="utf-8")


def _tree(forest: Forest, begin: int, end: int) -> list[list[float]]:
    """Nodes as [feature, threshold, left, right] and leaves as [value]."""
    return [
        [int(forest.feature[i]), float(f"{forest.threshold[i]:.9g}"), int(forest.left[i]) - begin, int(forest.right[i]) - begin]
        if forest.feature[i] >= 0
        else [float(f"{forest.threshold[i]:.5g}")]
        for i in range(begin, end)
    ]


@lru_cache(maxsize=8)
def load_forests(path: Path, features: tuple[str, ...]) -> dict[str, Forest]:
    """Read forests that were trained on these features.

    Raises:
        ConfigError: They were trained on others.
    """
    data = json.loads(path.read_text(encoding="utf-8"))
    if tuple(data["features"]) != features:
        raise ConfigError(f"{path} looks at other features than this version computes: train it again")
    return {name: _forest(part) for name, part in data["forests"].items()}


def _forest(data: dict[str, Any]) -> Forest:
    nodes: list[list[float]] = []
    roots = []
    for tree in data["trees"]:
        base = len(nodes)
        roots.append(base)
        nodes.extend([n[0], n[1], n[2] + base, n[3] + base] if len(n) == 4 else [-1, n[0], 0, 0] for n in tree)
    table = np.array(nodes, np.float64).reshape(-1, 4)
    feature, left, right = (np.ascontiguousarray(table[:, k], np.int32) for k in (0, 2, 3))
    return Forest(feature, table[:, 1].astype(np.float32), left, right, np.array(roots, np.int32), float(data["bias"]))
