"""A table of lengths against a dictionary."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.planning.known_lengths import NOT_SEARCHED, KnownLengths


@given(seed=st.integers(0, 100_000))
@settings(max_examples=60, deadline=None)
def test_what_is_known_is_what_was_written_and_not_forgotten(seed: int) -> None:
    """Places come, also twice at once, are left out, and their lengths forgotten; the order is free."""
    rng = np.random.default_rng(seed)
    known, written = KnownLengths(most=25), dict[tuple[object, object], int]()
    for turn in range(12):
        asked = rng.integers(0, 6, (int(rng.integers(0, 10)), 2))
        before = {tuple(cell) for cell in known.cells.tolist()}
        rows = known.rows(asked)
        assert known.cells[rows].tolist() == asked.tolist() and len(known.cells) <= 25 + 9
        assert len(np.unique(known.cells, axis=0)) == len(known.cells)
        places = [tuple(cell) for cell in known.cells.tolist()]
        assert set(places) >= before or len(before | set(map(tuple, asked.tolist()))) > 25
        written = {pair: length for pair, length in written.items() if set(pair) <= set(places)}
        expected = [[written.get((a, b), 0 if a == b else NOT_SEARCHED) for b in places] for a in places]
        assert known.units.tolist() == expected
        if len(places) > 1:
            a, b = rng.choice(len(places), 2, replace=False).tolist()
            known.units[a, b] = known.units[b, a] = written[places[a], places[b]] = turn + 1
            written[places[b], places[a]] = turn + 1
        far = known.units > rng.integers(0, 13)
        known.forget(far)
        written = {
            pair: length for pair, length in written.items() if not far[tuple(map(places.index, pair))]
        }
        if rng.random() < 0.3:
            kept = rng.random(len(places)) < 0.7
            known.keep(kept if rng.random() < 0.5 else np.flatnonzero(kept))
            left = {tuple(cell) for cell in known.cells.tolist()}
            written = {pair: length for pair, length in written.items() if set(pair) <= left}
    known.clear()
    assert known.cells.shape == (0, 2) and known.units.shape == (0, 0)


def test_places_that_are_known_already_take_no_room() -> None:
    known = KnownLengths(most=4)
    known.rows(np.array([[0, 0], [1, 1], [2, 2]]))
    known.units[:] = 7
    known.rows(np.array([[0, 0], [1, 1], [3, 3], [3, 3]]))
    assert known.cells.tolist() == [[0, 0], [1, 1], [2, 2], [3, 3]] and known.units[0, 1:].tolist() == [
        7,
        7,
        NOT_SEARCHED,
    ]
    known.rows(np.array([[1, 1], [4, 4]]))
    assert known.cells.tolist() == [[1, 1], [4, 4]]
