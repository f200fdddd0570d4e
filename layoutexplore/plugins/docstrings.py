"""What parameters mean, by the docstrings of the classes and functions that have them."""

from __future__ import annotations

import inspect
import re
from typing import Any

_SECTION = re.compile(r"^(?:Args|Attributes):\n(.*?)(?:\n(?=\S)|\Z)", re.MULTILINE | re.DOTALL)
_ENTRY = re.compile(r"^ {4}(\w+)(?: \([^)]*\))?: (.*(?:\n {8}.*)*)", re.MULTILINE)


def meanings(thing: Any) -> dict[str, str]:
    """By parameter, what the sections `Args:` and `Attributes:` of a docstring say, on one line each.

    Those of a class's bases and of its `__init__` count as well.

    Example:
        >>> from layoutexplore.layout.lines.segments import SegmentConfig
        >>> sorted(meanings(SegmentConfig))[:1] != []
        True
    """
    found: dict[str, str] = {}
    places = [thing, thing.__init__, *thing.__mro__] if inspect.isclass(thing) else [thing]
    for place in places:
        for section in _SECTION.findall(inspect.cleandoc(place.__doc__ or "")):
            for name, text in _ENTRY.findall(section):
                found.setdefault(name, " ".join(text.split()).rstrip("."))
    return found
