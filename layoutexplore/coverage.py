"""How much of what can be seen has been seen."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Box = tuple[int, int, int, int]
"""(row0, row1, col0, col1), half open; empty where row0 >= row1."""


class Coverage:
    """The share of a target area that is known; it only grows.

    Args:
        target: bool (rows, cols), the cells that have to be seen.

    Attributes:
        unseen: bool (rows, cols), the cells of the target that have not been seen.
        target_count: Number of cells of the target.
        unseen_count: Number of those that have not been seen.

    Example:
        >>> coverage = Coverage(np.array([[True, True], [False, True]]))
        >>> coverage.update(np.array([[0, -1], [0, -1]], np.int8), (0, 2, 0, 1))
        >>> round(coverage.share, 3)
        0.333
    """

    def __init__(self, target: NDArray[np.bool_]) -> None:
        self.unseen = target.copy()
        self.target_count = self.unseen_count = int(np.count_nonzero(target))

    @property
    def share(self) -> float:
        """Seen cells over all cells of the target, 0..1."""
        return 1.0 - self.unseen_count / self.target_count

    def update(self, cells: NDArray[np.int8], box: Box) -> None:
        """Count the target's cells that are known now, inside the box of the grid int8 (rows, cols) that changed."""
        self.unseen_count -= strike_seen(cells, self.unseen, *box)


def union(a: Box, b: Box) -> Box:
    """The smallest box around two; an empty one does not count.

    Example:
        >>> union((0, 0, 0, 0), (2, 3, 4, 5)), union((0, 1, 0, 1), (2, 3, 4, 5))
        ((2, 3, 4, 5), (0, 3, 0, 5))
    """
    if a[0] >= a[1]:
        return b
    if b[0] >= b[1]:
        return a
    return min(a[0], b[0]), max(a[1], b[1]), min(a[2], b[2]), max(a[3], b[3])


@njit(cache=True, nogil=True)
def strike_seen(cells: NDArray[np.int8], unseen: NDArray[np.bool_], row0: int, row1: int, col0: int, col1: int) -> int:
    """How many unseen cells are known now; they are struck from `unseen`."""
    count = 0
    for row in range(row0, row1):
        for col in range(col0, col1):
            if unseen[row, col] and cells[row, col] != -1:
                unseen[row, col] = False
                count += 1
    return count
