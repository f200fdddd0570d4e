"""The main direction of a map, and turning it there and back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from layoutexplore.layout.alignment import (
    askew_directions,
    main_direction,
    places,
    surfaces,
    turn,
    turn_back,
    turn_labels,
    turned_places,
)
from layoutexplore.layout.canonical import Orientation
from tests.layout.merging.cases import office

maps = hnp.arrays(
    np.int8, st.tuples(st.integers(1, 9), st.integers(1, 11)), elements=st.sampled_from([-1, 0, 100])
)


@settings(max_examples=60, deadline=None)
@given(maps)
def test_surfaces_are_occupied_cells_beside_free_ones(cells: np.ndarray) -> None:
    padded = np.pad(cells, 1, constant_values=-1)
    found = surfaces(cells)
    for r, c in np.ndindex(cells.shape):
        assert found[r, c] == (cells[r, c] == 100 and bool((padded[r : r + 3, c : c + 3] == 0).any()))


@pytest.mark.parametrize("angle", [0.1, -0.4, 0.7])
def test_labels_turn_there_and_back(angle: float) -> None:
    grid = office()
    turned = turn(grid.cells, angle, (0, 0))
    back = turn_back((turned.cells == 0).astype(np.int32), turned, grid.shape) > 0
    assert (back != grid.free).mean() < 0.05


@settings(max_examples=60, deadline=None)
@given(maps, st.floats(-0.78, 0.78), st.integers(0, 7), st.booleans())
def test_labels_of_the_whole_grid_lie_in_the_turned_frame_as_its_cells_do(
    cells: np.ndarray, angle: float, number: int, straight: bool
) -> None:
    orientation = Orientation(bool(number & 1), bool(number & 2), bool(number & 4))
    turned = turn(orientation.apply(cells), 0.0 if straight else angle, (2, 1), orientation)
    labels = np.pad(np.arange(1, cells.size + 1, dtype=np.int32).reshape(cells.shape), ((2, 3), (1, 2)))
    found = turn_labels(labels, turned)
    assert found.shape == turned.cells.shape
    inside = found > 0
    at = np.unravel_index(found[inside] - 1, cells.shape)
    assert inside.any() or cells.size == 1  # which may lie between the cells of the turned frame
    # all that is turned is looked up in the same place, but for occupied cells, of which none is lost
    same = turned.cells[inside] == cells[at]
    assert (same | (turned.cells[inside] == 100)).all()
    if straight:
        assert inside.all() and same.all()


@settings(max_examples=60, deadline=None)
@given(maps, st.floats(-0.78, 0.78))
def test_a_turned_map_is_looked_up_and_loses_no_wall(cells: np.ndarray, angle: float) -> None:
    turned = turn(cells, angle, (0, 0)).cells
    high, wide = turned.shape
    walls = turned_places(places(cells, 100), angle, cells.shape, turned.shape)
    assert (turned[walls[:, 0], walls[:, 1]] == 100).all()
    placed = {(int(r), int(c)) for r, c in walls}
    c, s = np.cos(angle), np.sin(angle)
    for row, col in np.ndindex(high, wide):
        y, x = row - (high - 1) / 2, col - (wide - 1) / 2
        at = s * x + c * y + (cells.shape[0] - 1) / 2, c * x - s * y + (cells.shape[1] - 1) / 2
        # Middles of cells that lie on the border of two may fall to either.
        near = {tuple(int(np.floor(v + 0.5 + e)) for v in at) for e in (-1e-3, 1e-3)}
        inside = [r >= 0 and k >= 0 and r < cells.shape[0] and k < cells.shape[1] for r, k in near]
        seen = {int(cells[p]) if ok else -1 for p, ok in zip(near, inside, strict=True)}
        assert len(near) > 1 or (row, col) in placed or turned[row, col] in seen


def test_the_main_direction_is_the_peak_modulo_a_right_angle() -> None:
    profile = np.zeros(720)
    profile[[80, 440]] = 1.0
    assert main_direction(profile) == pytest.approx(np.radians(20))
    profile = np.zeros(720)
    profile[700] = 1.0
    assert main_direction(profile) == pytest.approx(np.radians(-5))
    assert main_direction(np.ones(720)) == 0.0


def test_directions_askew_are_those_along_neither_axis_of_the_turned_grid() -> None:
    pentagon = np.radians([0.0, 36.0, 72.0, 108.0, 144.0])
    found = np.degrees(askew_directions(pentagon, math.radians(36.0)))
    assert found == pytest.approx([-36.0, 36.0, 72.0, -72.0])
    near = np.radians([1.0, 8.0, 93.0, 99.0, 179.0])
    assert len(askew_directions(near, 0.0)) == 0
    # a single wall is no wing
    assert len(askew_directions(np.radians([0.0, 45.0, 90.0]), 0.0)) == 0
    assert len(askew_directions(np.zeros(0), 0.3)) == 0
