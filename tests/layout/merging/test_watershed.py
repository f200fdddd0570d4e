"""Watershed basins of the distance to the nearest wall."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis.extra import numpy as hnp

from layoutexplore.layout.merging.watershed import closed_space, watershed_basins


@settings(max_examples=40, deadline=None)
@given(hnp.arrays(np.bool_, (12, 14)))
def test_basins_cover_the_open_cells(blocked: np.ndarray) -> None:
    labels = watershed_basins(blocked, 0.1, share=0.85, wide=1.5)
    assert ((labels > 0) == ~blocked).all()
    assert sorted(np.unique(labels[labels > 0])) == list(range(1, labels.max() + 1))


def test_a_passage_parts_two_basins_and_a_wide_one_does_not() -> None:
    blocked = np.ones((42, 82), bool)
    blocked[1:41, 1:40] = False
    blocked[1:41, 42:81] = False
    blocked[18:24, 40:42] = False
    assert watershed_basins(blocked, 0.1, share=0.85, wide=3.0).max() == 2
    blocked[1:41, 40:42] = False
    assert watershed_basins(blocked, 0.1, share=0.85, wide=3.0).max() == 1


def test_no_basin_runs_along_the_wall_of_another_room() -> None:
    """A hall, a corridor and a room that lie flush: along their common wall all distances are equal."""
    blocked = np.ones((50, 130), np.bool_)
    blocked[1:41, 1:41] = False  # the hall
    blocked[1:13, 41:101] = False  # the corridor
    blocked[1:21, 101:129] = False  # the room
    hall, room = np.zeros_like(blocked), np.zeros_like(blocked)
    hall[1:41, 1:35] = room[1:21, 107:129] = True
    for turns in range(4):
        for mirrored in (False, True):
            ways = [np.rot90(mask, turns) for mask in (blocked, hall, room)]
            turned, in_hall, in_room = (mask[::-1] if mirrored else mask for mask in ways)
            basins = watershed_basins(turned, 0.1, share=0.85, wide=9.0)
            assert basins.max() == 2
            assert {len(np.unique(basins[mask])) for mask in (in_hall, in_room)} == {1}


def test_chinks_of_unknown_space_are_closed_and_wide_ones_stay() -> None:
    cells = np.zeros((60, 60), np.int8)
    cells[:, 20:24] = -1
    cells[:, 40:55] = -1
    space = closed_space(cells, 0.05, 0.25)
    assert space[30, 22] and not space[30, 47]
