"""Which floors and maps are of the same building: by their names, and by their names and sizes."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from typing import Literal

import numpy as np

from layoutexplore.errors import checks_arguments
from layoutexplore.maps.floorplan import FloorPlan

NameKind = Literal["closed doors", "geojson", "kth", "painted rooms", "school"]

_FLOOR = {
    "closed doors": re.compile(r"[_-]?\d+$"),
    "geojson": re.compile(
        r"(^|[-_ ])(floor|level|og|ug|eg|gf)[-_ ]?-?\d+$"
        r"|(^|[-_ ])((floor|level)[-_ ]?)?(gf|eg)$"
        r"|(^|[-_ ])((kg|dg|[ub]\d+)|(ground|first|second|third|fourth)[-_ ]floor)$"
        r"|[-_ ]\d{1,2}[-_. ]*(og|ug)$"
        # A number alone is that of a floor, unless it is that of a building.
        r"|(?<!building)(?<!bldg)(?<!(?<![a-z])haus)(?<!(?<![a-z])house)(?<!block)[-_ ]\d{1,2}$",
        re.IGNORECASE,
    ),
    "kth": re.compile(r"_PLAN\d+$"),
    "school": re.compile(r"[_ ]*(\d+|(ground|first|second|third)_floor)?[_ ]*$", re.IGNORECASE),
}
_FILLERS = {"scan", "map", "lab", "building", "plan", "floor", "furnitures", "furniture"}


@checks_arguments
def building_of(name: str, kind: NameKind) -> str:
    """The building that the name of a floor or map tells of; "" where it tells of none.

    The kinds differ because published figures hold out by them: the folds of `evaluate segmentation` by
    "painted rooms" (a number is part of the name: Freiburg 52, 79 and 101 are three buildings), the held-out
    scores of rooms behind closed doors by "closed doors" (a number at the end is a floor), and those of the
    predictor `layout` by "school" and "kth" (whose plans `group_buildings` then compares, too). Files of a
    GIS ("geojson") end with a number, or with a floor in English or German.

    Args:
        name: Of the file, without its ending.
        kind: Where the name comes from.

    Example:
        >>> [building_of(name, "painted rooms") for name in ("Freiburg79_scan", "freiburg_building79")]
        ['freiburg79', 'freiburg79']
        >>> building_of("map12", "painted rooms"), building_of("battle_2", "closed doors")
        ('', 'battle')
        >>> building_of("rock_island_ground_floor", "school"), building_of("50010535_PLAN2", "kth")
        ('rock_island', '50010535')
        >>> [building_of(name, "geojson") for name in ("hall-floor-gf", "hall 1.OG", "hall_2", "house_2")]
        ['hall', 'hall', 'hall', 'house_2']
    """
    if kind == "painted rooms":
        words = [w for w in re.findall(r"[a-z]+|\d+", name.lower()) if w not in _FILLERS]
        return "".join(words) if any(w.isalpha() for w in words) else ""
    return _FLOOR[kind].sub("", name)


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
