"""Wall lines as evidence for and against a border between regions."""

from __future__ import annotations

import numpy as np
import pytest

from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN
from layoutexplore.layout.merging.line_evidence import BESIDE_LINE, EvidenceConfig, count_rooms, find_evidence
from tests.layout.merging.cases import plan, rooms_of


def test_lines_part_the_rooms_of_a_plan() -> None:
    cells = plan()
    evidence = find_evidence(cells, cells == 100, 0.05)
    room = evidence.room[evidence.row_strip][:, evidence.col_strip]
    found = [np.bincount(room[rooms_of(cells) == k]).argmax() for k in (1, 2, 3)]
    assert len(set(found)) == 3 and 0 not in found
    labels = np.ascontiguousarray(rooms_of(cells))
    table = count_rooms(labels, cells == FREE, evidence)
    assert table.sum() == np.count_nonzero(labels)
    assert all(table[k].argmax() == found[k - 1] for k in (1, 2, 3))


def test_walls_among_much_clutter_have_to_be_longer() -> None:
    cells = plan()
    rng = np.random.default_rng(0)
    for r, c in np.stack((rng.integers(60, 150, 60), rng.integers(100, 170, 60)), axis=1):
        cells[r : r + 3, c : c + 3] = 100  # boxes
    for r in range(66, 150, 24):
        cells[r : r + 2, 22:50] = 100  # shelves of 1.4 m
    low = find_evidence(cells, cells == 100, 0.05, EvidenceConfig(level_max=EvidenceConfig.level))
    adapted = find_evidence(cells, cells == 100, 0.05)
    high = find_evidence(cells, cells == 100, 0.05, EvidenceConfig(level=EvidenceConfig.level_max))
    assert adapted.face.shape == high.face.shape and adapted.face.size < low.face.size
    clean = (
        find_evidence(plan(), plan() == 100, 0.05),
        find_evidence(plan(), plan() == 100, 0.05, EvidenceConfig(level_max=0.18)),
    )
    assert (clean[0].face == clean[1].face).all()


@pytest.mark.parametrize("cells", [np.full((5, 6), UNKNOWN), np.zeros((5, 6)), np.full((5, 6), 100)])
def test_a_map_without_walls_is_one_face(cells: np.ndarray) -> None:
    cells = cells.astype(np.int8)
    evidence = find_evidence(cells, cells == 100, 0.05, EvidenceConfig())
    assert evidence.face.shape == evidence.room.shape == (1, 1)


def test_cells_beside_a_line_hardly_count() -> None:
    cells = plan()
    evidence = find_evidence(cells, cells == OCCUPIED, 0.05)
    labels, free = np.ones(cells.shape, np.int32), cells == FREE
    rows, cols = (np.abs(np.subtract.outer(np.arange(len(s)), np.flatnonzero(np.diff(s)) + 0.5)).min(axis=1)
                  for s in (evidence.row_strip, evidence.col_strip))  # fmt: skip
    clear = (rows[:, None] > 2) & (cols > 2)
    all_cells, weighed = (count_rooms(labels, free, evidence, beside=beside).sum() for beside in (0, 2))
    assert all_cells == np.count_nonzero(free) > np.count_nonzero(free & clear) > 0
    assert weighed == pytest.approx(
        np.count_nonzero(free & clear) + BESIDE_LINE * np.count_nonzero(free & ~clear)
    )
