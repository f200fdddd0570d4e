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


def load_forests(path: Path, features: tuple[str, ...], names: Sequence[str] = ()) -> dict[str, Forest]:
    """Read forests that were trained on these features.

    Raises:
        ConfigError: The file cannot be read, holds no such forests, or they were trained on other features.
    """
    try:
        forests = _read(path, path.stat().st_mtime_ns, features)
    except OSError as error:
        raise ConfigError(f"{path}: no model can be read here: {error.strerror or error}") from error
    missing = [name for name in names if name not in forests]
    if missing:
        raise ConfigError(f"{path}: the forest {missing[0]!r} is missing: train it again")
    return forests


@lru_cache(maxsize=16)
def _read(path: Path, _changed: int, features: tuple[str, ...]) -> dict[str, Forest]:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        trained_on, parts = tuple(data["features"]), dict(data["forests"])
    except (ValueError, KeyError, TypeError) as error:
        raise ConfigError(f"{path}: not a model of decision trees ({error})") from error
    if trained_on != features:
        raise ConfigError(f"{path} looks at other features than this version computes: train it again")
    try:
        return {name: _forest(part, len(features)) for name, part in parts.items()}
    except (ValueError, KeyError, TypeError, IndexError, OverflowError) as error:
        raise ConfigError(f"{path}: damaged trees ({error})") from error


def _forest(data: dict[str, Any], features: int) -> Forest:
    """A forest from its numbers; every way down a tree ends, and asks only for features there are."""
    nodes: list[list[float]] = []
    roots = []
    for tree in data["trees"]:
        base = len(nodes)
        roots.append(base)
        for k, n in enumerate(tree):
            if len(n) == 4 and not (0 <= n[0] < features and k < n[2] < len(tree) and k < n[3] < len(tree)):
                raise ValueError(f"node {k} of tree {len(roots)} leads nowhere")
            nodes.append([n[0], n[1], n[2] + base, n[3] + base] if len(n) == 4 else [-1, n[0], 0, 0])
        if base == len(nodes):
            raise ValueError(f"tree {len(roots)} is empty")
    table = np.array(nodes, np.float64).reshape(-1, 4)
    feature, left, right = (np.ascontiguousarray(table[:, k], np.int32) for k in (0, 2, 3))
    return Forest(feature, table[:, 1].astype(np.float32), left, right, np.array(roots, np.int32), float(data["bias"]))
