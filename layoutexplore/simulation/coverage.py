"""How much of what can be seen has been seen."""

from __future__ import annotations

import numpy as np
from numba import njit

from layoutexplore.errors import checks_making
from layoutexplore.grids.arrays import Cells, Ints, Labels, Mask
from layoutexplore.grids.boxes import Box
from layoutexplore.grids.grid import UNKNOWN


@checks_making
class TargetCoverage:
    """The share of a target area that is known; it only grows.

    Args:
        target: bool (rows, cols), the cells that have to be seen.
        rooms: int16 or int32 (rows, cols), C-contiguous, the room of each cell, 0 for none.

    Attributes:
        unseen: bool (rows, cols), the cells of the target that have not been seen.
        target_count: Number of cells of the target.
        unseen_count: Number of those that have not been seen.
        rooms: As given.
        unseen_in: int64 (rooms + 1,), the same by room; entry 0 counts those that lie in no room.

    Example:
        >>> coverage = TargetCoverage(np.array([[True, True], [False, True]]), np.array([[1, 1], [0, 2]]))
        >>> coverage.update(np.array([[0, -1], [0, -1]], np.int8), (0, 2, 0, 1))
        >>> round(coverage.share, 3), coverage.unseen_in.tolist()
        (0.333, [0, 1, 1])
    """

    def __init__(self, target: Mask, rooms: Labels) -> None:
        self.unseen = target.copy()
        self.target_count = self.unseen_count = int(np.count_nonzero(target))
        self.rooms = np.ascontiguousarray(rooms)
        self.unseen_in = np.bincount(self.rooms[target], minlength=int(self.rooms.max()) + 1)

    @property
    def share(self) -> float:
        """Seen cells over all cells of the target, 0..1."""
        return 1.0 - self.unseen_count / self.target_count

    def update(self, cells: Cells, box: Box) -> None:
        """Count the target's cells that are known now, in the box of the grid int8 (rows, cols)."""
        self.unseen_count -= strike_seen(cells, self.unseen, self.rooms, self.unseen_in, *box)


@njit(cache=True, nogil=True)
def strike_seen(
    cells: Cells, unseen: Mask, rooms: Labels, unseen_in: Ints, row0: int, row1: int, col0: int, col1: int
) -> int:
    """How many unseen cells are known now; they leave `unseen` and the counts of their rooms."""
    count = 0
    for row in range(row0, row1):
        for col in range(col0, col1):
            if unseen[row, col] and cells[row, col] != UNKNOWN:
                unseen[row, col] = False
                unseen_in[rooms[row, col]] -= 1
                count += 1
    return count
