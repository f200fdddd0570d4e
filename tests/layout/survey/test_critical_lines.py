"""Critical lines across narrow places of the Voronoi graph."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.layout.survey.critical_lines import critical_lines


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_basis_points_are_the_nearest_cells(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(20, 90, 2).tolist())
    walls = np.argwhere(rng.random(shape) < 0.01).astype(np.int32)
    points = np.stack([rng.integers(0, n, 12) for n in shape], axis=1).astype(np.int32)
    distance = rng.integers(1, 12, shape).astype(np.uint8)
    lines = critical_lines(points, walls, distance, 0.0)
    expected = []
    for point in points:
        far = ((walls - point) ** 2).sum(axis=1)
        if not len(far):
            continue
        first = walls[far.argmin()]
        apart = ((walls - first) ** 2).sum(axis=1) > int(distance[tuple(point)]) ** 2
        if apart.any():
            expected.append([point, first, walls[apart][far[apart].argmin()]])
    assert lines.tolist() == np.array(expected, np.int32).reshape(-1, 3, 2).tolist()


def test_of_close_critical_points_the_widest_angle_stays() -> None:
    walls = np.array([(28, 37), *((r, c) for r in (10, 30) for c in range(60))], np.int32)
    points = np.array([(20, 30), (21, 33), (20, 50)], np.int32)
    distance = np.full((41, 60), 10, np.uint8)
    kept = critical_lines(points, walls, distance, 0.5)
    assert [row[0].tolist() for row in kept] == [[20, 30], [20, 50]]
    assert kept[0, 1].tolist() == [10, 30] and kept[0, 2].tolist() == [30, 30]
