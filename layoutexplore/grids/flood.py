"""Labels that spread over a mask, by passes over the 8-neighbours or by rings over the 4-neighbours."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.arrays import Bytes, Ints, Ints32, Labels, Mask
from layoutexplore.grids.bitsets import true_cells

Row: TypeAlias = NDArray[np.integer[Any]]


@njit(cache=True, nogil=True)
def _grow(labels: Ints32, mask: Mask, bare: Ints) -> None:
    """Spread labels in place; `bare` are the cells of the mask without one."""
    rows, cols = mask.shape
    # The labels of a pass are written when it is over, so that all its cells see those of the pass before.
    front = np.empty(rows * cols, np.int32)
    fresh = np.empty(rows * cols, np.int32)
    fresh_labels = np.empty(rows * cols, np.int32)
    queued = np.zeros((rows, cols), np.bool_)
    n = 0
    # The first front: labelled cells beside a bare one. A cell is in a front once at most (`queued`).
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


def grow_in_place(labels: Ints32, mask: Mask, bare: Mask | None = None) -> None:
    """`grow_labels` that changes the labels it is given.

    Args:
        labels: int32 (rows, cols), contiguous.
        mask: bool (rows, cols), the cells that may be labelled.
        bare: bool (rows, cols), the cells of the mask without a label, where they are known.
    """
    bare = mask & (labels == 0) if bare is None else bare
    _grow(labels, np.ascontiguousarray(mask, np.bool_), true_cells(bare))


def grow_labels(seeds: Ints32, mask: Mask) -> Ints32:
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


def spread_in_place(
    labels: Labels, mask: Mask, steps: int | None = None, *, backwards: bool = False, consume: bool = False
) -> int:
    """Spread labels over the 4-neighbours inside a mask, ring by ring; the soonest label wins.

    Of labels that come equally soon the one wins that was queued first: the cells that begin are queued in
    raster order, the neighbours of a cell in the order next row, last row, next column, last column.

    Args:
        labels: int16 or int32 (rows, cols), C-contiguous, 0 for none; changed.
        mask: bool (rows, cols), C-contiguous, the cells that may be labelled.
        steps: At most so many cells deep; until nothing changes when None.
        backwards: Queue last row and last column before the next ones.
        consume: The mask's memory may be used: what stays in it are the cells without a label.

    Returns:
        How many cells of the mask are left without a label.

    Example:
        >>> labels = np.array([[1, 0, 0, 0, 0, 2]], np.int32)
        >>> spread_in_place(labels, np.array([[1, 1, 1, 1, 0, 1]], bool), 2), labels.tolist()
        (1, [[1, 1, 1, 0, 0, 2]])
    """
    bare = mask.view(np.uint8) if consume else np.empty(mask.shape, np.uint8)
    return int(_spread(labels, mask, bare, labels.size if steps is None else steps, 1 if backwards else -1))


@njit(cache=True, nogil=True)
def mark_border(label: Row, here: Row, below: Row, above: Row, mark: Bytes) -> None:
    """Mark the labelled cells of a row that have a bare neighbour.

    Args:
        label: Integers (cols,), above 0 where a cell is labelled.
        here: Integers (cols,), not 0 where a cell of the row is bare; none of these is labelled.
        below: The same of the row before; of the first row itself.
        above: The same of the next row; of the last row itself.
        mark: uint8 (cols or more,), written: 1 or 0.
    """
    for c in range(label.size):
        mark[c] = (label[c] > 0) & ((below[c] | above[c]) != 0)
    # One side after the other: a loop that reads again what it has written is not vectorised.
    for c in range(label.size - 1):
        mark[c] |= (label[c] > 0) & (here[c + 1] != 0)
    for c in range(1, label.size):
        mark[c] |= (label[c] > 0) & (here[c - 1] != 0)


@njit(cache=True, nogil=True)
def list_marked(mark: Bytes, first: int, border: Ints32, n: int) -> tuple[Ints32, int]:
    """Write the marked cells of a row, flat, to a list from n on.

    Args:
        mark: uint8 of a multiple of 8, not 0 where a cell is marked.
        first: Flat index of the row's first cell.
        border: int32, the list.
        n: Cells in it.

    Returns:
        The list, a longer copy where it was too short, and the cells in it.
    """
    if n + mark.size > border.size:
        border = np.concatenate((border, np.empty(border.size + mark.size, np.int32)))
    words = mark.view(np.uint64)
    for w in range(words.size):
        if words[w] != 0:
            for c in range(8 * w, 8 * w + 8):
                if mark[c]:
                    border[n] = first + c
                    n += 1
    return border, n


@njit(cache=True, nogil=True)
def _spread(labels: Labels, mask: Mask, bare: Bytes, steps: int, sign: int) -> int:
    """The kernel of `spread_in_place`; the first neighbour of a cell to be queued lies `-sign` rows away.

    The cells without a label are written to `bare`, which may be the mask itself.
    """
    rows, cols = mask.shape
    flat, left = labels.ravel(), 0
    for r in range(rows):
        for c in range(cols):
            bare[r, c] = mask[r, c] & (labels[r, c] == 0)
        for c in range(cols):
            left += bare[r, c]
    border = np.empty(left // 4 + 1024, np.int32)
    last = 0
    mark = np.zeros(8 * (cols // 8 + 1), np.uint8)
    for r in range(rows):
        mark_border(labels[r], bare[r], bare[max(r - 1, 0)], bare[min(r + 1, rows - 1)], mark)
        border, last = list_marked(mark, r * cols, border, last)
    # A cell is queued when it is labelled, hence once; queue[first:end] is the ring that is `step` deep.
    queue = np.empty(last + left, np.int32)
    queue[:last] = border[:last]
    first, step = 0, 0
    begun, open_cells, size = last, bare.ravel(), flat.size
    # A column too far comes out in another row, which matters where cells at the sides are bare alone.
    sides = cols > 1 and (bare[:, 0].any() or bare[:, cols - 1].any())
    steps_aside = (-sign * cols, sign * cols, -sign, sign)
    while first < last and step < steps:
        step += 1
        end = last
        while first < end:
            i = int(queue[np.uint64(first)])
            first += 1
            label = flat[np.uint64(i)]
            for away in steps_aside:
                k = i + away
                if k < 0 or k >= size:
                    continue
                place = np.uint64(k)
                if open_cells[place]:
                    if sides and (away == 1 or away == -1) and k // cols != i // cols:
                        continue
                    open_cells[place] = 0
                    flat[place] = label
                    queue[np.uint64(last)] = k
                    last += 1
    return left - (last - begun)
