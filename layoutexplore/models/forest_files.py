"""Files of trees: JSON, a line a tree.

A node is [feature, threshold, left, right] with the next nodes counted from the tree's first, a leaf is
[value].
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from layoutexplore.errors import ConfigError, cause, checks_arguments
from layoutexplore.files import read_json, write_atomically
from layoutexplore.files.schema import Items, Number, Record, TableOf, Text
from layoutexplore.models.forest import Forest


@checks_arguments
def save_forests(
    path: Path, forests: dict[str, Forest], features: Sequence[str], note: str = "", *, double: bool = False
) -> None:
    """Write forests that look at the same features.

    Args:
        path: The file.
        forests: By name.
        features: Names of the features, in their order.
        note: What they were trained on.
        double: Keep all digits; otherwise those of thresholds that float32 holds, and five of each value.

    Raises:
        MapError: The file cannot be written.
    """
    data: dict[str, Any] = {"note": note, "features": list(features)}
    parts = []
    for name, forest in forests.items():
        bounds = [*forest.roots.tolist(), len(forest.feature)]
        trees = [_tree(forest, begin, end, double) for begin, end in itertools.pairwise(bounds)]
        lines = ",\n".join(json.dumps(tree, separators=(",", ":")) for tree in trees)
        parts.append(f'"{name}": {{"bias": {json.dumps(forest.bias)}, "trees": [\n{lines}\n]}}')
    text = f'{json.dumps(data)[:-1]}, "forests": {{\n{",".join(parts)}\n}}}}\n'
    write_atomically(path, text.encode())


def _tree(forest: Forest, begin: int, end: int, double: bool) -> list[list[float]]:
    threshold_digits, value_digits = (17, 17) if double else (9, 5)
    feature, left, right = (
        column[begin:end].tolist() for column in (forest.feature, forest.left, forest.right)
    )
    return [
        [f, float(f"{x:.{threshold_digits}g}"), a - begin, b - begin]
        if f >= 0
        else [float(f"{x:.{value_digits}g}")]
        for f, x, a, b in zip(feature, forest.threshold[begin:end].tolist(), left, right, strict=True)
    ]


@checks_arguments
def load_forests(
    path: Path, features: tuple[str, ...], names: Sequence[str] = (), *, double: bool = False
) -> dict[str, Forest]:
    """Read forests.

    Args:
        path: A file that `save_forests` wrote.
        features: What the forests have to be trained on.
        names: Forests that must be there.
        double: As they were saved; otherwise numbers are what float32 holds, as the samples are.

    Raises:
        ConfigError: The file cannot be read, holds no such forests, or they were trained on other features.
    """
    try:
        forests = _read(path, path.stat().st_mtime_ns, features, double)
    except OSError as error:
        raise ConfigError(f"{path}: no model can be read here: {error.strerror or error}") from error
    missing = [name for name in names if name not in forests]
    if missing:
        raise ConfigError(f"{path}: the forest {missing[0]!r} is missing: train it again")
    return forests


@dataclass(frozen=True)
class ForestKind:
    """Files with one forest, kept to all digits.

    Attributes:
        name: Of the forest in its file.
        features: What it looks at.
        shipped: The file of the one that ships.
    """

    name: str
    features: tuple[str, ...]
    shipped: Path

    def save(self, forest: Forest, path: Path, *, note: str = "") -> None:
        """Write a forest, as `save_forests` does."""
        save_forests(path, {self.name: forest}, self.features, note, double=True)

    def load(self, path: Path | None = None) -> Forest:
        """Read a forest, the shipped one without a path, as `load_forests` does; unchanged files once."""
        return load_forests(path or self.shipped, self.features, (self.name,), double=True)[self.name]


MOST_VALUE = 1e6
"""What a tree says, log-odds or logarithms as a rule, is below 10; sums of far larger ones mean nothing."""

_NODE = Items(Number(), 1, 4)
_FOREST = Record({"bias": Number(low=-MOST_VALUE, high=MOST_VALUE), "trees": Items(Items(_NODE, 1))})
_MODEL = Record({"features": Items(Text()), "forests": TableOf(_FOREST)})
"""What a file of trees must hold."""


@lru_cache(maxsize=16)
def _read(path: Path, _changed: int, features: tuple[str, ...], double: bool) -> dict[str, Forest]:
    data = read_json(path, _MODEL, error=ConfigError, what="model of decision trees")
    if tuple(data["features"]) != features:
        raise ConfigError(f"{path} looks at other features than this version computes: train it again")
    try:
        return {name: _forest(part, len(features), double) for name, part in data["forests"].items()}
    except (ValueError, OverflowError) as error:
        raise ConfigError(f"{path}: damaged trees ({cause(error)})") from error


def _forest(data: dict[str, Any], features: int, double: bool) -> Forest:
    """A forest from its numbers; every way down a tree ends, and asks only for features there are.

    That is so where each node but the first is the child of exactly one that stands before it.
    """
    sizes = np.array([len(tree) for tree in data["trees"]], np.int64)
    roots = np.cumsum(sizes) - sizes
    tree = np.repeat(np.arange(len(sizes)), sizes)
    nodes = [node for tree in data["trees"] for node in tree]
    place = np.arange(len(nodes)) - roots[tree]
    plain = np.array([len(node) == 1 or _is_split(node) for node in nodes], bool)
    splits = np.array([len(node) > 1 for node in nodes], bool)
    padded = [node if len(node) == 4 else (-1, node[0], 0, 0) for node in nodes]
    feature, threshold, *children = np.array(padded, np.float64).reshape(-1, 4).T
    after = [(place < child) & (child < sizes[tree]) for child in children]
    wrong = np.flatnonzero(~plain | splits & ~((feature >= 0) & (feature < features) & after[0] & after[1]))
    if wrong.size:
        raise ValueError(f"node {place[wrong[0]]} of tree {tree[wrong[0]] + 1} leads nowhere")
    large = np.flatnonzero(~splits & (np.abs(threshold) > MOST_VALUE))
    if large.size:
        k = large[0]
        raise ValueError(f"node {place[k]} of tree {tree[k] + 1} says {threshold[k]:.3g}, far too much")
    left, right = (np.where(splits, child + roots[tree], 0).astype(np.int32) for child in children)
    parents = np.bincount(np.concatenate([left[splits], right[splits]]), minlength=len(nodes))
    wrong = np.flatnonzero(parents != (place > 0))
    if wrong.size:
        raise ValueError(f"tree {tree[wrong[0]] + 1} is no tree: a node has no parent, or two")
    threshold = threshold.copy() if double else threshold.astype(np.float32).astype(np.float64)
    if not np.isfinite(threshold).all():
        raise ValueError("a number is larger than float32 holds")
    bias = float(data["bias"])
    return Forest(feature.astype(np.int32), threshold, left, right, roots.astype(np.int32), bias)


def _is_split(node: Sequence[float]) -> bool:
    """Whether a node has the numbers of one that asks for a feature."""
    return len(node) == 4 and isinstance(node[0], int) and type(node[2]) is type(node[3]) is int
