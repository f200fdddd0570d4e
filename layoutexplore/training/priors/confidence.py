"""Fits the confidence of registered prior plans: a logistic model with a ridge, by Newton's method."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Sequence

import numpy as np

from layoutexplore.errors import ConfigError
from layoutexplore.grids.arrays import Floats, Mask
from layoutexplore.priors.confidence import FEATURES, ConfidenceModel

RIDGE = 1.0
"""Penalty of a standardised weight's square, in units of one example's log-likelihood."""

MIRRORED_WEIGHT = 0.7
"""What an example with a mirrored plan counts: they are rarer on walls than in studies."""

LEARNT_UNTIL = 0.5
"""Share of the floor seen up to which registrations are learnt from: later, hardly one is in doubt."""

ROUNDS = 30


def fit_confidence(features: Floats, right: Mask, weights: Floats | None = None) -> ConfidenceModel:
    """The model that tells right from wrong registrations.

    Args:
        features: float64 (n, features), as of `layoutexplore.priors.confidence.features_of`.
        right: bool (n,).
        weights: float64 (n,), of the examples; 1 each when None.

    Raises:
        ConfigError: There are no examples of both kinds, or they have other features.
    """
    if features.ndim != 2 or features.shape[1] != len(FEATURES) or len(right) != len(features):
        raise ConfigError(f"needs (n, {len(FEATURES)}) features and n outcomes, got {features.shape}")
    if right.all() or not right.any():
        raise ConfigError("needs right and wrong registrations: explore with other prior plans, too")
    mean, scale = features.mean(axis=0), np.maximum(features.std(axis=0), 1e-6)
    rows = np.column_stack([np.clip((features - mean) / scale, -4.0, 4.0), np.ones(len(features))])
    penalty = np.append(np.full(len(FEATURES), RIDGE), 0.0)
    count = np.ones(len(rows)) if weights is None else weights
    found = np.zeros(rows.shape[1])
    for _ in range(ROUNDS):
        probability = 1.0 / (1.0 + np.exp(-np.clip(rows @ found, -30.0, 30.0)))
        slope = rows.T @ (count * (right - probability)) - penalty * found
        curvature = (rows * (count * probability * (1 - probability))[:, None]).T @ rows + np.diag(
            penalty + 1e-9
        )
        found = found + np.linalg.solve(curvature, slope)
    return ConfidenceModel(mean, scale, found)


def example_weights(moments: Sequence[Hashable], mirrored: Mask) -> Floats:
    """What each example counts, float64 (n,): those of one moment together as much as those of any other.

    Args:
        moments: What tells apart explorations, and how much of the floor had been seen.
        mirrored: bool (n,), whether the plan is drawn as in a mirror.
    """
    counts = Counter(moments)
    even = np.array([1.0 / counts[moment] for moment in moments])
    return np.asarray(np.where(mirrored, MIRRORED_WEIGHT, 1.0) * even)


def held_out_confidence(
    features: Floats, right: Mask, buildings: np.ndarray, weights: Floats | None = None
) -> Floats:
    """Confidences float64 (n,), each by a model that was fitted to the other buildings.

    Args:
        features: float64 (n, features).
        right: bool (n,).
        buildings: (n,), what tells buildings apart.
        weights: float64 (n,), of the examples; 1 each when None.

    Raises:
        ConfigError: There is one building only, or the others have no right or no wrong registration.
    """
    if len(np.unique(buildings)) < 2:
        raise ConfigError("a held-out score needs floor plans of two buildings at least")
    found = np.zeros(len(features))
    for building in np.unique(buildings):
        mine = buildings == building
        counts = None if weights is None else weights[~mine]
        found[mine] = fit_confidence(features[~mine], right[~mine], counts).probability(features[mine])
    return found
