"""What is known around a closed door: walls and their thickness."""

from __future__ import annotations

import numpy as np

from layoutexplore.closed_doors.scene import room_space, wall_thickness
from layoutexplore.grids.grid import UNKNOWN
from tests.closed_doors.cases import WALL, office


def test_walls_keep_their_thickness() -> None:
    seen, _ = office((2,))
    assert wall_thickness(seen, 0.05) == WALL
    space = room_space(seen, 3)
    slow = np.zeros_like(space)
    for row, col in np.argwhere(seen == UNKNOWN):
        slow[row, col] = (seen[max(row - 2, 0) : row + 3, max(col - 2, 0) : col + 3] == UNKNOWN).all()
    assert np.array_equal(space, slow)
