"""Canny's edges of a mask, the same as OpenCV's, cell by cell.

With one thread the detector of OpenCV 5.0 writes past its buffer where a mask has edges nearly everywhere,
and the process ends. The steps are its own: gradients by Sobel's operator of 5 cells, their strength as the
sum of both absolute values, their directions by integer tangents.

References:
    Canny, "A computational approach to edge detection" (PAMI 1986).
"""

from __future__ import annotations

from typing import cast

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.arrays import Bytes, Ints, Ints32, Mask
from layoutexplore.grids.bitsets import true_cells

TANGENT = 13573
"""tan 22.5 degrees, times 2**15."""

Gradients = NDArray[np.int16]


def canny_edges(mask: Mask, low: int, high: int) -> Mask:
    """Edges of a mask, bool (rows, cols).

    Args:
        mask: bool (rows, cols); true cells count as grey level 255, others as 0.
        low: A cell whose gradient is not above this is no edge.
        high: Of the others those are edges that hang together with one above this.

    Example:
        >>> canny_edges(np.arange(6)[None, :].repeat(6, 0) > 2, 90, 100)[0]
        array([False, False,  True, False, False, False])
    """
    low, high = min(low, high), max(low, high)
    grey = np.ascontiguousarray(mask, np.bool_).view(np.uint8) * np.uint8(255)
    across, up = (
        cast(Gradients, cv2.Sobel(grey, cv2.CV_16S, *order, ksize=5, borderType=cv2.BORDER_REPLICATE))
        for order in ((1, 0), (0, 1))
    )
    # a border of zeros, so that every cell has eight neighbours
    strength = np.zeros((grey.shape[0] + 2, grey.shape[1] + 2), np.int32)
    np.add(np.abs(across), np.abs(up), out=strength[1:-1, 1:-1])
    edges = _ridges(across, up, strength, low)
    _keep_strong(edges, strength, true_cells(edges.view(np.bool_)), high)
    return np.asarray(edges[1:-1, 1:-1] == 2)


@njit(cache=True, nogil=True)
def _ridges(across: Gradients, up: Gradients, strength: Ints32, low: int) -> Bytes:
    """1 for the cells whose strength is above `low` and the largest along their gradient, else 0.

    `strength` and the result have a border of one cell.
    """
    rows, cols = across.shape
    out = np.zeros((rows + 2, cols + 2), np.uint8)
    for r in range(rows):
        for c in range(cols):
            i, j = r + 1, c + 1
            here = strength[i, j]
            if here <= low:
                continue
            x, y = np.int64(abs(across[r, c])), np.int64(abs(up[r, c])) << 15
            flat = x * TANGENT
            # of two equal neighbours in line the first is the ridge; diagonally neither is
            if y < flat:
                ridge = here > strength[i, j - 1] and here >= strength[i, j + 1]
            elif y > flat + (x << 16):
                ridge = here > strength[i - 1, j] and here >= strength[i + 1, j]
            else:
                s = -1 if (across[r, c] < 0) != (up[r, c] < 0) else 1
                ridge = here > strength[i - 1, j - s] and here > strength[i + 1, j + s]
            if ridge:
                out[i, j] = 1
    return out


@njit(cache=True, nogil=True)
def _keep_strong(edges: Bytes, strength: Ints32, ridges: Ints, high: int) -> None:
    """Turn the 1s, at the flat indices `ridges`, into 2s where they hang together with one above `high`."""
    cols = edges.shape[1]
    flat, levels = edges.reshape(-1), strength.reshape(-1)
    # a cell is put on the stack when it becomes a 2, hence once
    stack = np.empty(len(ridges), np.int64)
    for first in ridges:
        if flat[first] != 1 or levels[first] <= high:
            continue
        flat[first] = 2
        stack[0] = first
        n = 1
        while n > 0:
            n -= 1
            at = stack[n]
            for row in (at - cols, at, at + cols):
                for k in range(row - 1, row + 2):
                    if flat[k] == 1:
                        flat[k] = 2
                        stack[n] = k
                        n += 1
