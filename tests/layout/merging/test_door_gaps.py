"""Door-gap candidates against a slow, obvious version."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from layoutexplore.layout.merging.door_gaps import (
    GAP,
    DoorGapConfig,
    GapSizes,
    find_door_gaps,
    gaps_along_lines,
    list_gaps,
    risen,
)
from tests.layout.merging.cases import office


def free_runs(blocked: np.ndarray) -> np.ndarray:
    """Length of the run of cells that are not blocked in its row, for each cell; 0 for blocked ones."""
    runs = np.zeros(blocked.shape, int)
    for line, lengths in zip(blocked, runs, strict=True):
        for left, right in itertools.pairwise([-1, *np.flatnonzero(line).tolist(), len(line)]):
            lengths[left + 1 : right] = right - left - 1
    return runs


SMALL_GRIDS = hnp.arrays(
    np.bool_,
    st.tuples(st.integers(1, 14), st.integers(1, 16)),
    elements=st.sampled_from([True, False, False]),
)


def slow_gaps(blocked: np.ndarray, sizes: tuple[int, ...]) -> set[tuple[int, int, int, int, int]]:
    """Row, first column, width, longer and shorter wall of each gap along the rows."""
    narrowest, widest, run_min, widening, reach, longest, slack = sizes
    found, runs = set(), free_runs(blocked)
    for r in range(1, len(blocked) - 1):
        walls = np.flatnonzero(blocked[r])
        for left, right in zip(walls[:-1].tolist(), walls[1:].tolist(), strict=True):
            n = right - left - 1
            if not narrowest <= n <= widest:
                continue
            middle = left + 1 + n // 2
            wide = []
            for step in (-1, 1):
                column = runs[
                    r + step : r + step * (reach + 1) if r + step * (reach + 1) >= 0 else None : step, middle
                ]
                shut = np.flatnonzero(column == 0)
                wide.append(bool((column[: shut[0] if len(shut) else None] >= n + widening).any()))
            thick = blocked[max(r - slack, 0) : r + slack + 1].any(axis=0)
            ends = [np.flatnonzero(~t) for t in (thick[left::-1], thick[right:])]
            one, other = (
                min(int(e[0]) if len(e) else len(t), longest)
                for e, t in zip(ends, (thick[left::-1], thick[right:]), strict=True)
            )
            if all(wide) and max(one, other) >= run_min:
                found.add((r, left + 1, n, max(one, other), min(one, other)))
    return found


@settings(max_examples=60, deadline=None)
@given(SMALL_GRIDS)
def test_door_gaps_along_rows_and_columns(blocked: np.ndarray) -> None:
    config = DoorGapConfig(door_min=1.0, door_max=4.0, door_run=1.0, widening=1.0, reach=2.0, slack=1.0)
    sizes = (1, 4, 1, 1, 2, 5, 1)
    narrowest = np.full(blocked.shape, 99)
    for mask, gaps in ((blocked, narrowest), (blocked.T, narrowest.T)):
        for r, c, n, _, _ in slow_gaps(mask, sizes):
            gaps[r, c : c + n] = np.minimum(gaps[r, c : c + n], n)
    found = find_door_gaps(blocked, 1.0, config)
    assert ((found.gap > 0) == (narrowest < 99)).all()
    assert (found.table[found.gap, GAP.width][found.gap > 0] == narrowest[found.gap > 0]).all()
    expected = [gap[2:] for mask in (blocked, blocked.T) for gap in slow_gaps(mask, sizes)]
    assert sorted(map(tuple, found.table[1:, [GAP.width, GAP.long, GAP.short]].tolist())) == sorted(expected)


def test_a_door_is_found_with_its_walls() -> None:
    found = find_door_gaps(office().occupied, 0.05, DoorGapConfig())
    door = found.table[found.gap[108, 50]]
    assert not found.table[0].any()
    assert door[GAP.width] == 18 and door[GAP.long] >= door[GAP.short] > 5
    assert found.gap[130, 50] == 0 and found.gap[60, 50] == 0


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 100_000))
def test_gaps_in_long_walls_are_listed_in_raster_order(seed: int) -> None:
    """Lines of wall with holes, longer than what is looked at at once, followed as far as needed."""
    rng = np.random.default_rng(seed)
    blocked = rng.random((25, 60)) < rng.uniform(0, 0.1)
    for r in rng.integers(0, 25, 3):
        blocked[r] |= rng.random(60) < 0.85
    config = DoorGapConfig(door_min=2.0, door_max=14.0, door_run=2.0, widening=2.0, reach=3.0, slack=0.0)
    found = list_gaps(blocked, 1.0, config, longest=2.0)
    for gaps, mask in zip(found, (blocked, blocked.T), strict=True):
        assert [tuple(gap) for gap in gaps.tolist()] == sorted(slow_gaps(mask, (2, 14, 2, 2, 3, 2, 1)))


@settings(max_examples=60, deadline=None)
@given(SMALL_GRIDS, st.floats(-np.pi / 4, np.pi / 4))
def test_gaps_along_a_direction_are_those_along_the_rows_of_a_sheared_grid(
    blocked: np.ndarray, angle: float
) -> None:
    rise = risen(angle, blocked.shape[1])
    least = int(rise.min())
    # as many free rows around as a line is followed aside: outside the grid nothing is blocked
    sheared = np.zeros((blocked.shape[0] + int(rise.max()) - least, blocked.shape[1]), np.bool_)
    for r, c in np.argwhere(blocked):
        sheared[r - rise[c] + rise.max(), c] = True
    at = np.stack(np.nonzero(blocked.T)).astype(np.int32)
    found = gaps_along_lines(blocked, at, rise, GapSizes(1, 4, 1, 1, 1, 1, 5))
    gaps = {(int(g[0]) + int(rise.max()), *(int(v) for v in g[1:])) for g in found}
    inside = {gap for gap in slow_gaps(sheared, (1, 4, 1, 1, 1, 5, 1)) if _beside(gap, rise, blocked)}
    assert gaps == inside


def _beside(gap: tuple[int, int, int, int, int], rise: np.ndarray, blocked: np.ndarray) -> bool:
    """Whether the cells above and below the middle of a gap lie in the grid: else it leads nowhere."""
    middle = gap[1] + gap[2] // 2
    row = gap[0] - int(rise.max()) + int(rise[middle])
    return 0 < row < len(blocked) - 1


@pytest.mark.parametrize("degrees", [20, 36, 45, 70, 110, 144, -30])
def test_doors_in_walls_askew_are_found_along_their_direction(degrees: int) -> None:
    angle = math.radians(degrees)
    rows, cols = np.mgrid[0:200, 0:200] - 100.0
    along = cols * math.cos(angle) + rows * math.sin(angle)
    across = rows * math.cos(angle) - cols * math.sin(angle)
    wall = (np.abs(across) <= 2) & (np.abs(along) <= 80) & (np.abs(along) >= 9)
    none, found = (
        find_door_gaps(wall, 0.05, DoorGapConfig(), askew) for askew in (np.zeros(0), np.array([angle]))
    )
    gaps = found.table[found.gap[(np.abs(across) < 0.6) & (np.abs(along) < 7)]]
    assert (gaps[:, GAP.width] >= 15).all() and (gaps[:, GAP.width] <= 22).all()
    assert (gaps[:, GAP.short] > 50).all()
    assert len(found.table) > len(none.table)
