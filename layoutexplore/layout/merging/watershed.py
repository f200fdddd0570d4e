"""Watershed basins of the distance to the obstacles: the regions (superpixels) that rooms are made of."""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.arrays import Cells, Floats32, Ints32, Mask
from layoutexplore.grids.components import root_of
from layoutexplore.grids.grid import FREE, UNKNOWN
from layoutexplore.grids.runs import runs_of
from layoutexplore.layout.merging.chamfer import BORDER, run_distances

STEPS = 8
"""Heights a cell: distances are compared in eighths, so that equal ones stay equal wherever they are."""

HIGHEST = 65535
"""What is higher counts as this high: few maps are open for 8000 cells all around."""

LARGEST_DISC = 20
"""Larger discs are not drawn: space is closed by distances, whose time does not grow with the radius."""


@njit(cache=True, nogil=True)
def _find_levels(far: Floats32, runs: Ints32) -> NDArray[np.uint16]:
    """Heights of the cells of runs in `STEPS` a cell, flat, with the border of the distances; 0 elsewhere."""
    levels = np.zeros(far.shape, np.uint16)
    for k in range(len(runs)):
        r, first, last = runs[k]
        here, heights = levels[r + BORDER, first + BORDER : last + BORDER], far[r + BORDER, first + BORDER :]
        for c in range(here.size):
            here[c] = min(int(heights[c] * STEPS + np.float32(0.5)), HIGHEST)
    return levels.reshape(-1)


@njit(cache=True, nogil=True)
def _highest_first(levels: NDArray[np.uint16], runs: Ints32, cols: int) -> Ints32:
    """The cells of runs, the highest first, equal ones in raster order: a counting sort.

    Cells and `cols` are of the levels, with their border.
    """
    count, total = np.zeros(int(levels.max()) + 1, np.int32), 0
    for k in range(len(runs)):
        r, first, last = runs[k]
        for i in range((r + BORDER) * cols + first + BORDER, (r + BORDER) * cols + last + BORDER):
            count[levels[i]] += 1
        total += last - first
    # where the next cell of a level goes: behind those of all higher ones
    place = 0
    for level in range(len(count) - 1, -1, -1):
        place, count[level] = place + count[level], place
    order = np.empty(total, np.int32)
    for k in range(len(runs)):
        r, first, last = runs[k]
        for i in range((r + BORDER) * cols + first + BORDER, (r + BORDER) * cols + last + BORDER):
            order[count[levels[i]]] = i
            count[levels[i]] += 1
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
    """The basin of a cell where basins meet, once those that are one here are united; 0 for a new peak.

    The cell goes where its highest neighbour is. Along a wall all cells are equally high: a basin that took
    what it touches would run along the wall of the next room.
    """
    around = (-cols - 1, -cols, -cols + 1, -1, 1, cols - 1, cols, cols + 1)
    # the cells beside a step: a diagonal one needs both
    one_side = (-cols, -cols, -cols, -1, 1, cols, cols, cols)
    other_side = (-1, -cols, 1, -1, 1, -1, cols, 1)
    h = int(levels[i])
    best = uphill = top = 0  # `uphill` is the label of the highest neighbour, straight ones first
    for k in (1, 3, 4, 6, 0, 2, 5, 7):
        label = labels[i + around[k]]
        if label == 0 or levels[i + one_side[k]] == 0 or levels[i + other_side[k]] == 0:
            continue
        if levels[i + around[k]] > top:
            uphill, top = label, levels[i + around[k]]
        other = root_of(parent, label)
        if best == 0 or other == best:
            best = other
            continue
        # the higher peak takes the lower one in, of equal ones the first
        if peak[other] > peak[best] or (peak[other] == peak[best] and other < best):
            best, other = other, best
        if h >= wide or h >= share * peak[other]:
            parent[other] = best
    return root_of(parent, uphill) if uphill else 0


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


@njit(cache=True, nogil=True)
def _flood(far: Floats32, runs: Ints32, share: float, wide: int) -> Ints32:
    """Basins of distances with a `BORDER`, flooded from the highest down, in `STEPS` a cell.

    Where two basins meet at height h they become one if h is at least `wide`, or `share` of the lower peak.

    Args:
        far: float32 (rows + 2 `BORDER`, cols + 2 `BORDER`), in cells; its memory is used.
        runs: int32 (n, 3), the runs of distances above 0.
        share: As a share of the lower peak.
        wide: As a height.

    Returns:
        int32 (rows, cols), labels without the border, numbered in raster order; 0 where the distance is.
    """
    rows, cols = far.shape
    levels = _find_levels(far, runs)
    order = _highest_first(levels, runs, cols)
    # memory that is at hand is much cheaper than new one, and what is no distance is 0 already
    labels = far.reshape(-1).view(np.int32)
    labels[order] = 0
    # at most one label a cell; grown arrays would be counted references in the loop
    parent, peak = np.empty(len(order) + 1, np.int32), np.empty(len(order) + 1, np.int32)
    n = _fill(order, levels, cols, labels, parent, peak, share, wide)
    out, number = np.zeros((rows - 2 * BORDER, cols - 2 * BORDER), np.int32), np.zeros(n, np.int32)
    count = 0
    # basins that others took in are gone: what is left is numbered as it comes, most cells as the one before
    for k in range(len(runs)):
        r, first, last = runs[k]
        here, there = labels[(r + BORDER) * cols + first + BORDER :], out[r, first:last]
        label = found = 0
        for c in range(there.size):
            if here[c] != label:
                label = here[c]
                root = root_of(parent, label)
                if number[root] == 0:
                    count += 1
                    number[root] = count
                found = number[root]
            there[c] = found
    return out


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
    runs = runs_of(np.ascontiguousarray(blocked).view(np.uint8), 0)
    far = run_distances(runs, *blocked.shape)
    return np.asarray(_flood(far, runs, share, round(wide / resolution * STEPS)))


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
