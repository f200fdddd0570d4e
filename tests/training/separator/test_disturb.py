"""Crops as the network may meet them: what is seen changes, the truth of what is seen does not."""

from __future__ import annotations

import numpy as np

from layoutexplore.training.separator.crops import draw_crop
from layoutexplore.training.separator.disturb import CHANGES, disturbed
from layoutexplore.training.separator.examples import SeparatorExample, separator_example
from tests.layout.merging.cases import plan, rooms_of


def crop() -> SeparatorExample:
    cells = plan()
    cells[80:84, 60:64] = 100
    return draw_crop(separator_example(cells, rooms_of(plan()), 0.05), 24, np.random.default_rng(0))


def test_squares_stay_full_at_most() -> None:
    given = crop()
    for seed in range(40):
        found = disturbed(given, np.random.default_rng(seed))
        assert found.shares.shape == given.shares.shape and found.rooms.shape == given.rooms.shape
        # of 255, each rounded
        assert found.shares[..., :3].sum(-1, dtype=np.int64).max() <= 257
        again = disturbed(given, np.random.default_rng(seed))
        assert np.array_equal(found.shares, again.shares) and np.array_equal(found.rooms, again.rooms)


def test_each_change_changes_what_is_seen() -> None:
    for change in CHANGES:
        changed = 0
        for seed in range(12):
            shares = crop().shares.copy()
            shares[::9, ::9, 3] = np.where(shares[::9, ::9, 0] > 0, 255, 0)
            before = shares.copy()
            change(shares, np.random.default_rng(seed))
            changed += int((shares != before).any())
            assert (shares[before[..., :3].sum(-1) == 0][:, :3] == 0).all(), "the unseen stays unseen"
        assert changed > 6, change.__name__


def test_a_crop_and_its_rooms_are_resized_together() -> None:
    given, resized = crop(), 0
    high, wide = given.rooms.shape
    for seed in range(60):
        found = disturbed(given, np.random.default_rng(seed))
        if np.array_equal(found.rooms, given.rooms):
            continue
        resized += 1
        free = found.shares.reshape(high, 2, wide, 2, -1).mean((1, 3))[..., 0] > 250
        assert (found.rooms[free] > 0).mean() > 0.99
    assert resized > 5
