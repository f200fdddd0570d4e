"""Which obstacles belong to the building: what floats freely and is small is clutter."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.bitsets import true_cells
from layoutexplore.grids.components import join, root_of


@njit(cache=True, nogil=True)
def _runs(
    cells: NDArray[np.int64], occupied: NDArray[np.bool_]
) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Runs of cells along the rows, (n, 4) as begin, end, row and occupied cells, and each row's first run."""
    rows, cols = occupied.shape
    runs = np.empty((len(cells), 4), np.int32)
    first = np.zeros(rows + 1, np.int64)
    n = 0
    for i in cells:
        r, c = i // cols, i % cols
        if n == 0 or runs[n - 1, 2] != r or runs[n - 1, 1] != c:
            runs[n, 0], runs[n, 2], runs[n, 3] = c, r, 0
            n += 1
            first[r + 1] += 1
        runs[n - 1, 1] = c + 1
        runs[n - 1, 3] += occupied[r, c]
    return runs[:n], np.cumsum(first)


@njit("boolean[:,::1](int64[::1], boolean[:,::1], float64, float64, float64)", cache=True, nogil=True)
def _building(
    solid: NDArray[np.int64], occupied: NDArray[np.bool_], resolution: float, area: float, length: float
) -> NDArray[np.bool_]:
    runs, first = _runs(solid, occupied)
    parent = np.arange(len(runs)).astype(np.int32)
    for r in range(1, occupied.shape[0]):
        above, end = first[r - 1], first[r]
        for k in range(first[r], first[r + 1]):
            while above < end and runs[above, 1] < runs[k, 0]:
                above += 1
            other = above
            while other < end and runs[other, 0] <= runs[k, 1]:
                join(parent, k, other)
                other += 1
    boxes = np.empty((len(runs), 4), np.int32)  # by root: first and last row and column
    filled = np.zeros(len(runs), np.int64)
    for k in range(len(runs)):
        root = root_of(parent, k)
        begin, end, r = runs[k, 0], runs[k, 1], runs[k, 2]
        if root == k:  # the first run of its part
            boxes[k, 0], boxes[k, 1], boxes[k, 2], boxes[k, 3] = r, r + 1, begin, end
        boxes[root, 1] = max(boxes[root, 1], r + 1)
        boxes[root, 2], boxes[root, 3] = min(boxes[root, 2], begin), max(boxes[root, 3], end)
        filled[root] += runs[k, 3]
    out = np.zeros(occupied.shape, np.bool_)
    for k in range(len(runs)):
        root = root_of(parent, k)
        box = boxes[root]
        if (
            filled[root] * resolution**2 >= area
            or max(box[1] - box[0], box[3] - box[2]) * resolution > length
        ):
            for c in range(runs[k, 0], runs[k, 1]):
                out[runs[k, 2], c] = True
    return out


def building_parts(
    occupied: NDArray[np.bool_], doors: NDArray[np.bool_], resolution: float, *, area: float, length: float
) -> NDArray[np.bool_]:
    """Obstacles and doors that belong to the building: bool (rows, cols); the rest floats freely and is small.

    Args:
        occupied: bool (rows, cols), the obstacles.
        doors: bool (rows, cols), the cells of doors; with them, obstacles hang together.
        resolution: Metres a cell.
        area: Parts of the building have this occupied area at least [m2] ...
        length: ... or are longer than this [m].
    """
    solid = true_cells(occupied | doors)
    return np.asarray(_building(solid, np.ascontiguousarray(occupied), resolution, area, length))
