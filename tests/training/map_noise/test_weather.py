"""Maps weathered: walls go missing, things come, and rooms stay where they are."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.training.map_noise.weather import weather
from tests.layout.merging.cases import plan, rooms_of


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6))
def test_a_weathered_map_is_a_map_of_the_same_rooms(seed: int) -> None:
    cells, rooms = plan(), rooms_of(plan())
    before = cells.copy()
    out, truth = weather(cells, rooms, 0.05, np.random.default_rng(seed))
    again, _ = weather(cells, rooms, 0.05, np.random.default_rng(seed))
    assert np.array_equal(out, again) and np.array_equal(cells, before)
    assert out.shape == truth.shape == cells.shape and out.dtype == np.int8
    assert set(np.unique(out)) <= {-1, 0, 100}
    for room in (1, 2, 3):
        # bends move borders by some cells, things stand in rooms: their places stay
        assert abs(np.count_nonzero(truth == room) / np.count_nonzero(rooms == room) - 1) < 0.25
        assert (truth[rooms == room] == room).mean() > 0.75


def test_walls_go_missing_and_things_come() -> None:
    cells, rooms = plan(), rooms_of(plan())
    made = [weather(cells, rooms, 0.05, np.random.default_rng(k))[0] for k in range(30)]
    kinds = {
        (int(a), int(b)) for out in made for a, b in zip(cells[cells != out], out[cells != out], strict=True)
    }
    assert {(100, 0), (100, -1), (0, 100), (0, -1)} <= kinds
    nothing = np.full((9, 9), -1, np.int8)
    assert np.array_equal(
        weather(nothing, nothing.astype(np.int32), 0.05, np.random.default_rng(0))[0], nothing
    )
