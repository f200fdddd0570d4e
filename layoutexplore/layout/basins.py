"""Basins of the distance to the obstacles: the pieces that rooms are put together from."""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grid import FREE, UNKNOWN

STEPS = 8
"""Heights a cell: distances are compared in eighths of a cell, so that equal ones stay equal wherever they are."""


@njit(cache=True, nogil=True)
def _find(parent: NDArray[np.int32], i: int) -> int:
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@njit("void(float32[:,::1], int64[::1], int32[:,::1], float64, int64)", cache=True, nogil=True)
def _flood(distance: NDArray[np.float32], inside: NDArray[np.int64], basins: NDArray[np.int32], share: float, wide: int) -> None:
    """Label the basins of distances with a border of zeros, from the highest down; heights are rounded to `STEPS` a cell.

    Where two basins meet at height h they become one if h is at least `wide`, or `share` of the lower peak.

    Args:
        distance: float32 (rows, cols), in cells.
        inside: int64 (n,), the flat indices of the distances above 0, rising.
        basins: int32 (rows, cols) of zeros; takes the labels.
        share: As a share of the lower peak.
        wide: As a height.
    """
    cols = distance.shape[1]
    heights, labels = distance.reshape(-1), basins.reshape(-1)
    levels = np.zeros(len(heights), np.int32)
    top = 0
    for i in inside:
        levels[i] = np.int32(heights[i] * STEPS + np.float32(0.5))
        top = max(top, levels[i])
    counts = np.zeros(top + 2, np.int64)
    for i in inside:
        counts[top - levels[i] + 1] += 1
    for k in range(1, top + 2):
        counts[k] += counts[k - 1]
    order = np.empty(len(inside), np.int64)
    for i in inside:
        k = top - levels[i]
        order[counts[k]] = i
        counts[k] += 1
    around = np.array((-cols - 1, -cols, -cols + 1, -1, 1, cols - 1, cols, cols + 1))
    # the cells beside a step: a diagonal one needs both
    beside = np.array(((-cols, -1), (-cols, -cols), (-cols, 1), (-1, -1), (1, 1), (cols, -1), (cols, cols), (cols, 1)))
    parent = np.empty(1024, np.int32)
    peak = np.empty(1024, np.int32)
    n = 1
    for i in order:
        h = levels[i]
        below, left, right, above = labels[i - cols], labels[i - 1], labels[i + 1], labels[i + cols]
        a, b, c, d = labels[i - cols - 1], labels[i - cols + 1], labels[i + cols - 1], labels[i + cols + 1]
        straight = max(max(below, left), max(right, above))
        alien = (below != 0) & (below != straight) | (left != 0) & (left != straight)
        alien |= (right != 0) & (right != straight) | (above != 0) & (above != straight)
        alien |= (a != 0) & (a != straight) | (b != 0) & (b != straight)
        alien |= (c != 0) & (c != straight) | (d != 0) & (d != straight)
        if straight > 0 and not alien:  # one label all around, as nearly everywhere
            labels[i] = _find(parent, straight)
            continue
        best = same = 0  # `same` is a label of the basin `best`
        for k in range(8):
            label = labels[i + around[k]]
            if label == same or label == 0 or levels[i + beside[k, 0]] == 0 or levels[i + beside[k, 1]] == 0:
                continue
            other = _find(parent, label)
            if best == 0 or other == best:
                best = other
            elif h >= wide or h >= share * min(peak[other], peak[best]):
                if peak[other] > peak[best] or (peak[other] == peak[best] and other < best):
                    best, other = other, best
                parent[other] = best
            elif peak[other] > peak[best] or (peak[other] == peak[best] and other < best):
                best = other
            else:
                continue
            same = label
        if best == 0:
            if n >= len(parent):
                parent = np.concatenate((parent, np.empty_like(parent)))
                peak = np.concatenate((peak, np.empty_like(peak)))
            parent[n] = n
            peak[n] = h
            best = n
            n += 1
        labels[i] = best
    root = np.zeros(n, np.int32)
    for k in range(1, n):
        root[k] = _find(parent, k)
    ids = np.zeros(n, np.int32)
    m = 0
    for i in inside:
        label = root[labels[i]]
        if ids[label] == 0:
            m += 1
            ids[label] = m
        labels[i] = ids[label]


def distance_basins(blocked: NDArray[np.bool_], resolution: float, *, share: float, wide: float) -> NDArray[np.int32]:
    """Basins of the distance to the obstacles.

    Args:
        blocked: bool (rows, cols), the obstacles.
        resolution: Metres a cell.
        share: Two basins are one where the pass between them is at least this share of the lower peak ...
        wide: ... or so far from the obstacles [m].

    Returns:
        int32 (rows, cols), numbered from 1 in raster order; 0 on obstacles.
    """
    padded = cv2.copyMakeBorder((~blocked).astype(np.uint8), 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    distance = cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_5)
    labels = np.zeros(padded.shape, np.int32)
    inside = np.flatnonzero(padded.view(np.bool_))
    _flood(np.ascontiguousarray(distance), inside, labels, share, round(wide / resolution * STEPS))
    return np.ascontiguousarray(labels[1:-1, 1:-1])


def closed_space(cells: NDArray[np.int8], resolution: float, radius: float) -> NDArray[np.bool_]:
    """Free cells, and the unknown cells in the chinks between them: the morphological closing by a disc.

    Args:
        cells: int8 (rows, cols), trinary.
        resolution: Metres a cell.
        radius: Of the disc [m].
    """
    free = cells == FREE
    steps = round(radius / resolution)
    if steps < 1:
        return np.asarray(free)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * steps + 1, 2 * steps + 1))
    wide = cv2.copyMakeBorder(free.astype(np.uint8), steps, steps, steps, steps, cv2.BORDER_CONSTANT, value=0)
    closed = cv2.morphologyEx(wide, cv2.MORPH_CLOSE, disc)[steps:-steps, steps:-steps] > 0
    return np.asarray(free | (closed & (cells == UNKNOWN)))
