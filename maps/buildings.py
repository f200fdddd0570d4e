"""Which building a name tells of: one rule, with what stands for a floor or a scan in each kind of name."""

from __future__ import annotations

import re
from typing import Literal

NameKind = Literal["closed doors", "kth", "painted rooms", "school"]

_FLOOR = {
    "closed doors": re.compile(r"[_-]?\d+$"),
    "kth": re.compile(r"_PLAN\d+$"),
    "school": re.compile(r"[_ ]*(\d+|(ground|first|second|third)_floor)?[_ ]*$", re.IGNORECASE),
}
_FILLERS = {"scan", "map", "lab", "building", "plan", "floor", "furnitures", "furniture"}


def building_of(name: str, kind: NameKind) -> str:
    """The building that the name of a floor or map tells of; "" where it tells of none.

    The kinds differ because published figures hold out by them: the folds of `evaluate segmentation` by
    "painted rooms" (a number is part of the name: Freiburg 52, 79 and 101 are three buildings), the held-out
    scores of rooms behind closed doors by "closed doors" (a number at the end is a floor), and those of the
    predictor `layout` by "school" and "kth" (whose plans `layoutexplore.training.folds.group_buildings` then
    compares, too).

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
    """
    if kind == "painted rooms":
        words = [w for w in re.findall(r"[a-z]+|\d+", name.lower()) if w not in _FILLERS]
        return "".join(words) if any(w.isalpha() for w in words) else ""
    return _FLOOR[kind].sub("", name)
