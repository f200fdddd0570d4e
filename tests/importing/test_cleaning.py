"""Cleaned grid maps."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.grids.grid import OccupancyGrid, in_cells
from layoutexplore.grids.morphology import grow, opened_by_box
from layoutexplore.importing.cleaning import HOLE_AREA, HOLLOW, RAY_WIDTH, SPECK_AREA, without_noise


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


def slow_parts(mask: np.ndarray, connectivity: int) -> list[np.ndarray]:
    count, parts = cv2.connectedComponents(mask.astype(np.uint8), connectivity=connectivity)
    return [parts == k for k in range(1, count)]


def slow_clean(cells: np.ndarray, resolution: float) -> np.ndarray:
    """The same part by part, with masks of the whole grid."""

    def small(mask: np.ndarray, area: float, connectivity: int) -> np.ndarray:
        few = [p for p in slow_parts(mask, connectivity) if p.sum() <= area / resolution**2]
        return np.any([np.zeros_like(mask), *few], axis=0)

    def touching(parts: np.ndarray, other: np.ndarray, least: float) -> np.ndarray:
        chosen = np.zeros_like(parts)
        for part in slow_parts(parts, 4):
            around = (cv2.dilate(part.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0) & ~parts
            chosen |= part & bool((around & other).sum() > least * max(around.sum(), 1))
        return chosen

    occupied, free = cells == 100, cells == 0
    specks = small(occupied, SPECK_AREA, 8)
    free = free | touching(specks, free, 0.0)
    occupied = occupied & ~specks
    holes = small(~free & ~occupied, HOLE_AREA, 4)
    free |= holes & ~touching(holes, occupied, HOLLOW)
    wide = opened_by_box(free, *[in_cells(RAY_WIDTH, resolution)] * 2)
    if wide.any():
        free = grow(wide, free, RAY_WIDTH / resolution)
    return np.select([occupied, free], [100, 0], -1)


@pytest.mark.parametrize("seed", range(40))
def test_it_does_what_is_done_part_by_part(seed: int) -> None:
    """Also where much around the map is unknown, or its known cells lie at an edge."""
    rng = np.random.default_rng(seed)
    resolution = float(rng.choice([0.03, 0.05, 0.1, 0.5]))
    cells = np.full(rng.integers(1, 90, 2), -1, np.int8)
    top, left = (int(rng.integers(0, size)) for size in cells.shape)
    part = cells[top : top + 60, left : left + 60]
    coarse = rng.choice([-1, 0, 0, 0, 100], (20, 20)).repeat(3, axis=0).repeat(3, axis=1)
    part[:] = coarse[: part.shape[0], : part.shape[1]]
    part[rng.random(part.shape) < 0.1] = rng.choice([-1, 0, 50, 100])
    cleaned = without_noise(OccupancyGrid(cells, resolution)).cells
    assert np.array_equal(cleaned, slow_clean(cells, resolution))
