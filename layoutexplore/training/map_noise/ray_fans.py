"""Training the classifier of regions outside the building, on simulated maps whose rooms are known.

A region most of whose known free cells lie in no room was painted by beams that left the building. Maps with
the noise of recorded ones have glass and open doors to pass; those of a lidar alone have not, and teach that
rooms seen in part are rooms all the same. Every map of a kind weighs the same, and each of its regions by the
root of its area, the more the purer it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from layoutexplore.errors import ConfigError
from layoutexplore.grids.arrays import Floats
from layoutexplore.models.forest import Forest
from layoutexplore.training.boosting import BoostingConfig, fit_mean_forest
from layoutexplore.training.folds import Progress, silent
from layoutexplore.training.map_noise.examples import simulated_examples
from layoutexplore.training.merging_examples import Example

LIDAR_WEIGHT = 1 / 40
"""Weight of a map of a lidar alone, where one with the noise of recorded maps weighs 1."""

PURITY = 0.2
"""Weight of a region half in rooms and half in none; of a pure one it is 1 more."""

FORESTS = 3
"""The classifier is the mean of so many forests, which depends less on the seed than each of them."""

GROWTH = BoostingConfig(trees=40, leaves=12, rate=0.14, leaf_samples=30, penalty=5.0, feature_share=0.5)
"""How the trees of each are grown."""


def fan_samples(example: Example) -> tuple[Floats, Floats, Floats]:
    """What a map teaches: features (n, features), share of cells in no room (n,), and weights (n,).

    Regions without a known free cell teach nothing. The weights of a noisy map add up to about 1.
    """
    known = example.rooms.sum(axis=1)
    some = known > 0
    some[0] = False
    outside = example.rooms[some, 0] / known[some]
    root = np.sqrt(known[some])
    weights = root / max(float(root.sum()), 1.0) * (PURITY + 2 * np.abs(outside - 0.5))
    return example.features[some], outside, weights * (1.0 if example.noisy else LIDAR_WEIGHT)


def train_fan_forest(examples: Sequence[Example], seed: int = 0) -> Forest:
    """Train the classifier.

    Args:
        examples: Simulated maps, some of them with regions outside the building.
        seed: Of the features that splits may choose from.

    Raises:
        ConfigError: No region lies outside the building, or none inside.
    """
    parts = [fan_samples(example) for example in examples]
    if not parts:
        raise ConfigError("there is no map to learn ray fans from: simulate more of them, or of other plans")
    features, outside, weights = (np.concatenate(column) for column in zip(*parts, strict=True))
    is_outside = outside > 0.5
    if is_outside.all() or not is_outside.any():
        raise ConfigError(
            f"all {len(outside)} regions of {len(examples)} maps are of one kind: simulate more"
        )
    growth = replace(GROWTH, seed=seed)
    return fit_mean_forest(features, is_outside, growth, weights / weights.mean(), FORESTS)


def train_on_simulated_maps(
    count: int, plans: Sequence[str], *, seed: int = 0, progress: Progress = silent
) -> Forest:
    """The classifier that ships, of the simulated maps that the merging of regions is trained on as well."""
    return train_fan_forest(simulated_examples(count, tuple(plans), progress=progress), seed)
