"""Folds by building: which floor plans are of one building, and how buildings are dealt into folds.

What a name alone tells says `layoutexplore.maps.buildings.building_of`.
"""

from __future__ import annotations

import difflib
import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError
from layoutexplore.maps.floorplan import FloorPlan

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


def building_weights(building: NDArray[np.str_]) -> NDArray[np.float64]:
    """Weights float64 (n,) of samples, with the mean 1.

    The sum over a building grows with the square root of its number of samples.
    """
    _, which, counts = np.unique(building, return_inverse=True, return_counts=True)
    weights = 1.0 / np.sqrt(counts[which])
    return np.asarray(weights / weights.mean())


SAME_SIZE, SAME_NAME = 0.02, 0.9
"""Plans of one building: sides that differ by less than this share, or names that are as alike as this."""


def group_buildings(plans: Sequence[FloorPlan]) -> dict[str, str]:
    """The group of each plan's name: floors of one building, also where their names or outlines alone tell.

    Two buildings that are taken for one cost a little data and no honesty.

    Example:
        >>> from layoutexplore.maps.tracing import floorplan_from_ascii
        >>> plans = [floorplan_from_ascii(".a", name=name) for name in ("Roland1", "Roland2", "Ursy")]
        >>> group_buildings(plans)
        {'Roland1': 'Roland1', 'Roland2': 'Roland1', 'Ursy': 'Ursy'}
    """
    groups: dict[str, str] = {}
    for k, plan in enumerate(plans):
        same = [groups[other.name] for other in plans[:k] if _same_building(plan, other)]
        groups[plan.name] = same[0] if same else plan.name
        for name, group in groups.items():
            if group in same:
                groups[name] = groups[plan.name]
    return groups


def _same_building(plan: FloorPlan, other: FloorPlan) -> bool:
    if plan.building == other.building:
        return True
    name, second = (re.sub(r"[\d_]+", "", p.building.lower()) for p in (plan, other))
    if name and second and difflib.SequenceMatcher(None, name, second).ratio() >= SAME_NAME:
        return True
    sides = np.array([np.subtract(p.bounds[2:], p.bounds[:2]) for p in (plan, other)])
    return bool((np.abs(sides[0] - sides[1]) < SAME_SIZE * sides.max(0)).all() and sides.min() > 10.0)
