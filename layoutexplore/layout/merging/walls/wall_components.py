"""The connected-component clutter filter: what floats freely and is small is clutter, the rest wall."""

from __future__ import annotations

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Bytes, Mask
from layoutexplore.grids.components import join_runs
from layoutexplore.grids.morphology import with_neighbours
from layoutexplore.grids.runs import find_runs
from layoutexplore.layout.limits import cells_at_most

MOST_STEPS = 100
"""Obstacles are grown by no more cells."""


@njit(cache=True, nogil=True)
def _structural(near: Bytes, occupied: Mask, resolution: float, area: float, length: float) -> Mask:
    """The cells of the components of `near`, over eight neighbours, that are large or long enough."""
    runs = find_runs(near, np.uint8(0))
    number = join_runs(runs, near, 1)
    count = number.max() + 1 if len(runs) else 0
    # By part: first row and column, row and column behind the last (half open), and the occupied cells.
    low = np.full((count, 2), max(occupied.shape), np.int64)
    high, filled = np.zeros((count, 2), np.int64), np.zeros(count, np.int64)
    for k in range(len(runs)):
        part = number[k]
        r, begin, end = runs[k]
        low[part, 0], low[part, 1] = min(low[part, 0], r), min(low[part, 1], begin)
        high[part, 0], high[part, 1] = max(high[part, 0], r + 1), max(high[part, 1], end)
        for c in range(begin, end):
            filled[part] += occupied[r, c]
    out = np.zeros(occupied.shape, np.bool_)
    for k in range(len(runs)):
        part = number[k]
        longest = max(high[part, 0] - low[part, 0], high[part, 1] - low[part, 1])
        if filled[part] * resolution**2 >= area or longest * resolution > length:
            out[runs[k, 0], runs[k, 1] : runs[k, 2]] = True
    return out


def structural_components(
    occupied: Mask, doors: Mask, resolution: float, *, gap: float, area: float, length: float
) -> Mask:
    """Obstacles and door gaps that are structure: bool (rows, cols); other components are small and float.

    A sensor breaks a thin wall into pieces, each of which floats: what lies within a small gap of each other
    is one component.

    Args:
        occupied: bool (rows, cols), the obstacles.
        doors: bool (rows, cols), the cells of door gaps; with them, obstacles hang together.
        resolution: Metres a cell.
        gap: Obstacles this far apart hang together [m]; 0 for those that touch.
        area: Components of structure have this occupied area at least [m2] ...
        length: ... or are longer than this [m].
    """
    solid = np.ascontiguousarray(occupied | doors)
    steps = cells_at_most(gap / 2, resolution, MOST_STEPS) if gap else 0
    near: Bytes = (with_neighbours(solid, steps) if steps else solid).view(np.uint8)
    # grown by half the gap on either side, a component is longer than it was by that much
    longest = length + 2 * steps * resolution
    return np.asarray(
        solid
        & _structural(np.ascontiguousarray(near), np.ascontiguousarray(occupied), resolution, area, longest)
    )
