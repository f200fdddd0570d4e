"""The network's input around a half-seen room."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from layoutexplore.layout.doorways import Regions, doorway_regions
from layoutexplore.predictors.cell_model.features import find_candidates
from layoutexplore.predictors.cell_model.network_input import (
    PLANES,
    SHOWN,
    draw_planes,
    make_network_input,
    reoriented,
)
from tests.predictors.cell_model.cases import GRIDS, half_seen, scene_of


@settings(max_examples=40, deadline=None)
@given(cells=GRIDS)
def test_planes_show_what_is_asked(cells: NDArray[np.int8]) -> None:
    scene = scene_of(cells)
    if len(scene.lattice_cells) == 0:
        return
    planes = draw_planes(scene)
    assert planes.values.shape[2] == PLANES and np.isfinite(planes.values).all()
    assert planes.asked.tolist() == list(range(len(scene.lattice_cells)))
    for rank in range(2):
        first = 6 + rank * (SHOWN + 5)
        asked = planes.values[..., first + SHOWN] > 0
        expected = np.zeros(asked.shape, np.bool_)
        mine = scene.rank == rank
        expected[scene.lattice_cells[mine, 0] - planes.row, scene.lattice_cells[mine, 1] - planes.col] = True
        np.testing.assert_array_equal(asked, expected)
        assert not planes.values[~asked, first : first + SHOWN].any()
    np.testing.assert_allclose(planes.values[..., :3].sum(axis=2).max(), 1.0, atol=0.002)


@settings(max_examples=20, deadline=None)
@given(cells=GRIDS, way=st.integers(0, 7))
def test_a_turned_scene_is_that_of_the_turned_map(cells: NDArray[np.int8], way: int) -> None:
    """But for ties: the shares of the squares, and who asks where, on whole squares."""
    cells = np.kron(cells, np.ones((3, 3), np.int8))
    other = cells[::-1] if way & 1 else cells
    other = other[:, ::-1] if way & 2 else other
    other = np.ascontiguousarray(other.T if way & 4 else other)
    expected, found = scene_of(other), reoriented(scene_of(cells), way)
    np.testing.assert_allclose(found.bits[[0, 1, 2, 4, 5]], expected.bits[[0, 1, 2, 4, 5]], atol=1e-3)
    squares = [
        {tuple(square) for square in scene.lattice_cells[scene.rank == 0].tolist()}
        for scene in (found, expected)
    ]
    assert squares[0] == squares[1]


def test_what_a_region_is_numbered_does_not_matter() -> None:
    cells = half_seen()
    regions = doorway_regions(cells, 0.1)
    assert regions.count == 1
    labels = np.where(regions.labels > 0, np.int32(40_000), np.int32(0))
    other = Regions(labels, 40_000, regions.gaps, regions.resolution)
    few, many = (
        draw_planes(make_network_input(cells, each, find_candidates(cells, each, 0.1), 0.1))
        for each in (regions, other)
    )
    np.testing.assert_array_equal(few.values, many.values)


def test_a_window_shows_what_lies_in_it() -> None:
    scene = scene_of(half_seen())
    whole, part = draw_planes(scene), draw_planes(scene, (5, 8), 9)
    assert part.values.shape == (9, 9, PLANES) and (part.row, part.col) == (5, 8)
    inside = ((scene.lattice_cells >= (5, 8)) & (scene.lattice_cells < (14, 17))).all(axis=1)
    assert part.asked.tolist() == np.flatnonzero(inside).tolist()
    row, col = 5 - whole.row, 8 - whole.col
    shown = whole.values[row : row + 9, col : col + 9, 6 : 6 + SHOWN]
    np.testing.assert_array_equal(part.values[..., 6 : 6 + SHOWN], shown)
    nothing = draw_planes(scene, (5, 4), 3)
    assert len(nothing.asked) == 0 and not nothing.values[..., 6 + SHOWN].any(), (
        "where all is known nothing is asked"
    )
