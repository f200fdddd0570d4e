"""Cleaned grid maps."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.importing.cleaning import without_noise


def room() -> np.ndarray:
    """A room of 6 x 6 m with a wall around it, at 0.05 m."""
    cells = np.full((200, 200), -1, np.int8)
    cells[36:164, 36:164] = 100
    cells[40:160, 40:160] = 0
    return cells


@settings(deadline=None, max_examples=20)
@given(st.lists(st.tuples(st.integers(45, 150), st.integers(45, 150)), max_size=12, unique=True))
def test_specks_become_floor_and_walls_stay(places: list[tuple[int, int]]) -> None:
    places = [
        p for k, p in enumerate(places) if all(abs(p[0] - q[0]) + abs(p[1] - q[1]) > 8 for q in places[:k])
    ]
    cells = room()
    for row, col in places:
        cells[row : row + 2, col : col + 2] = 100
    assert np.array_equal(without_noise(OccupancyGrid(cells, 0.05)).cells, room())


def test_a_table_stays() -> None:
    cells = room()
    cells[90:110, 90:110] = 100
    assert np.array_equal(without_noise(OccupancyGrid(cells, 0.05)).cells, cells)


def test_fans_of_rays_go_and_doors_stay() -> None:
    cells = room()
    cells[90:108, 160:164] = 0  # a door of 0.9 m
    cells[60:140, 164:190] = 0
    cells[70:74, 36:40] = 0  # a window
    for slope in (-0.6, -0.3, 0.0, 0.3, 0.6):
        for step in range(36):
            cells[round(72 + slope * step), 36 - step] = 0
    clean = without_noise(OccupancyGrid(cells, 0.05)).cells
    assert (clean[:, :30] == -1).all()
    assert (clean[90:108, 160:164] == 0).all() and (clean[40:160, 40:160] == 0).all()


def test_unseen_spots_inside_become_floor_but_hollows_of_walls_do_not() -> None:
    cells = room()
    cells[100:105, 100:106] = -1
    cells[37:39, 60:100] = -1
    clean = without_noise(OccupancyGrid(cells, 0.05)).cells
    assert (clean[100:105, 100:106] == 0).all() and (clean[37:39, 60:100] == -1).all()


def test_a_mirrored_map_is_cleaned_alike() -> None:
    """Whatever the numbers of specks and holes that have a cell between them."""
    rng = np.random.default_rng(0)
    for _ in range(30):
        cells, chance = np.zeros((60, 70), np.int8), rng.random((60, 70))
        cells[:, 40:] = -1
        cells[chance < 0.1] = 100
        cells[:, 37:][chance[:, 37:] > 0.9] = 0
        cells[:, :44][(chance[:, :44] > 0.8) & (chance[:, :44] < 0.9)] = -1
        clean, mirrored = (
            without_noise(OccupancyGrid(np.ascontiguousarray(c), 0.05)).cells for c in (cells, cells[:, ::-1])
        )
        assert np.array_equal(clean, mirrored[:, ::-1])
