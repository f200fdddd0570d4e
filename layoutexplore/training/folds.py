"""Folds by building: how buildings are dealt into folds, and how much each weighs.

Which floors are of one building says `layoutexplore.maps.buildings`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError
from layoutexplore.grids.arrays import Floats

Progress = Callable[[str, int, int], None]
"""(what is being done, how often it has been done, how often it will be) -> None."""


def silent(what: str, done: int, total: int) -> None:
    """Progress that shows nothing."""


def deal_folds(
    buildings: Iterable[str], folds: int, order: Literal["size", "name", "given"] = "size"
) -> dict[str, int]:
    """A fold for each building.

    The orders differ because published figures depend on them: "size" those of
    `evaluate segmentation --folds`, "name" those of `evaluate train-predictor --folds`, "given" those of
    `evaluate closed-doors --folds`.

    Args:
        buildings: One entry a map.
        folds: Number of folds.
        order: "size": the buildings with most maps first, each into the fold with the fewest maps. "name": by
            name in turn, for what comes from one source often has names that sort together. "given": in turn
            as they come.

    Example:
        >>> deal_folds("cabbaa", 2), deal_folds("cabbaa", 2, "name"), deal_folds("cabbaa", 2, "given")
        ({'a': 0, 'b': 1, 'c': 1}, {'a': 0, 'b': 1, 'c': 0}, {'c': 0, 'a': 1, 'b': 0})
    """
    counts = Counter(buildings)
    if order != "size":
        return {name: k % folds for k, name in enumerate(counts if order == "given" else sorted(counts))}
    sizes, dealt = [0] * folds, {}
    for building in sorted(counts, key=lambda b: (-counts[b], b)):
        dealt[building] = sizes.index(min(sizes))
        sizes[dealt[building]] += counts[building]
    return dealt


def check_folds(folds: int, buildings: Iterable[str]) -> None:
    """Raise `ConfigError` unless there are at least two folds and at most one a building."""
    count = len(set(buildings))
    if not 2 <= folds <= count:
        raise ConfigError(
            f"folds must be at least 2 and at most one a building: got {folds} for {count} building(s)"
        )


def building_weights(building: NDArray[np.str_]) -> Floats:
    """Weights float64 (n,) of samples, with the mean 1.

    The sum over a building grows with the square root of its number of samples.
    """
    _, which, counts = np.unique(building, return_inverse=True, return_counts=True)
    weights = 1.0 / np.sqrt(counts[which])
    return np.asarray(weights / weights.mean())
