"""Inside and outside of a building in a picture."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.grids.outside import find_outside, without_outside


def house(door: int = 0, *, margin: int = 20) -> np.ndarray:
    """A house of 6 x 4 m at 0.05 m on white paper, a door of so many cells in its lower wall."""
    cells = np.zeros((80 + 2 * margin, 120 + 2 * margin), np.int8)
    cells[margin : margin + 80, margin : margin + 120] = 100
    cells[margin + 3 : margin + 77, margin + 3 : margin + 117] = 0
    cells[margin : margin + 3, margin + 50 : margin + 50 + door] = 0
    return cells


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 45), st.integers(2, 60))
def test_the_inside_stays_and_the_paper_goes(door: int, margin: int) -> None:
    """Whatever the door (up to 2.25 m) and the margin."""
    cells = house(door, margin=margin)
    inside = np.zeros(cells.shape, np.bool_)
    inside[margin + 3 : margin + 77, margin + 3 : margin + 117] = True
    free = without_outside(OccupancyGrid(cells, 0.05)).free
    assert free[inside].mean() > 0.99
    assert free[~inside].sum() <= 6 * door  # the door's own gap, and a step in front of it


def test_maps_without_a_building_on_paper_stay_as_they_are() -> None:
    open_field = np.zeros((100, 100), np.int8)
    open_field[40:42, 20:60] = 100
    robots = np.full((100, 100), -1, np.int8)
    robots[20:80, 0:90] = 0
    cropped = house(20)[20:100, 30:130]
    for cells in (open_field, robots, cropped):
        grid = OccupancyGrid(cells, 0.05)
        assert without_outside(grid) is grid


def test_narrow_bays_between_wings_are_outside() -> None:
    """A bay of 0.6 m is no room, though the widest closing would make one of it."""
    walls = np.zeros((160, 200), np.bool_)
    for left in (20, 102):
        walls[20:120, left : left + 70] = True
        walls[24:116, left + 4 : left + 66] = False
    walls[20:24, 20:172] = True
    outside = find_outside(walls, 0.05)
    assert outside[60, 96] and not outside[60, 50] and not outside[60, 140]
