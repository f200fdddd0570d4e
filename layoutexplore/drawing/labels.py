"""Places of the labels at the ends of lines."""

from __future__ import annotations

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
