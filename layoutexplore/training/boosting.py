"""Gradient-boosted trees: every forest that ships is fitted here, by scikit-learn's histogram boosting."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from layoutexplore.models.forest import Forest, as_forest


@dataclass(frozen=True, kw_only=True)
class BoostingConfig:
    """How trees are grown.

    Attributes:
        trees: Trees of the forest.
        leaves: Leaves of a tree at most.
        rate: Learning rate.
        leaf_samples: Samples of a leaf at least.
        penalty: L2 regularisation.
        feature_share: Share of the features that a split may choose from.
        monotonic: By feature 1 where more of it can only raise the score, -1 where only lower it, else 0;
            none is bound when None.
        seed: Of the features that splits may choose from.
    """

    trees: int
    leaves: int
    rate: float
    leaf_samples: int
    penalty: float = 3.0
    feature_share: float = 1.0
    monotonic: tuple[int, ...] | None = None
    seed: int = 0


def fit_forest(
    features: NDArray[np.floating],
    target: NDArray[np.generic],
    config: BoostingConfig,
    weights: NDArray[np.floating] | None = None,
    *,
    double: bool = False,
) -> Forest:
    """Fit a forest: its score is log-odds for a boolean target, else the number itself.

    Args:
        features: (n, features).
        target: bool (n,) for two classes, or numbers (n,).
        config: How the trees are grown.
        weights: (n,) of the samples; all alike when None.
        double: As for `as_forest`.
    """
    from sklearn.ensemble import HistGradientBoostingClassifier, HistGradientBoostingRegressor

    two_classes = target.dtype == np.bool_
    model = (HistGradientBoostingClassifier if two_classes else HistGradientBoostingRegressor)(
        max_iter=config.trees,
        learning_rate=config.rate,
        max_leaf_nodes=config.leaves,
        min_samples_leaf=config.leaf_samples,
        l2_regularization=config.penalty,
        max_features=config.feature_share,
        monotonic_cst=config.monotonic and list(config.monotonic),
        early_stopping=False,
        random_state=config.seed,
    )
    return as_forest(model.fit(features, target, sample_weight=weights), double=double)


def fit_mean_forest(
    features: NDArray[np.floating],
    target: NDArray[np.generic],
    config: BoostingConfig,
    weights: NDArray[np.floating],
    forests: int,
) -> Forest:
    """The mean of several forests of double precision, which depends less on the seed than each of them.

    As `fit_forest`, with numbers rounded as they are written. Configs of different seeds share no forest.
    """
    seeds = range(forests * config.seed, forests * (config.seed + 1))
    forest = mean_forest(
        [fit_forest(features, target, replace(config, seed=k), weights, double=True) for k in seeds]
    )
    return rounded_forest(forest)


def rounded_forest(forest: Forest) -> Forest:
    """The forest with numbers of six decimals, as they are written."""
    return replace(forest, threshold=forest.threshold.round(6), bias=round(forest.bias, 6))


def mean_forest(forests: Sequence[Forest]) -> Forest:
    """The classifier whose log-odds are the mean of those of others."""
    begin = np.cumsum([0, *(len(f.feature) for f in forests)])
    parts = list(zip(forests, begin.tolist(), strict=False))
    return Forest(
        feature=np.concatenate([f.feature for f in forests]),
        threshold=np.concatenate(
            [np.where(f.feature < 0, f.threshold / len(forests), f.threshold) for f in forests]
        ),
        left=np.concatenate([f.left + n for f, n in parts]).astype(np.int32),
        right=np.concatenate([f.right + n for f, n in parts]).astype(np.int32),
        roots=np.concatenate([f.roots + n for f, n in parts]).astype(np.int32),
        bias=float(np.mean([f.bias for f in forests])),
    )
