"""Folds by building: one rule for which floors are of the same building, one for dealing them."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.painted_rooms import Case


def deal_folds(cases: Sequence[Case], folds: int) -> dict[str, int]:
    """A fold for each building: the buildings with most maps first, each into the fold with the fewest maps.

    Raises:
        ConfigError: Fewer than two folds or fewer buildings than folds.
    """
    counts: dict[str, int] = {}
    for case in cases:
        counts[case.building] = counts.get(case.building, 0) + 1
    if not 2 <= folds <= len(counts):
        raise ConfigError(
            f"folds must be at least 2 and at most one a building: got {folds} for {len(counts)} building(s)"
        )
    sizes, dealt = [0] * folds, {}
    for building in sorted(counts, key=lambda b: (-counts[b], b)):
        dealt[building] = sizes.index(min(sizes))
        sizes[dealt[building]] += counts[building]
    return dealt


Progress = Callable[[str, int, int], None]
"""Told what is being done, how often it has been done, and how often it will be."""


def _silent(what: str, done: int, total: int) -> None:
    """Progress that nobody looks at."""


def deal_groups(groups: Sequence[str], folds: int) -> dict[str, int]:
    """A fold for each group of buildings: by name in turn, for what comes from one source often has names that sort together."""
    return {name: k % folds for k, name in enumerate(sorted(set(groups)))}


def building_weights(building: NDArray[np.str_]) -> NDArray[np.float64]:
    """Weights float64 (n,): a building with many samples counts more than one with few, but not as many times more."""
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
        >>> group_buildings([floorplan_from_ascii(".a", name=name) for name in ("Roland1", "Roland2", "Ursy")])
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


def building_of(name: str) -> str:
    """The building of a floor's name: what is left without a number at its end."""
    return re.sub(r"[_-]?\d+$", "", name)
