"""Shapes of rooms, filled up to walls and other rooms."""

from __future__ import annotations

import numpy as np

from layoutexplore.layout.doorways import doorway_regions
from layoutexplore.predictors.room_completion import Shape, complete_regions


def test_a_shape_is_filled_up_to_walls_and_other_rooms() -> None:
    cells = np.full((6, 12), -1, np.int8)
    cells[:, :3] = 0
    cells[:, 9] = 100
    regions = doorway_regions(cells, 0.5)
    rooms = complete_regions(cells, regions, {1: Shape(0, 2, np.ones((6, 10), np.bool_))})
    assert (rooms.room_ids[:, :9] == 1).all() and (rooms.room_ids[:, 10:] != 1).all()
