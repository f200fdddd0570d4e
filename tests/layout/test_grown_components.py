"""Components that grow over a mask, followed through changes, against a queue that begins anew."""

from __future__ import annotations

from collections import deque

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from layoutexplore.grids.arrays import Cells, Ints
from layoutexplore.grids.runs import runs_of
from layoutexplore.layout.grown_components import BARE, SEED, GrownComponents

OTHER = 100


def anew(cells: Cells) -> tuple[Ints, int]:
    """Labels int64 (rows, cols), and how many there are: one queue of cells, in raster order at first."""
    seeds, count = ndimage.label(cells == SEED)
    queue = deque((r, c) for r, c in np.argwhere(seeds).tolist())
    label_of, bare = seeds.tolist(), (cells == BARE).tolist()
    while queue:
        r, c = queue.popleft()
        for y, x in ((r - 1, c), (r + 1, c), (r, c - 1), (r, c + 1)):
            inside = 0 <= y < cells.shape[0] and 0 <= x < cells.shape[1]
            if inside and bare[y][x] and not label_of[y][x]:
                label_of[y][x] = label_of[r][c]
                queue.append((y, x))
    labels = np.array(label_of, np.int64)
    left, more = ndimage.label((cells == BARE) & (labels == 0))
    return np.where(left > 0, left + count, labels), count + more


def change(cells: Cells, rng: np.random.Generator, most: int) -> tuple[int, int, int, int]:
    """Fill, clear or speckle some boxes in a box; which one that is."""
    row, col = (int(rng.integers(n)) for n in cells.shape)
    part = cells[row : row + int(rng.integers(1, most)), col : col + int(rng.integers(1, most))]
    kind = rng.integers(4)
    if kind == 0:
        part[:] = rng.choice([SEED, BARE, OTHER], p=[0.02, 0.6, 0.38], size=part.shape)
    elif kind == 1:
        part[:] = rng.choice([SEED, BARE, OTHER])
    else:
        part[:: rng.integers(1, 6), :: rng.integers(1, 6)] = rng.choice([SEED, BARE, BARE, OTHER])
    return row, row + part.shape[0], col, col + part.shape[1]


@settings(max_examples=150, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    large=st.sampled_from([0.0, 0.5, 1.0]),
    bare=st.floats(0.3, 0.95),
    most=st.sampled_from([3, 8, 30]),
)
def test_labels_are_those_of_a_queue_that_begins_anew(
    seed: int, large: float, bare: float, most: int
) -> None:
    """Seeds and walls come and go: paths lengthen, rooms split and join, and some bare cells are cut off."""
    rng = np.random.default_rng(seed)
    shape = int(rng.integers(1, 50)), int(rng.integers(1, 90))
    cells = rng.choice([SEED, BARE, OTHER], p=[0.02, 0.98 * bare, 0.98 * (1 - bare)], size=shape)
    cells = cells.astype(np.int8)
    grown = GrownComponents(shape, large=large)
    box = 0, shape[0], 0, shape[1]
    for _ in range(8):
        grown.update(cells, box)
        labels, count = anew(cells)
        assert grown.count == count
        np.testing.assert_array_equal(grown.labels, labels)
        box = change(cells, rng, most)


@pytest.mark.parametrize("wall", [(20, slice(None)), (slice(None), 40)])
def test_a_wall_that_splits_a_room_far_from_where_it_is_closed(wall: tuple[int | slice, int | slice]) -> None:
    """What lies on either side of it is another room at once, however far away."""
    cells = np.full((41, 81), SEED, np.int8)
    cells[::4] = BARE
    cells[wall] = OTHER
    cells[20, 40] = SEED
    grown = GrownComponents((41, 81))
    grown.update(cells, (0, 41, 0, 81))
    for door in (OTHER, SEED, BARE, OTHER):
        cells[20, 40] = door
        grown.update(cells, (20, 21, 40, 41))
        labels, count = anew(cells)
        assert grown.count == count
        np.testing.assert_array_equal(grown.labels, labels)


def test_a_seed_beside_what_no_seed_had_reached() -> None:
    """The changed cell is the seed alone: its neighbours, and theirs, have a label of their own before."""
    cells = np.array([[OTHER, BARE, BARE, OTHER, OTHER], [OTHER] * 4 + [SEED]], np.int8)
    grown = GrownComponents((2, 5), large=1.0)
    grown.update(cells, (0, 2, 0, 5))
    assert grown.labels.tolist() == [[0, 2, 2, 0, 0], [0, 0, 0, 0, 1]]
    cells[1, 1] = SEED
    grown.update(cells, (1, 2, 1, 2))
    assert grown.labels.tolist() == [[0, 1, 1, 0, 0], [0, 1, 0, 0, 2]]


def test_more_components_than_small_labels_can_number() -> None:
    """Seeds alone, and with what they do not reach; the box is all that is looked at."""
    cells = np.full((300, 300), OTHER, np.int8)
    grown = GrownComponents((300, 300))
    box = 100, 110, 100, 110
    for value in (SEED, BARE):
        cells[100:110, 100:110] = SEED
        grown.update(cells, box)
        assert grown.count == 1
        cells[::2, ::2] = cells[1::2, 1::2] = value
        grown.update(cells, (0, 300, 0, 300))
        labels, count = anew(cells)
        assert grown.count == count > 40_000 and grown.labels.dtype == np.int32
        np.testing.assert_array_equal(grown.labels, labels)
        cells[:] = OTHER
        box = 0, 300, 0, 300


def test_runs_of_a_value() -> None:
    rng = np.random.default_rng(0)
    for _ in range(30):
        cells = rng.choice([SEED, BARE, OTHER], p=[0.6, 0.3, 0.1], size=rng.integers(1, 60, 2)).astype(
            np.int8
        )
        painted = np.zeros(cells.shape, np.bool_)
        runs = runs_of(cells, SEED)
        for row, first, last in runs.tolist():
            assert first < last and not painted[row, max(first - 1, 0) : last].any()
            painted[row, first:last] = True
        np.testing.assert_array_equal(painted, cells == SEED)
        assert runs[:, :2].tolist() == sorted(runs[:, :2].tolist())
