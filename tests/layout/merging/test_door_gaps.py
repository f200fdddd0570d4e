"""Door-gap candidates against a slow, obvious version."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from layoutexplore.layout.merging.door_gaps import LONG, SHORT, WIDTH, OpeningConfig, find_openings, free_runs
from tests.layout.merging.cases import office


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
@given(
    hnp.arrays(
        np.bool_,
        st.tuples(st.integers(1, 14), st.integers(1, 16)),
        elements=st.sampled_from([True, False, False]),
    )
)
def test_openings_are_the_gaps_along_rows_and_columns(blocked: np.ndarray) -> None:
    config = OpeningConfig(door_min=1.0, door_max=4.0, door_run=1.0, widening=1.0, reach=2.0, slack=1.0)
    sizes = (1, 4, 1, 1, 2, 5, 1)
    narrowest = np.full(blocked.shape, 99)
    for mask, gaps in ((blocked, narrowest), (blocked.T, narrowest.T)):
        for r, c, n, _, _ in slow_gaps(mask, sizes):
            gaps[r, c : c + n] = np.minimum(gaps[r, c : c + n], n)
    found = find_openings(blocked, 1.0, config)
    assert ((found.gap > 0) == (narrowest < 99)).all()
    assert (found.table[found.gap, WIDTH][found.gap > 0] == narrowest[found.gap > 0]).all()
    expected = [gap[2:] for mask in (blocked, blocked.T) for gap in slow_gaps(mask, sizes)]
    assert sorted(map(tuple, found.table[1:, [WIDTH, LONG, SHORT]].tolist())) == sorted(expected)


def test_a_door_is_found_with_its_walls() -> None:
    found = find_openings(office().occupied, 0.05, OpeningConfig())
    door = found.table[found.gap[108, 50]]
    assert found.table[0].tolist() == [0, 0, 0]
    assert door[WIDTH] == 18 and door[LONG] >= door[SHORT] > 5
    assert found.gap[130, 50] == 0 and found.gap[60, 50] == 0
