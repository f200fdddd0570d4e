"""Topology of segmentations: components, and the spread of lines."""

from __future__ import annotations

import numpy as np

from layoutexplore.layout.lines.topology import quantile_extent


def test_spread_is_the_quantiles_of_each_rank() -> None:
    rng = np.random.default_rng(0)
    values, rank = rng.random(500), rng.integers(0, 7, 500)
    low, high = quantile_extent(values, rank, 7, 0.1)
    for k in range(7):
        assert (low[k], high[k]) == tuple(np.quantile(values[rank == k], (0.1, 0.9), method="lower"))


def test_spread_of_equal_and_of_rounded_values() -> None:
    rng = np.random.default_rng(1)
    values = np.concatenate([np.full(90, -7.5), np.round(rng.normal(size=3000), 1), rng.random(800) * 1e9])
    rank = np.repeat([0, 1, 2], [90, 3000, 800])
    low, high = quantile_extent(values, rank, 3, 0.05)
    for k in range(3):
        assert (low[k], high[k]) == tuple(np.quantile(values[rank == k], (0.05, 0.95), method="lower"))
