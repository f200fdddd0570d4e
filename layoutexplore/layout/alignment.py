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

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.arrays import Bytes, Cells, Floats, Ints, Ints32, Mask
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN
from layoutexplore.layout.canonical import Orientation, T

STRAIGHT = math.radians(0.6)
"""A map whose walls lie closer to the axes than this is left as it is: turning costs more than it brings."""

_AT_ONCE = 1 << 20
"""Cells that are compared at once."""


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


ASKEW_ANGLE = math.radians(10.0)
"""Walls that run closer to the rows or columns than this are taken to run along them."""

WING = 2
"""Further directions that a map has at least where a wing is askew; one alone is that of a single wall."""


def askew_directions(directions: Floats, angle: float) -> Floats:
    """Directions that run along neither axis of a turned grid, in its frame: (-pi/2, pi/2], as they come.

    None where there is only one: a wing has walls along it and across it.

    Args:
        directions: float64 (k,), of walls, in radians.
        angle: By which the grid was turned.
    """
    turned = np.pi / 2 - np.mod(np.pi / 2 - (directions - angle), np.pi)
    off = np.abs(turned - np.round(turned / (np.pi / 2)) * (np.pi / 2))
    return (
        np.asarray(turned[off > ASKEW_ANGLE]) if np.count_nonzero(off > ASKEW_ANGLE) >= WING else np.zeros(0)
    )


def _turn(cells: Cells, angle: float) -> Cells:
    """The cells turned by an angle around their middle, each looked up, and no occupied one lost."""
    beyond = int(np.array(UNKNOWN, np.int8).view(np.uint8))
    turned = _looked_up(np.ascontiguousarray(cells).view(np.uint8), angle, beyond).view(np.int8)
    # A look-up skips cells where the grids beat against each other: no occupied one may be lost.
    at = turned_places(places(cells, OCCUPIED), angle, cells.shape, turned.shape)
    turned[at[:, 0], at[:, 1]] = OCCUPIED
    return turned


def _looked_up(values: Bytes, angle: float, beyond: int) -> Bytes:
    """Bytes uint8 (rows, cols[, channels]) turned by an angle around their middle, `beyond` outside."""
    high, wide = values.shape[:2]
    c, s = math.cos(angle), math.sin(angle)
    rows, cols = (math.ceil(a * abs(c) + b * abs(s)) + 2 for a, b in ((high, wide), (wide, high)))
    r0, c0, r1, c1 = (0.5 * (size - 1) for size in (high, wide, rows, cols))
    places_of = np.array([[c, -s, c0 - c * c1 + s * r1], [s, c, r0 - s * c1 - c * r1]])
    flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
    return np.asarray(cv2.warpAffine(values, places_of, (cols, rows), flags=flags, borderValue=(beyond,) * 4))


def places(cells: Cells, wanted: int) -> Ints:
    """Rows and columns int64 (n, 2) of the cells of a value, in raster order."""
    # Several times as fast as `numpy.argwhere`, and a part at a time, so that no mask of all cells is needed.
    flat = cells.reshape(-1)
    parts = [
        np.flatnonzero(flat[begin : begin + _AT_ONCE] == wanted) + begin
        for begin in range(0, len(flat), _AT_ONCE)
    ]
    found = np.concatenate(parts) if parts else np.zeros(0, np.int64)
    return np.stack(np.divmod(found, cells.shape[1]), axis=1)


def turned_places(
    members: Ints32 | Ints, angle: float, shape: tuple[int, int], turned_shape: tuple[int, int]
) -> Ints32:
    """Where cells int (n, 2) of a grid lie in the turned one, which has the same middle, int32 (n, 2).

    Args:
        members: Rows and columns.
        angle: By which the grid is turned, as for `turn`.
        shape: Rows and columns of the grid.
        turned_shape: Those of the turned one.
    """
    c, s = math.cos(angle), math.sin(angle)
    (r0, c0), (r1, c1) = ((0.5 * (rows - 1), 0.5 * (cols - 1)) for rows, cols in (shape, turned_shape))
    y, x = members[:, 0] - r0, members[:, 1] - c0
    found = np.stack([r1 - s * x + c * y, c1 + c * x + s * y], axis=1)
    return np.ascontiguousarray(np.floor(found + 0.5), np.int32)


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


@njit(cache=True, nogil=True)
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
    shape = cells.shape[0], cells.shape[1]
    return Turned(_turn(cells, angle) if angle else cells, angle, corner, shape, orientation or Orientation())


def turn_labels(labels: Ints32, turned: Turned) -> Ints32:
    """Labels of the whole grid in the turned frame, each looked up as its cell: the opposite of `turn_back`.

    Args:
        labels: int32 (rows, cols).
        turned: What `turn` returned.

    Returns:
        int32 of the shape of `turned.cells`, 0 beyond the part.
    """
    (row, col), (rows, cols) = turned.corner, turned.shape[:: -1 if turned.orientation.swap else 1]
    part = turned.orientation.apply(np.ascontiguousarray(labels[row : row + rows, col : col + cols]))
    if not turned.angle:
        return part
    # Four bytes a label are looked up as one is of a cell, and at the same places.
    as_bytes = np.ascontiguousarray(part, np.int32).view(np.uint8).reshape(*part.shape, 4)
    found: Ints32 = _looked_up(as_bytes, turned.angle, 0).view(np.int32)[:, :, 0]
    return found


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
