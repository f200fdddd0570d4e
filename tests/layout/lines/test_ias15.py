"""Walls of IAS-15: their directions, and islands among the clutter."""

from __future__ import annotations

import numpy as np

from layoutexplore.layout.lines.ias15 import mean_shift_directions, without_islands


def test_mean_shift_finds_the_directions_around_zero():
    rng = np.random.default_rng(0)
    angles = np.mod(
        np.concatenate((rng.normal(0, 0.02, 60), rng.normal(np.pi / 2, 0.02, 40), rng.normal(0.8, 0.02, 20))),
        np.pi,
    )
    directions, member = mean_shift_directions(angles, 0.023, 0.01)
    assert len(directions) == 3
    for expected in (0.0, 0.8, np.pi / 2):
        assert np.abs(np.mod(directions - expected + np.pi / 2, np.pi) - np.pi / 2).min() < 0.02
    assert np.bincount(member).tolist() in ([60, 20, 40], [20, 40, 60])
    assert len(mean_shift_directions(np.zeros(0), 0.023, 0.01)[0]) == 0


def test_islands_are_dropped_and_walls_stay():
    walls = np.zeros((100, 100), bool)
    walls[10, 5:95] = True
    walls[50:54, 50:54] = True
    assert np.array_equal(np.flatnonzero(without_islands(walls, 0.05, 0.15, 1.0).any(axis=1)), [10])
