"""Files of whole buildings: which floors are in them, and how one is named."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

from layoutexplore.errors import MapError, checks_arguments, shortened

_RANGE = re.compile(r"\s*(-?\d+(?:\.\d+)?)\s*(?:-\s*(-?\d+(?:\.\d+)?)\s*)?")

_MOST_FLOORS, _HIGHEST = 200, 1e6
"""Floors that one text names at most; and no floor has a number above this, or below its negative."""


@checks_arguments
def choose_level(path: Path, level: str, levels: Sequence[str]) -> str:
    """The floor of a building that a word means.

    Args:
        path: The file, for the message.
        level: A name, or what it ends with after a "/"; empty where there is only one floor.
        levels: The names there are.

    Raises:
        MapError: No floor or several are meant; the names are listed.

    Example:
        >>> choose_level(Path("a.osm"), "1", ["0", "1"]), choose_level(Path("b"), "2", ["x/1", "x/2"])
        ('1', 'x/2')
    """
    if not levels:
        raise MapError(f"{path}: no floor in this file")
    if not level and len(levels) == 1:
        return levels[0]
    exact = [name for name in levels if name == level]
    meant = exact or [name for name in levels if level and name.rpartition("/")[2] == level]
    if len(meant) == 1:
        return meant[0]
    problem = f"there is no floor {shortened(level)}" if level else "this building has several floors"
    if meant:
        problem = f"several floors are called {shortened(level)}"
    names = [f"{path}#{name[:100]}" for name in levels[:20]] + ["..."] * (len(levels) > 20)
    raise MapError(f"{path}: {problem}: name one of {', '.join(names)}")


@checks_arguments
def numbers_of(text: str) -> frozenset[str]:
    """The floors that a `level` of OpenStreetMap means: "1", "0;2", "-1-3".

    Example:
        >>> sorted(numbers_of("0-2;5")), sorted(numbers_of("-1-0")), numbers_of("-0"), numbers_of("roof")
        (['0', '1', '2', '5'], ['-1', '0'], frozenset({'0'}), frozenset())
    """
    return _numbers_of(text)


@lru_cache(maxsize=1024)  # all rooms of a floor say the same
def _numbers_of(text: str) -> frozenset[str]:
    found: list[str] = []
    for part in text.split(";", _MOST_FLOORS)[:_MOST_FLOORS]:
        match = _RANGE.fullmatch(part)
        if not match:
            continue
        first = float(match[1])
        last = float(match[2]) if match[2] else first
        # Beyond 2**53 a number plus one is the same number, and nobody would ever arrive.
        while -_HIGHEST <= first <= min(last, _HIGHEST) and len(found) < _MOST_FLOORS:
            found.append(f"{first + 0.0:g}")  # -0 is 0
            first += 1.0
    return frozenset(found)
