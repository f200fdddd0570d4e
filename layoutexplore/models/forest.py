"""Boosted decision trees as plain numbers, evaluated for many samples at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.models.quickscorer import LeafMasks, leaf_masks, log_odds_by_masks, rounded_down

_MANY = 8
"""Samples from which on masks are quicker than descending the trees."""

_SURE = 700.0
"""Log-odds that are as good as certain: the exponential function of larger ones is not finite."""

Numbers = tuple[
    NDArray[np.uint32], NDArray[np.float64], NDArray[np.uint32], NDArray[np.uint32], NDArray[np.int64], float
]


def logistic(log_odds: NDArray[np.floating]) -> NDArray[np.float64]:
    """The probabilities of log-odds of any shape.

    Example:
        >>> logistic(np.array([0.0, 1e9, -np.log(3.0)])).round(2).tolist()
        [0.5, 1.0, 0.25]
    """
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(log_odds, -_SURE, _SURE))), np.float64)


@dataclass(frozen=True, eq=False)
class Forest:
    """Boosted decision trees as plain numbers.

    Attributes:
        feature: int32 (n,), feature a node asks for, -1 for a leaf.
        threshold: float64 (n,): go left where the feature is at most this; the value of a leaf.
        left: int32 (n,), next node; the right one is `right`.
        right: int32 (n,).
        roots: int32 (t,), first node of each tree.
        bias: What the sum of the trees begins with.
    """

    feature: NDArray[np.int32]
    threshold: NDArray[np.float64]
    left: NDArray[np.int32]
    right: NDArray[np.int32]
    roots: NDArray[np.int32]
    bias: float

    def score(self, samples: NDArray[np.floating]) -> NDArray[np.float64]:
        """The sum of the trees float64 (n,) for samples (n, features).

        These are log-odds, if that is what the forest was fitted to.
        """
        odds, samples = np.empty(len(samples)), np.ascontiguousarray(samples)
        masks = self._single_masks if samples.dtype == np.float32 else self.masks
        if masks and len(samples) >= _MANY:
            log_odds_by_masks(samples, masks, odds)
        else:
            log_odds(samples, self.numbers, odds)
        return odds

    def probability(self, samples: NDArray[np.floating]) -> NDArray[np.float64]:
        """The logistic function of the score, float64 (n,)."""
        return logistic(self.score(samples))

    @cached_property
    def masks(self) -> LeafMasks | None:
        """The forest for many samples at once; None where a tree has more leaves than a mask has bits."""
        return leaf_masks(self.feature, self.threshold, self.left, self.right, self.roots, self.bias)

    @cached_property
    def _single_masks(self) -> LeafMasks | None:
        return self.masks and self.masks._replace(threshold=rounded_down(self.masks.threshold))

    @cached_property
    def numbers(self) -> Numbers:
        """The forest for kernels: feature, threshold or value, next nodes int (n, 2), roots, depths, bias.

        A leaf asks for feature 0 and leads to itself: every path through a tree can be as long as its
        longest one.
        """
        leaf = self.feature < 0
        itself = np.arange(len(leaf))
        children = np.stack((np.where(leaf, itself, self.left), np.where(leaf, itself, self.right)), axis=1)
        feature, roots = np.where(leaf, 0, self.feature), self.roots.astype(np.uint32)
        depth = _depths(leaf, children, self.roots)
        return feature.astype(np.uint32), self.threshold, children.astype(np.uint32), roots, depth, self.bias


def as_forest(model: object, *, double: bool = False) -> Forest:
    """The trees of scikit-learn's histogram boosting.

    Args:
        model: A fitted HistGradientBoostingClassifier of two classes, or a HistGradientBoostingRegressor.
        double: Keep all digits of the thresholds and values; otherwise they are what float32 holds.
    """
    parts, roots, begin = [], [], 0
    for (predictor,) in model._predictors:  # type: ignore[attr-defined]
        nodes = predictor.nodes
        leaf = nodes["is_leaf"].astype(bool)
        feature = np.where(leaf, -1, nodes["feature_idx"].astype(np.int64))
        threshold = np.where(leaf, nodes["value"], nodes["num_threshold"])
        left, right = (np.where(leaf, 0, nodes[side].astype(np.int64) + begin) for side in ("left", "right"))
        parts.append((feature, threshold, left, right))
        roots.append(begin)
        begin += len(nodes)
    feature, threshold, left, right = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Forest(
        feature=feature.astype(np.int32),
        threshold=threshold if double else threshold.astype(np.float32).astype(np.float64),
        left=left.astype(np.int32),
        right=right.astype(np.int32),
        roots=np.array(roots, np.int32),
        bias=float(np.ravel(model._baseline_prediction)[0]),  # type: ignore[attr-defined]
    )


@njit(cache=True, nogil=True)
def _depths(
    leaf: NDArray[np.bool_], children: NDArray[np.int64], roots: NDArray[np.int32]
) -> NDArray[np.int64]:
    """Length of the longest path through each tree."""
    out = np.zeros(len(roots), np.int64)
    waiting, level = np.empty(len(leaf) + 1, np.int64), np.zeros(len(leaf), np.int64)
    for t in range(len(roots)):
        # `waiting[:n]` are the nodes still to be looked at, whose levels are known.
        waiting[0], n = roots[t], 1
        level[roots[t]] = 0
        while n > 0:
            n -= 1
            i = waiting[n]
            out[t] = max(out[t], level[i])
            if not leaf[i]:
                for child in children[i]:
                    level[child] = level[i] + 1
                    waiting[n] = child
                    n += 1
    return out


@njit(cache=True, nogil=True)
def log_odds(x: NDArray[np.floating], forest: Numbers, odds: NDArray[np.float64]) -> None:
    """Write the sums of the trees, log-odds, of the samples `x` (n or more, features) to `odds` (n,).

    Tree by tree, so that each stays at hand, and as many steps for all samples, so that the descents overlap.
    """
    feature, threshold, children, roots, depths, bias = forest
    odds[:] = bias
    for t in range(len(roots)):
        for n in range(len(odds)):
            i = roots[t]
            for _ in range(depths[t]):
                i = children[i, np.uint32(0 if x[n, feature[i]] <= threshold[i] else 1)]
            odds[n] += threshold[i]
