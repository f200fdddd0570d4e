"""How far walls enclose a region, against looking around from every cell."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from layoutexplore.grids.arrays import Floats, Ints32, Mask
from layoutexplore.layout.merging.ray_fans.enclosure import (
    FARTHEST,
    OUTERMOST,
    enclosure_of_regions,
    wall_extents,
)


def looked_around(labels: Ints32, free: Mask, part: Ints32, wall: Mask, resolution: float) -> Floats:
    rows, cols = labels.shape
    row, col = np.nonzero(wall)
    box = [0, rows - 1, 0, cols - 1]
    if len(row):
        least = OUTERMOST * len(row)
        box = [min(r for r in range(rows) if (row <= r).sum() > least)]
        box += [min(r for r in range(rows) if (row <= r).sum() >= len(row) - least)]
        box += [min(c for c in range(cols) if (col <= c).sum() > least)]
        box += [min(c for c in range(cols) if (col <= c).sum() >= len(row) - least)]
    step = max(round(0.1 / resolution), 1)
    found: list[list[tuple[float, float, float]]] = [[] for _ in range(part.max() + 1)]
    for r in range(step // 2, rows, step):
        for c in range(step // 2, cols, step):
            if labels[r, c] and free[r, c]:
                sides = [wall[r, :c].any(), wall[r, c + 1 :].any(), wall[:r, c].any(), wall[r + 1 :, c].any()]
                beyond = max(box[0] - r, r - box[1], box[2] - c, c - box[3])
                found[part[labels[r, c]]].append((sum(sides) == 4, sum(sides) >= 3, beyond * resolution))
    return np.array([np.mean(cells, axis=0) if cells else np.zeros(3) for cells in found])


@given(st.integers(0, 10**6), st.integers(1, 14), st.integers(1, 14), st.sampled_from([0.05, 0.1, 0.3]))
def test_walls_are_found_as_by_looking_around(seed: int, rows: int, cols: int, resolution: float) -> None:
    rng = np.random.default_rng(seed)
    wall = rng.random((rows, cols)) < rng.choice([0.0, 0.1, 0.4])
    free = ~wall & (rng.random((rows, cols)) < 0.8)
    labels = np.where(wall, 0, rng.integers(0, 5, (rows, cols))).astype(np.int32)
    part = np.array([0, 1, 2, 1, 0], np.int32)
    found = enclosure_of_regions(labels, free, part, wall, resolution)
    expected = looked_around(labels, free, part, wall, resolution)
    expected[:, 2] = expected[:, 2].clip(-FARTHEST, FARTHEST)
    for k, column in enumerate(found):
        np.testing.assert_allclose(column, expected[:, k], atol=1e-9)


def test_a_room_is_walled_and_what_lies_before_its_window_is_not() -> None:
    wall = np.zeros((40, 60), bool)
    wall[[5, 34], 5:40] = wall[5:35, 5] = wall[5:35, 39] = True
    wall[15:20, 39] = False
    labels = np.zeros(wall.shape, np.int32)
    labels[6:34, 6:39], labels[10:25, 42:60] = 1, 2
    found = enclosure_of_regions(labels, labels > 0, np.arange(3, dtype=np.int32), wall, 0.1)
    # the window's 5 of the room's 28 rows have no wall to the right
    assert found.walled.tolist() == [0.0, pytest.approx(23 / 28), 0.0]
    assert found.nearly.tolist() == [0.0, 1.0, 0.0]
    assert found.outside[1] < 0 < found.outside[2] == pytest.approx(0.1 * (np.arange(42, 60) - 39).mean())


def test_the_box_leaves_a_stray_wall_outside() -> None:
    wall = np.zeros((50, 300), bool)
    wall[10:40, 20:30] = True
    wall[20, 290] = True
    assert wall_extents(wall).box.tolist() == [10, 39, 20, 29]
