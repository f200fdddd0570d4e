"""The connected-component clutter filter: walls in pieces stay, what floats goes."""

from __future__ import annotations

import numpy as np
import pytest

from layoutexplore.grids.arrays import Mask
from layoutexplore.layout.merging.walls.wall_components import structural_components

NOTHING = np.zeros((80, 200), np.bool_)


def structural(occupied: Mask, gap: float, resolution: float = 0.05) -> Mask:
    return structural_components(occupied, np.zeros_like(occupied), resolution, gap=gap, area=1.0, length=2.0)


def pierced_wall(hole: int) -> Mask:
    """A wall of 8 m and a cell, with a hole every metre."""
    wall = NOTHING.copy()
    wall[40, 20:180] = True
    for column in range(40, 180, 20):
        wall[40, column : column + hole] = False
    return wall


def test_a_wall_in_pieces_is_a_wall_as_far_as_its_holes_are_small() -> None:
    for hole in (1, 2):
        wall = pierced_wall(hole)
        assert not structural(wall, 0.0).any()
        assert np.array_equal(structural(wall, 0.1), wall)
    assert not structural(pierced_wall(6), 0.1).any()


def test_things_that_stand_apart_are_clutter_with_and_without_the_gap() -> None:
    things = pierced_wall(1)
    wall = things.copy()
    things[20:30, 60:70] = things[60:62, 100:130] = True
    assert np.array_equal(structural(things, 0.1), wall)


@pytest.mark.parametrize("length", [39, 41])
def test_the_gap_makes_nothing_longer_than_it_is(length: int) -> None:
    line = NOTHING.copy()
    line[40, 20 : 20 + length] = True
    assert structural(line, 0.0).any() == structural(line, 0.1).any() == (length > 40)


def test_at_the_border_of_a_map_a_wall_is_as_long_as_elsewhere() -> None:
    wall = NOTHING.copy()
    wall[0, :60] = True
    assert np.array_equal(structural(wall, 0.1), wall)
