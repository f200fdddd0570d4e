"""Labels that spread over a mask as a wavefront, pass by pass."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.bitsets import true_cells


@njit("void(int32[:,::1], boolean[:,::1], int64[::1])", cache=True, nogil=True)
def _grow(labels: NDArray[np.int32], mask: NDArray[np.bool_], bare: NDArray[np.int64]) -> None:
    """Spread labels in place; `bare` are the cells of the mask without one."""
    rows, cols = mask.shape
    front = np.empty(rows * cols, np.int32)
    fresh = np.empty(rows * cols, np.int32)
    fresh_labels = np.empty(rows * cols, np.int32)
    queued = np.zeros((rows, cols), np.bool_)
    n = 0
    for i in bare:
        r, c = i // cols, i % cols
        for rr in range(max(r - 1, 0), min(r + 2, rows)):
            for cc in range(max(c - 1, 0), min(c + 2, cols)):
                if labels[rr, cc] > 0 and not queued[rr, cc]:
                    queued[rr, cc] = True
                    front[n] = rr * cols + cc
                    n += 1
    while n > 0:
        m = 0
        for k in range(n):
            r0, c0 = front[k] // cols, front[k] % cols
            for r in range(max(r0 - 1, 0), min(r0 + 2, rows)):
                for c in range(max(c0 - 1, 0), min(c0 + 2, cols)):
                    if not mask[r, c] or labels[r, c] != 0 or queued[r, c]:
                        continue
                    queued[r, c] = True
                    found = 0
                    for rr in range(max(r - 1, 0), min(r + 2, rows)):
                        for cc in range(max(c - 1, 0), min(c + 2, cols)):
                            if found == 0 and labels[rr, cc] > 0:
                                found = labels[rr, cc]
                    fresh[m] = r * cols + c
                    fresh_labels[m] = found
                    m += 1
        for k in range(m):
            labels[fresh[k] // cols, fresh[k] % cols] = fresh_labels[k]
            front[k] = fresh[k]
        n = m


def grow_in_place(
    labels: NDArray[np.int32], mask: NDArray[np.bool_], bare: NDArray[np.bool_] | None = None
) -> None:
    """`grow_labels` that changes the labels it is given.

    Args:
        labels: int32 (rows, cols), contiguous.
        mask: bool (rows, cols), the cells that may be labelled.
        bare: bool (rows, cols), the cells of the mask without a label, where they are known.
    """
    bare = mask & (labels == 0) if bare is None else bare
    _grow(labels, np.ascontiguousarray(mask, np.bool_), true_cells(bare))


def grow_labels(seeds: NDArray[np.int32], mask: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Spread labels over the 8-neighbours inside a mask until nothing changes.

    All cells of a pass see the labels of the pass before; of several labelled neighbours the first in raster
    order counts.

    Args:
        seeds: int32 (rows, cols), labels above 0, 0 where there is none.
        mask: bool (rows, cols), the cells that may be labelled; seeds stay where they are.

    Returns:
        int32 (rows, cols).

    Example:
        >>> grow_labels(np.array([[1, 0, 0, 0, 2]], np.int32), np.array([[1, 1, 1, 0, 1]], bool))
        array([[1, 1, 1, 0, 2]], dtype=int32)
    """
    labels = np.array(seeds, np.int32, order="C")
    grow_in_place(labels, mask)
    return labels


@njit("void(int32[:,::1], boolean[:,::1], int64[::1], int64)", cache=True, nogil=True)
def _spread(out: NDArray[np.int32], wall: NDArray[np.bool_], front: NDArray[np.int64], steps: int) -> None:
    """Spread labels in place from the cells of a front."""
    rows, cols = out.shape
    for _ in range(steps):
        fresh = np.empty(4 * len(front), np.int64)
        m = 0
        for i in front:
            r, c = i // cols, i % cols
            for d in range(4):
                rr, cc = r + (d == 0) - (d == 1), c + (d == 2) - (d == 3)
                if 0 <= rr < rows and 0 <= cc < cols and wall[rr, cc] and out[rr, cc] == 0:
                    out[rr, cc] = out[r, c]
                    fresh[m] = rr * cols + cc
                    m += 1
        front = fresh[:m]


@njit("boolean[:,::1](int32[:,::1], int64[::1])", cache=True, nogil=True)
def _beside_walls(labels: NDArray[np.int32], wall: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Labelled cells with a cell of the wall (flat) among their 4-neighbours."""
    rows, cols = labels.shape
    out = np.zeros((rows, cols), np.bool_)
    for i in wall:
        r, c = i // cols, i % cols
        for d in range(4):
            rr, cc = r + (d == 0) - (d == 1), c + (d == 2) - (d == 3)
            if 0 <= rr < rows and 0 <= cc < cols and labels[rr, cc] > 0:
                out[rr, cc] = True
    return out


def spread_in_place(labels: NDArray[np.int32], wall: NDArray[np.bool_], steps: int) -> None:
    """Spread labels into the walls by 4-neighbours, at most `steps` cells deep.

    Args:
        labels: int32 (rows, cols), contiguous; changed.
        wall: bool (rows, cols), contiguous.
        steps: In cells.
    """
    _spread(labels, wall, true_cells(_beside_walls(labels, true_cells(wall))), steps)
