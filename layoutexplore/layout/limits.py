"""How much a method takes from a map before it leaves the weakest out: time and memory follow the cells.

A floor plan has few walls and rooms beside its cells, and stays far below; noise, checkerboards and meshes
have as many segments, lines and regions as cells, and tables of all pairs of them would outgrow any memory.
What has been left out is told in `Layout.warnings`.
"""

from __future__ import annotations

import math

Shape = tuple[int, int]
"""Rows and columns of a grid."""


def most_segments(shape: Shape) -> int:
    """So many of the longest wall segments are kept."""
    return max(20_000, shape[0] * shape[1] // 200)


def most_lines(shape: Shape) -> int:
    """So many of the heaviest lines are kept: their faces are at most half their square."""
    return max(300, math.isqrt(shape[0] * shape[1]) // 2)


def most_regions(shape: Shape) -> int:
    """Of so many regions or fewer the rooms of the lines are compared, in a table of all pairs."""
    return max(4096, 2 * math.isqrt(shape[0] * shape[1]))


MOST_PLACES = 250_000
"""Of so many places or fewer (0.4 m wide) the separator network is asked: more would take too much memory."""


def most_questions(shape: Shape) -> int:
    """So often the classifier is asked about a pair of regions."""
    return max(1_000_000, 2 * shape[0] * shape[1])


def cells_at_most(length: float, resolution: float, most: int) -> int:
    """A length in metres as a number of cells, at least 1 and at most `most`.

    Example:
        >>> cells_at_most(0.3, 0.1, 100), cells_at_most(0.3, 1e-9, 100), cells_at_most(0.3, 5.0, 100)
        (3, 100, 1)
    """
    return max(round(min(length / resolution, most)), 1)


def left_out(shape: Shape, segments: int, lines: int) -> tuple[str, ...]:
    """Warnings that segments or lines have reached their limits: what was weaker has been left out."""
    warnings = []
    if segments >= most_segments(shape):
        warnings.append(f"the shortest wall segments were left out: there are more than {segments}")
    if lines >= most_lines(shape):
        warnings.append(f"the weakest wall lines were left out: there are more than {lines}")
    return tuple(warnings)
