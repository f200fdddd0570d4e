"""Shapes of rooms, filled up to walls and other rooms."""

from __future__ import annotations

import numpy as np

from layoutexplore.layout.doorways import Regions, doorway_regions
from layoutexplore.predictors.room_completion import Shape, complete_regions, complete_within


def test_a_shape_is_filled_up_to_walls_and_other_rooms() -> None:
    cells = np.full((6, 12), -1, np.int8)
    cells[:, :3] = 0
    cells[:, 9] = 100
    regions = doorway_regions(cells, 0.5)
    rooms = complete_regions(cells, regions, {1: Shape(0, 2, np.ones((6, 10), np.bool_))})
    assert (rooms.room_ids[:, :9] == 1).all() and (rooms.room_ids[:, 10:] != 1).all()


def test_where_no_two_shapes_overlap_one_array_says_how_far_rooms_reach() -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        cells = rng.choice(np.array([-1, -1, 0, 100], np.int8), (14, 17))
        reach = np.kron(rng.integers(0, 4, (7, 9)), np.ones((2, 2)))[:, :17].astype(np.int32)
        seen = np.where(cells == 0, reach, np.int32(0))
        shapes = {k: Shape(0, 0, reach == k) for k in (1, 2, 3)}
        expected = complete_regions(cells, Regions(seen, 3, np.zeros(cells.shape, np.uint8), 0.1), shapes)
        found = complete_within(cells, seen, reach, 4)
        assert (found.room_ids == expected.room_ids).all() and found.rest == expected.rest
        assert (found.passable == expected.passable).all()
