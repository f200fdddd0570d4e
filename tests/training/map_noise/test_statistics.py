"""The statistics of a map against maps drawn so that they are known."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from layoutexplore.errors import MapError
from layoutexplore.grids.arrays import Cells
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN
from layoutexplore.training.map_noise.statistics import STATISTICS, describe_grid, statistics_table

CELL = 0.05


def box(rows: int = 100, cols: int = 120) -> Cells:
    """A room with walls of one cell in unknown space."""
    cells = np.full((rows + 20, cols + 20), UNKNOWN, np.int8)
    cells[9 : rows + 11, 9 : cols + 11] = OCCUPIED
    cells[10 : rows + 10, 10 : cols + 10] = FREE
    return cells


def test_a_clean_room_has_long_thin_walls_and_nothing_else() -> None:
    found = describe_grid(box(), CELL)
    assert (
        found.specks == found.things == found.unknown == found.frayed == found.gap_width == found.doubled == 0
    )
    assert found.long_runs == 1 and found.thickness == pytest.approx(CELL, rel=0.01)
    assert 5.0 < found.wall_run < 6.1 and found.rays < 0.01


def test_each_statistic_sees_what_it_is_for() -> None:
    clean, metres = box(), 100 * 120 * CELL**2
    cells = clean.copy()
    cells[30:60:10, 30:60:10] = OCCUPIED
    assert describe_grid(cells, CELL).specks == pytest.approx(100 * 9 / metres, rel=0.01)
    cells = clean.copy()
    cells[30:40, 30:40] = OCCUPIED
    assert describe_grid(cells, CELL).things == pytest.approx(100 / metres, rel=0.02)
    cells = clean.copy()
    cells[40:42, 70:139] = FREE
    cells[10:110, 70] = OCCUPIED
    cells[50:68, 70] = FREE
    assert describe_grid(cells, CELL).gap_width == pytest.approx(18 * CELL)
    cells = clean.copy()
    cells[50:52, 130:138] = FREE
    assert describe_grid(cells, CELL).rays > 0
    assert describe_grid(cells, CELL).frayed > 0
    cells = clean.copy()
    cells[40:60, 60:80] = UNKNOWN
    assert describe_grid(cells, CELL).unknown == pytest.approx(400 / 12000)
    cells = clean.copy()
    cells[4, 9:131] = OCCUPIED
    assert describe_grid(cells, CELL).doubled > 0.3


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_a_turned_map_has_the_same_statistics(turns: int) -> None:
    rng = np.random.default_rng(0)
    cells = box()
    cells[rng.random(cells.shape) < 0.02] = OCCUPIED
    cells[rng.random(cells.shape) < 0.02] = UNKNOWN
    turned = np.ascontiguousarray(np.rot90(cells, turns))
    one, other = (statistics_table([describe_grid(c, CELL)])[0] for c in (cells, turned))
    # the hull is drawn in whole cells, which turns nearly the same
    assert one == pytest.approx(other, rel=0.02)


def test_a_map_of_one_kind_of_cells_is_refused() -> None:
    for kind in (FREE, OCCUPIED, UNKNOWN):
        with pytest.raises(MapError, match="without free or without occupied"):
            describe_grid(np.full((20, 20), kind, np.int8), CELL)
    assert [f.name for f in dataclasses.fields(describe_grid(box(), CELL))] == list(STATISTICS)
    assert statistics_table([]).shape == (0, len(STATISTICS))
