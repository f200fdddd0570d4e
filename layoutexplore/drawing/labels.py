"""Places of the labels at the ends of lines."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

LABEL_GAP = 6.0
"""Least percent of a chart's height between labels of lines."""


def label_places(places: Sequence[float], gap: float = LABEL_GAP) -> list[float]:
    """Places of labels, `gap` apart and as near as can be to where they belong, in the order given.

    Labels that would overlap form a group around the mean of their places, as in isotonic regression; none
    stands above the frame.

    Args:
        places: From the top of the frame, in percent of it or pixels.
        gap: Least distance of two labels, in the same unit.

    Example:
        >>> label_places([0.0, 1.0, 50.0], 6.0)
        [0.0, 6.0, 50.0]
    """
    groups: list[tuple[float, list[int]]] = []  # mean of the places less the labels above, and who
    for count, k in enumerate(sorted(range(len(places)), key=places.__getitem__)):
        groups.append((places[k] - gap * count, [k]))
        while len(groups) > 1 and groups[-2][0] > groups[-1][0]:
            (upper, above), (lower, below) = groups[-2:]
            mean = (upper * len(above) + lower * len(below)) / (len(above) + len(below))
            groups[-2:] = [(mean, above + below)]
    found = [0.0] * len(places)
    for count, (start, k) in enumerate((start, k) for start, members in groups for k in members):
        found[k] = max(start, 0.0) + gap * count
    return found


def label_gap(count: int, gap: float = LABEL_GAP) -> float:
    """Percent of a chart's height between so many labels: less where there are many, so that all have room.

    Whoever draws many has to make the chart higher.

    Example:
        >>> label_gap(10), label_gap(40)
        (6.0, 2.5)
    """
    return min(gap, 100.0 / max(count, 1))


SEEN_WHOLE, BEGINNING, END = 12, 3, 8
"""Letters of a name that is shown whole everywhere; of a longer one at least so many of its beginning, and of
its end."""


def names_apart(names: Sequence[str]) -> dict[str, str]:
    """What is shown of names where there is room for their beginnings and ends.

    Long names that look alike are shown by what tells them apart, and those of files without their folders
    where that does.

    Args:
        names: The names.

    Example:
        >>> names_apart(["nearest", "home/mine.py:A:area=2,sure=1", "home/mine.py:B:area=2,sure=1"])
        {'nearest': 'nearest', 'home/mine.py:A:area=2,sure=1': '…A…', 'home/mine.py:B:area=2,sure=1': '…B…'}
    """
    shown = {name: name for name in names}
    alike: dict[tuple[str, str], list[str]] = {}
    for name in shown:
        if len(name) > SEEN_WHOLE:
            alike.setdefault((name[:BEGINNING], name[-END:]), []).append(name)
    for group in alike.values():
        if len(group) < 2:
            continue
        parts = [re.split(r"(?<=[/:,;=])", name) for name in group]
        before, most = _same(parts), min(map(len, parts))
        behind = min(_same([name[::-1] for name in parts]), most - before - 1)
        for name, told in zip(group, parts, strict=True):
            middle = "".join(told[before : len(told) - behind])
            shown[name] = "…" * (before > 0) + (middle[:-1] + "…" if behind and middle else middle)
    often = Counter(shown.values())
    return {name: text if often[text] == 1 else name for name, text in shown.items()}


def _same(names: list[list[str]]) -> int:
    """How many parts all names begin with, but the last one of none."""
    most = min(map(len, names)) - 1
    return next((k for k in range(most) if len({name[k] for name in names}) > 1), most)
