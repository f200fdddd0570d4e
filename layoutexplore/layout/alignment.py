"""Turning a grid so that its walls run along rows and columns, and labels back again.

A map comes in its canonical orientation (`layoutexplore.layout.canonical`): what follows breaks ties in
raster order, so a map and its mirror image would else differ wherever a decision is close.

The main direction is the peak of ROSE's profile of the walls' surfaces, modulo 90 degrees. Turned occupied
cells are splatted besides being looked up, so that thin walls stay closed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.arrays import Cells, Floats, Mask
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN
from layoutexplore.layout.canonical import Orientation, T

STRAIGHT = math.radians(0.6)
"""A map whose walls lie closer to the axes than this is left as it is: turning costs more than it brings."""


@dataclass(frozen=True, eq=False)
class Turned:
    """A part of a grid in a frame that is aligned with its walls.

    Attributes:
        cells: int8 (rows, cols), trinary.
        angle: Counter-clockwise angle of the frame's column axis in the grid, in radians, in (-pi/4, pi/4].
        corner: Row and column of the part in the grid.
        shape: Rows and columns of the part in its orientation.
        orientation: That was applied to the part.
    """

    cells: Cells
    angle: float
    corner: tuple[int, int]
    shape: tuple[int, int]
    orientation: Orientation = field(default_factory=Orientation)


def main_direction(profile: Floats) -> float:
    """Angle in radians in (-pi/4, pi/4] by which the walls are turned against the axes; 0 for a flat profile.

    Args:
        profile: float64 (n,), ROSE's amplitude of the wall directions 0 <= angle < pi at n equal steps, n
            even.
    """
    quarter = len(profile) // 2
    folded = profile[:quarter] + profile[quarter:]
    if not folded.max(initial=0.0) > folded.min(initial=0.0):
        return 0.0
    peak = int(folded.argmax())
    left, middle, right = folded[peak - 1], folded[peak], folded[(peak + 1) % quarter]
    bend = left - 2 * middle + right
    angle = (peak + (0.5 * (left - right) / bend if bend < 0 else 0.0)) / quarter * np.pi / 2
    angle = float(angle - np.pi / 2 if angle > np.pi / 4 else angle)
    return 0.0 if abs(angle) < STRAIGHT else angle


@njit("int8[:,::1](int8[:,::1], float64, int64, int64)", cache=True, nogil=True)
def _turn(cells: Cells, angle: float, rows: int, cols: int) -> Cells:
    """The cells turned by an angle around their middle, int8 (rows, cols)."""
    c, s = np.cos(angle), np.sin(angle)
    r0, c0 = 0.5 * (cells.shape[0] - 1), 0.5 * (cells.shape[1] - 1)
    r1, c1 = 0.5 * (rows - 1), 0.5 * (cols - 1)
    out = np.full((rows, cols), UNKNOWN, np.int8)
    for i in range(rows):
        for j in range(cols):
            x = int(np.floor(c0 + c * (j - c1) - s * (i - r1) + 0.5))
            y = int(np.floor(r0 + s * (j - c1) + c * (i - r1) + 0.5))
            if 0 <= y < cells.shape[0] and 0 <= x < cells.shape[1]:
                out[i, j] = cells[y, x]
    # a look-up skips cells where the grids beat against each other: no occupied one may be lost
    for y in range(cells.shape[0]):
        for x in range(cells.shape[1]):
            if cells[y, x] == OCCUPIED:
                j = int(np.floor(c1 + c * (x - c0) + s * (y - r0) + 0.5))
                i = int(np.floor(r1 - s * (x - c0) + c * (y - r0) + 0.5))
                if 0 <= i < rows and 0 <= j < cols:
                    out[i, j] = OCCUPIED
    return out


@njit(cache=True, nogil=True)
def _turn_back(labels: NDArray[Any], angle: float, rows: int, cols: int, out: NDArray[Any]) -> None:
    """Look up each cell of `out` (rows, cols) in labels of a turned grid; what lies outside of it stays."""
    c, s = np.cos(angle), np.sin(angle)
    r0, c0 = 0.5 * (rows - 1), 0.5 * (cols - 1)
    r1, c1 = 0.5 * (labels.shape[0] - 1), 0.5 * (labels.shape[1] - 1)
    for y in range(rows):
        for x in range(cols):
            j = int(np.floor(c1 + c * (x - c0) + s * (y - r0) + 0.5))
            i = int(np.floor(r1 - s * (x - c0) + c * (y - r0) + 0.5))
            if 0 <= i < labels.shape[0] and 0 <= j < labels.shape[1]:
                out[y, x] = labels[i, j]


@njit("boolean[:,::1](int8[:,::1])", cache=True, nogil=True)
def _surfaces(cells: Cells) -> Mask:
    """`surfaces` of contiguous cells, in two passes a row that the compiler takes many cells at once."""
    rows, cols = cells.shape
    out = np.empty((rows, cols), np.bool_)
    # whether a column has a free cell at most one row away, with a column more on either side
    near = np.zeros(cols + 2, np.bool_)
    for r in range(rows):
        here, below, above = cells[r], cells[max(r - 1, 0)], cells[min(r + 1, rows - 1)]
        for c in range(cols):
            near[c + 1] = (here[c] == FREE) | (below[c] == FREE) | (above[c] == FREE)
        for c in range(cols):
            out[r, c] = (here[c] == OCCUPIED) & (near[c] | near[c + 1] | near[c + 2])
    return out


def surfaces(cells: Cells) -> Mask:
    """Bool (rows, cols): occupied cells with a free 8-neighbour; a solid block counts by its sides only."""
    return np.asarray(_surfaces(np.ascontiguousarray(cells)))


def turn(
    cells: Cells, angle: float, corner: tuple[int, int], orientation: Orientation | None = None
) -> Turned:
    """Turn a trinary part of a grid so that the direction `angle` runs along its rows.

    Args:
        cells: int8 (rows, cols), trinary, in its orientation.
        angle: In radians, counter-clockwise from the column axis.
        corner: Where the part lies in the grid.
        orientation: That was applied to the part.
    """
    h, w = cells.shape
    if angle:
        c, s = abs(math.cos(angle)), abs(math.sin(angle))
        cells = _turn(cells, angle, math.ceil(h * c + w * s) + 2, math.ceil(w * c + h * s) + 2)
    return Turned(cells, angle, corner, (h, w), orientation or Orientation())


def turn_back(labels: NDArray[T], turned: Turned, shape: tuple[int, int]) -> NDArray[T]:
    """Labels of the turned part as labels of the whole grid, looked up cell by cell; 0 outside the part.

    Args:
        labels: int32 or bool, of the shape of `turned.cells`.
        turned: What `turn` returned.
        shape: Rows and columns of the whole grid.
    """
    if turned.angle:
        straight = np.zeros(turned.shape, labels.dtype)
        _turn_back(np.ascontiguousarray(labels), turned.angle, *turned.shape, straight)
        labels = straight
    part = turned.orientation.invert(labels)
    out = np.zeros(shape, labels.dtype)
    row, col = turned.corner
    out[row : row + part.shape[0], col : col + part.shape[1]] = part
    return out
