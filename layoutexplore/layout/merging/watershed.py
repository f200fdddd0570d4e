"""Watershed basins of the distance to the obstacles: the regions (superpixels) that rooms are made of."""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.arrays import Cells, Floats32, Ints, Ints32, Mask
from layoutexplore.grids.bitsets import true_cells
from layoutexplore.grids.components import root_of
from layoutexplore.grids.grid import FREE, UNKNOWN

STEPS = 8
"""Heights a cell: distances are compared in eighths, so that equal ones stay equal wherever they are."""

HIGHEST = 65535
"""What is higher counts as this high: few maps are open for 8000 cells all around."""

LARGEST_DISC = 20
"""Larger discs are not drawn: space is closed by distances, whose time does not grow with the radius."""


@njit(cache=True, nogil=True)
def _highest_first(levels: NDArray[np.uint16], inside: Ints) -> Ints32:
    """The cells inside, the highest first, equal ones in raster order: a counting sort."""
    top = 0
    for i in inside:
        top = max(top, int(levels[i]))
    begin = np.zeros(top + 2, np.int32)
    for i in inside:
        begin[top - int(levels[i]) + 1] += 1
    begin = np.cumsum(begin).astype(np.int32)
    order = np.empty(len(inside), np.int32)
    for i in inside:
        k = top - int(levels[i])
        order[begin[k]] = i
        begin[k] += 1
    return order


@njit(cache=True, nogil=True)
def _only_label(labels: Ints32, i: int, cols: int) -> int:
    """The label of a cell's straight neighbours, as nearly everywhere; 0 if any neighbour has another one."""
    below, left, right, above = labels[i - cols], labels[i - 1], labels[i + 1], labels[i + cols]
    a, b, c, d = labels[i - cols - 1], labels[i - cols + 1], labels[i + cols - 1], labels[i + cols + 1]
    # bitwise, so that it is one expression without branches; labels are of basins that may be one by now
    one = max(max(below, left), max(right, above))
    alien = (below != 0) & (below != one) | (left != 0) & (left != one)
    alien |= (right != 0) & (right != one) | (above != 0) & (above != one)
    alien |= (a != 0) & (a != one) | (b != 0) & (b != one)
    alien |= (c != 0) & (c != one) | (d != 0) & (d != one)
    return 0 if alien else one


@njit(cache=True, nogil=True)
def _meet(
    i: int,
    cols: int,
    levels: NDArray[np.uint16],
    labels: Ints32,
    parent: Ints32,
    peak: Ints32,
    share: float,
    wide: int,
) -> int:
    """The basin of a cell where basins meet, once those that are one here are united; 0 for a new peak."""
    around = (-cols - 1, -cols, -cols + 1, -1, 1, cols - 1, cols, cols + 1)
    # the cells beside a step: a diagonal one needs both
    one_side = (-cols, -cols, -cols, -1, 1, cols, cols, cols)
    other_side = (-1, -cols, 1, -1, 1, -1, cols, 1)
    h = int(levels[i])
    best = same = 0  # `same` is a label of the basin `best`
    for k in range(8):
        label = labels[i + around[k]]
        if label == same or label == 0 or levels[i + one_side[k]] == 0 or levels[i + other_side[k]] == 0:
            continue
        other = root_of(parent, label)
        if best == 0 or other == best:
            best, same = other, label
            continue
        # the higher peak takes the lower one in, of equal ones the first
        if peak[other] > peak[best] or (peak[other] == peak[best] and other < best):
            best, other, same = other, best, label
        if h >= wide or h >= share * peak[other]:
            parent[other] = best
            same = label
    return best


@njit(cache=True, nogil=True)
def _fill(
    order: Ints32,
    levels: NDArray[np.uint16],
    cols: int,
    labels: Ints32,
    parent: Ints32,
    peak: Ints32,
    share: float,
    wide: int,
) -> int:
    """Label the cells in their order and return the number of labels, 0 among them.

    The order is the highest first: each cell meets only what is as high as itself or higher.
    """
    n = 1
    for at in order:
        i = int(at)
        # where no two basins meet, the label need not be compared with others
        only = _only_label(labels, i, cols)
        if only > 0:
            labels[i] = root_of(parent, only)
            continue
        best = _meet(i, cols, levels, labels, parent, peak, share, wide)
        # a cell without a labelled neighbour is a peak: a basin begins, and its height is the peak's
        if best == 0:
            parent[n] = best = n
            peak[n] = levels[i]
            n += 1
        labels[i] = best
    return n


@njit("int32[:,::1](float32[:,::1], int64[::1], float64, int64)", cache=True, nogil=True)
def _flood(distance: Floats32, inside: Ints, share: float, wide: int) -> Ints32:
    """Basins of distances with a border of zeros, flooded from the highest down, in `STEPS` a cell.

    Where two basins meet at height h they become one if h is at least `wide`, or `share` of the lower peak.

    Args:
        distance: float32 (rows + 2, cols + 2), in cells.
        inside: int64 (n,), the flat indices of the distances above 0, rising.
        share: As a share of the lower peak.
        wide: As a height.

    Returns:
        int32 (rows, cols), labels without the border, numbered in raster order; 0 where the distance is.
    """
    rows, cols = distance.shape
    heights = distance.reshape(-1)
    levels = np.zeros(len(heights), np.uint16)
    for i in inside:
        levels[i] = min(int(heights[i] * STEPS + np.float32(0.5)), HIGHEST)
    labels = np.zeros(len(heights), np.int32)
    # at most one label a cell; grown arrays would be counted references in the loop
    parent, peak = np.empty(len(inside) + 1, np.int32), np.empty(len(inside) + 1, np.int32)
    n = _fill(_highest_first(levels, inside), levels, cols, labels, parent, peak, share, wide)
    number = np.zeros(n, np.int32)
    count = 0
    # basins that others took in are gone: what is left is numbered as it comes
    for i in inside:
        root = root_of(parent, labels[i])
        if number[root] == 0:
            count += 1
            number[root] = count
        labels[i] = number[root]
    return labels.reshape(rows, cols)[1:-1, 1:-1].copy()


def watershed_basins(blocked: Mask, resolution: float, *, share: float, wide: float) -> Ints32:
    """Basins of the distance to the obstacles.

    Args:
        blocked: bool (rows, cols), the obstacles.
        resolution: Metres a cell.
        share: Two basins are one where the pass between them is at least this share of the lower peak ...
        wide: ... or so far from the obstacles [m].

    Returns:
        int32 (rows, cols), numbered from 1 in raster order; 0 on obstacles.
    """
    padded = cv2.copyMakeBorder((~blocked).view(np.uint8), 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    distance = cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_5)
    inside = true_cells(padded.view(np.bool_))
    return np.asarray(_flood(np.ascontiguousarray(distance), inside, share, round(wide / resolution * STEPS)))


def _closed_by_distance(free: Mask, steps: int) -> Mask:
    """The closing by a disc, by two distance transforms: their time does not grow with the disc."""
    wide = np.pad(free, steps + 1)
    near = cv2.distanceTransform((~wide).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE) <= steps
    inside = cv2.distanceTransform(near.view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE) > steps
    return np.asarray(inside[steps + 1 : -steps - 1, steps + 1 : -steps - 1])


def closed_space(cells: Cells, resolution: float, radius: float) -> Mask:
    """Free cells, and the unknown cells in the chinks between them: the morphological closing by a disc.

    Args:
        cells: int8 (rows, cols), trinary.
        resolution: Metres a cell.
        radius: Of the disc [m].
    """
    free = cells == FREE
    steps = round(min(radius / resolution, max(cells.shape)))
    if steps < 1:
        return np.asarray(free)
    if steps > LARGEST_DISC:
        return np.asarray(free | (_closed_by_distance(free, steps) & (cells == UNKNOWN)))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * steps + 1, 2 * steps + 1))
    wide = cv2.copyMakeBorder(free.astype(np.uint8), steps, steps, steps, steps, cv2.BORDER_CONSTANT, value=0)
    closed = cv2.morphologyEx(wide, cv2.MORPH_CLOSE, disc)[steps:-steps, steps:-steps] > 0
    return np.asarray(free | (closed & (cells == UNKNOWN)))
