"""Speed of the layout pipeline on half-explored maps, beside two library calls that it cannot do without."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
from scipy import fft

from layoutexplore.grids.grid import OCCUPIED, OccupancyGrid
from layoutexplore.layout.lines.rose2 import Rose2Config
from layoutexplore.layout.pipeline import LayoutCache, reconstruct
from layoutexplore.speed.floors import half_explored, plan
from layoutexplore.speed.measurement import SpeedRow, milliseconds

_LIMITS = {400: 15.0, 700: 30.0, 1000: 45.0}
"""Milliseconds on an idle core by the side of the map in cells."""
_RATIO = 6.0
"""Times that the two library calls may take: the published code takes about a hundred times as long."""


def layouts() -> Iterator[SpeedRow]:
    """The default method and rose2 (without its split) on partial maps.

    Then the same again with nothing changed.
    """
    methods: tuple[tuple[str, Any], ...] = (("default", None), ("rose2", Rose2Config(split=False)))
    for side, limit in _LIMITS.items():
        grid = _partial(side)
        for method, config in methods:
            yield _reconstruction(grid, method, config, limit)
    yield _unchanged(_partial(700))


def _partial(side: int) -> OccupancyGrid:
    x0, y0, x1, y1 = plan().bounds
    return OccupancyGrid(half_explored(side, side), resolution=max(x1 - x0, y1 - y0) / side)


def _reconstruction(grid: OccupancyGrid, method: str, config: Any, limit: float) -> SpeedRow:
    walls = (grid.cells == OCCUPIED).astype(np.uint8)

    def anchor() -> None:
        fft.rfft2(walls.astype(np.float64))
        cv2.HoughLinesP(walls, 1, math.pi / 180, 25, minLineLength=5, maxLineGap=0)

    ours, reference = milliseconds(lambda: reconstruct(grid, method, config), anchor, repeats=9)
    stages = reconstruct(grid, method, config).timings
    return SpeedRow(
        name=f"layout, {method}, {grid.shape[0]} x {grid.shape[1]}",
        ours=ours,
        unit="ms",
        reference=reference,
        reference_name="rfft2 + HoughLinesP",
        goal=f"<= {_RATIO:.0f}x the reference and < {limit:.0f} ms",
        reached=min(_RATIO * reference, limit) / ours,
        note=", ".join(f"{name} {1e3 * seconds:.1f}" for name, seconds in stages.items()) + " ms",
    )


def _unchanged(grid: OccupancyGrid) -> SpeedRow:
    cache = LayoutCache()
    (ours,) = milliseconds(lambda: cache(grid), repeats=9)
    return SpeedRow(
        name="layout, default, no wall changed",
        ours=ours,
        unit="ms",
        goal="< 1 ms",
        reached=1.0 / max(ours, 1e-6),
    )
