"""Labels that grow over cells, against slow, obvious versions."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from layoutexplore.grids.flood import grow_labels, spread_in_place

maps = hnp.arrays(
    np.int8, st.tuples(st.integers(1, 9), st.integers(1, 11)), elements=st.sampled_from([-1, 0, 100])
)


@settings(max_examples=60, deadline=None)
@given(maps, st.integers(1, 3), st.integers(0, 10**6))
def test_labels_spread_into_walls_step_by_step(cells: np.ndarray, steps: int, seed: int) -> None:
    wall = cells == 100
    labels = np.where(cells == 0, np.random.default_rng(seed).integers(1, 4, cells.shape), 0).astype(np.int32)
    found = labels.copy()
    spread_in_place(found, wall, steps)
    assert (found[~wall] == labels[~wall]).all()
    reached = labels > 0
    for _ in range(steps):
        padded = np.pad(reached, 1)
        beside = padded[:-2, 1:-1] | padded[2:, 1:-1] | padded[1:-1, :-2] | padded[1:-1, 2:]
        reached = reached | (wall & beside)
    assert ((found > 0) == reached).all()
    grown = np.pad(found, 1)
    for r, c in np.argwhere(wall & (found > 0)):
        around = (grown[r, c + 1], grown[r + 2, c + 1], grown[r + 1, c], grown[r + 1, c + 2])
        assert found[r, c] in around


def slow_wave(seeds: np.ndarray, mask: np.ndarray) -> np.ndarray:
    labels = seeds.copy()
    while True:
        before = labels.copy()
        for r, c in np.argwhere(mask & (before == 0)):
            near = before[max(r - 1, 0) : r + 2, max(c - 1, 0) : c + 2].ravel()
            near = near[near > 0]
            if len(near):
                labels[r, c] = near[0]
        if (labels == before).all():
            return labels


@settings(max_examples=60, deadline=None)
@given(
    hnp.arrays(np.int32, (9, 11), elements=st.sampled_from([0, 0, 0, 0, 0, 1, 2])),
    hnp.arrays(np.bool_, (9, 11)),
)
def test_the_wave_equals_the_slow_one(seeds: np.ndarray, mask: np.ndarray) -> None:
    assert (grow_labels(seeds, mask) == slow_wave(seeds, mask)).all()
