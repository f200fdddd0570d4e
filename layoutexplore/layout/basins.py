"""Basins of the distance to the obstacles: the pieces that rooms are put together from."""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grid import FREE, UNKNOWN

STEPS = 8
"""Heights a cell: distances are compared in eighths of a cell, so that equal ones stay equal wherever they are."""


@njit("int32[:,::1](float32[:,::1])", cache=True, nogil=True)
def _levels(distance: NDArray[np.float32]) -> NDArray[np.int32]:
    rows, cols = distance.shape
    out = np.empty((rows, cols), np.int32)
    for r in range(rows):
        for c in range(cols):
            out[r, c] = np.int32(distance[r, c] * STEPS + np.float32(0.5))
    return out


@njit(cache=True, nogil=True)
def _find(parent: NDArray[np.int32], i: int) -> int:
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@njit(cache=True, nogil=True)
def _flood(levels: NDArray[np.int32], share: float, wide: int) -> NDArray[np.int32]:
    """Label the basins of integer heights, from the highest down; cells of height 0 get none.

    Where two basins meet at height h they become one if h is at least `wide`, or `share` of the lower peak.
    """
    rows, cols = levels.shape
    top = 0
    for r in range(rows):
        for c in range(cols):
            top = max(top, levels[r, c])
    counts = np.zeros(top + 2, np.int64)
    for r in range(rows):
        for c in range(cols):
            counts[top - levels[r, c] + 1] += 1
    for k in range(1, top + 2):
        counts[k] += counts[k - 1]
    order = np.empty(counts[top], np.int32)
    for r in range(rows):
        for c in range(cols):
            v = levels[r, c]
            if v > 0:
                order[counts[top - v]] = r * cols + c
                counts[top - v] += 1
    labels = np.zeros((rows, cols), np.int32)
    parent = np.empty(1024, np.int32)
    peak = np.empty(1024, np.int32)
    n = 1
    for k in range(len(order)):
        r, c = order[k] // cols, order[k] % cols
        h = levels[r, c]
        best = 0
        for dr in range(-1, 2):
            for dc in range(-1, 2):
                rr, cc = r + dr, c + dc
                if rr < 0 or cc < 0 or rr >= rows or cc >= cols or labels[rr, cc] == 0:
                    continue
                if dr != 0 and dc != 0 and (levels[r, cc] == 0 or levels[rr, c] == 0):
                    continue
                other = _find(parent, labels[rr, cc])
                if best == 0:
                    best = other
                elif other != best:
                    if h >= wide or h >= share * min(peak[other], peak[best]):
                        if peak[other] > peak[best] or (peak[other] == peak[best] and other < best):
                            best, other = other, best
                        parent[other] = best
                    elif peak[other] > peak[best] or (peak[other] == peak[best] and other < best):
                        best = other
        if best == 0:
            if n >= len(parent):
                parent = np.concatenate((parent, np.empty_like(parent)))
                peak = np.concatenate((peak, np.empty_like(peak)))
            parent[n] = n
            peak[n] = h
            best = n
            n += 1
        labels[r, c] = best
    ids = np.zeros(n, np.int32)
    m = 0
    for r in range(rows):
        for c in range(cols):
            if labels[r, c] > 0:
                root = _find(parent, labels[r, c])
                if ids[root] == 0:
                    m += 1
                    ids[root] = m
                labels[r, c] = ids[root]
    return labels


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
    levels = _levels(np.ascontiguousarray(distance[1:-1, 1:-1]))
    return np.asarray(_flood(levels, share, round(wide / resolution * STEPS)))


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
