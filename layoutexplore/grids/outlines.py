"""From cells to polygons: the exact outlines of labels and masks, by walking along the sides of their cells.

Every side between a cell of a label and one of another is walked once, the label on the left; so rings that
run counter-clockwise are shells and the others holes. Where two cells of a label touch at a corner only, the
walk stays with its cell: what a ring encloses is four-connected.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import shapely
from numba import njit
from numpy.typing import NDArray
from shapely import MultiPolygon, Polygon

from layoutexplore.grids.arrays import Bytes, Ints, Ints32, Mask
from layoutexplore.grids.bitsets import true_cells
from layoutexplore.grids.components import label_components
from layoutexplore.grids.polygons import Point

# Sides lead from corner to corner: 0 to the next column, 1 to the next row, 2 and 3 back again.
_STEP_R = np.array([0, 1, 0, -1], np.int64)
_STEP_C = np.array([1, 0, -1, 0], np.int64)


class Rings(NamedTuple):
    """The rings around the labels of a grid; corner (r, c) is the lower left one of cell (r, c).

    Attributes:
        corners: int32 (n, 2) as (row, col), ring after ring. The first of a ring may lie in the middle of a
            straight line, the others are where it turns.
        starts: int64 (k + 1,): ring i has the corners from `starts[i]` to `starts[i + 1]`.
        labels: int32 (k,), the label on the left of each ring.
        touching: bool (k,), whether at a corner of the ring its label touches itself.
    """

    corners: Ints32
    starts: Ints
    labels: Ints32
    touching: Mask


def trace_rings(labels: Ints32) -> Rings:
    """Walk around all labels of a grid int32 (rows, cols), C-contiguous, 0 for none.

    Example:
        >>> rings = trace_rings(np.array([[7, 7]], np.int32))
        >>> rings.corners.tolist(), rings.starts.tolist(), rings.labels.tolist()
        ([[0, 0], [0, 2], [1, 2], [1, 0]], [0, 4], [7])
    """
    return Rings(*_trace(labels, true_cells(_ends(labels))))


def trace_mask(mask: Mask, resolution: float, origin: Point) -> Polygon | MultiPolygon:
    """The outline of a mask's cells as polygons in metres (to the micrometre), one a four-connected part.

    A ring that comes through a corner twice is cut into two, because a polygon's ring must not touch itself.

    Args:
        mask: bool (rows, cols).
        resolution: Side of a cell in metres.
        origin: World point of the lower left corner of cell (0, 0).

    Example:
        >>> trace_mask(np.array([[True, True], [True, False]]), 0.5, (0.0, 0.0)).area
        0.75
    """
    parts, count = label_components(mask)
    rings = trace_rings(parts)
    if not len(rings.labels):
        return Polygon()
    corners, sizes = _from_lowest(rings.corners, rings.starts)
    starts = np.cumsum(sizes) - sizes
    # No two rings leave a corner to the right: their first corners tell them apart.
    order = np.lexsort(corners[starts].T[::-1])
    cut: list[Any] = []
    owners: list[int] = []
    for ring in order.tolist():
        walk = corners[starts[ring] : starts[ring] + sizes[ring]]
        pieces = cut_where_touching(walk.tolist()) if rings.touching[ring] else [walk]
        cut += pieces
        owners += [int(rings.labels[ring])] * len(pieces)
    polygons = _polygons(
        np.concatenate(cut), np.array([len(c) for c in cut]), np.array(owners), resolution, origin
    )
    return polygons[0] if count == 1 else shapely.multipolygons(polygons)


def _polygons(
    corners: Ints32, sizes: Ints, owners: Ints, resolution: float, origin: Point
) -> NDArray[np.object_]:
    """A polygon for each of the parts 1, 2, ... in metres, all at once: noise has tens of thousands.

    Args:
        corners: int (n, 2) as (row, col), ring after ring: of a part a shell, counter-clockwise, and holes.
        sizes: int (k,), how many corners each ring has.
        owners: int (k,), the part of each ring.
        resolution: Side of a cell in metres.
        origin: World point of the corner (0, 0).
    """
    starts = np.cumsum(sizes) - sizes
    following = np.arange(1, len(corners) + 1)
    following[starts + sizes - 1] = starts
    y, x = corners.T.astype(np.int64)
    turned = np.add.reduceat(x * y[following] - x[following] * y, starts)
    points = np.round(np.asarray(origin) + corners[:, ::-1] * resolution, 6)
    lines = shapely.linearrings(points, indices=np.repeat(np.arange(len(sizes)), sizes))
    # Of a polygon's rings the first is its shell.
    order = np.lexsort((turned <= 0, owners))
    return np.asarray(shapely.polygons(lines[order], indices=owners[order] - 1))


@njit(cache=True, nogil=True)
def _from_lowest(corners: Ints32, starts: Ints) -> tuple[Ints32, Ints]:
    """Each ring from its first corner, in raster order, that a side leaves to the right.

    Args:
        corners: As `Rings.corners`.
        starts: As `Rings.starts`.

    Returns:
        The corners int32 (n, 2), ring after ring, less those in the middle of a straight line, and how many
        each ring has, int64 (k,).
    """
    turned, sizes = np.empty_like(corners), np.empty(len(starts) - 1, np.int64)
    n = 0
    for k in range(len(sizes)):
        first, last = starts[k], starts[k + 1] - 1
        # Only the corner that a walk begins at may lie in the middle of a line.
        comes_level = corners[last, 0] == corners[first, 0]
        if comes_level == (corners[first, 0] == corners[first + 1, 0]):
            first += 1
        size = last + 1 - first
        lowest = -1
        for i in range(size):
            a, b = first + i, first + (i + 1) % size
            right = corners[b, 1] > corners[a, 1]
            if right and (lowest < 0 or _before(corners[a], corners[first + lowest])):
                lowest = i
        for i in range(size):
            from_here = first + (lowest + i) % size
            turned[n + i, 0], turned[n + i, 1] = corners[from_here, 0], corners[from_here, 1]
        sizes[k] = size
        n += size
    return turned[:n], sizes


@njit(cache=True, nogil=True)
def _before(a: Ints32, b: Ints32) -> bool:
    """Whether a corner comes before another in raster order."""
    return bool(a[0] < b[0] or (a[0] == b[0] and a[1] < b[1]))


def cut_where_touching(ring: list[list[Any]]) -> list[list[list[Any]]]:
    """The rings that a ring, a list of corners, falls into at the corners that it comes through twice."""
    rings: list[list[list[Any]]] = []
    path: list[list[Any]] = []
    place: dict[tuple[Any, Any], int] = {}
    for corner in ring:
        first = place.get((corner[0], corner[1]))
        if first is not None:
            rings.append(path[first:])
            for row, col in path[first:]:
                del place[row, col]
            del path[first:]
        place[corner[0], corner[1]] = len(path)
        path.append(corner)
    return [*rings, path]


@njit(cache=True, nogil=True, inline="always")
def _at(labels: Ints32, r: int, c: int) -> int:
    if r < 0 or c < 0 or r >= labels.shape[0] or c >= labels.shape[1]:
        return 0
    return int(labels[r, c])


@njit(cache=True, nogil=True)
def _left(labels: Ints32, r: int, c: int, d: int) -> int:
    """Label on the left of the side that leaves corner (r, c) in direction d."""
    if d == 0:
        return _at(labels, r, c)
    if d == 1:
        return _at(labels, r, c - 1)
    if d == 2:
        return _at(labels, r - 1, c - 1)
    return _at(labels, r - 1, c)


@njit(cache=True, nogil=True)
def _right(labels: Ints32, r: int, c: int, d: int) -> int:
    return _left(labels, r + _STEP_R[d], c + _STEP_C[d], (d + 2) % 4)


@njit(cache=True, nogil=True)
def _walk(
    labels: Ints32, start: tuple[int, int, int], label: int, seen: Bytes, corners: Ints32
) -> tuple[int, bool]:
    """Write the corners of the ring that leaves a corner in a direction (row, col, d), the label to its left.

    `seen` has a bit for each side that leaves a corner: a ring is closed when it comes to a side again.

    Returns:
        How many there are, and whether at one of them the label touches itself.
    """
    (r, c, d), last, n, touches = start, -1, 0, False
    while not seen[r, c] & (1 << d):
        seen[r, c] |= 1 << d
        if d != last:
            corners[n, 0] = r
            corners[n, 1] = c
            n += 1
        last = d
        r, c = int(r + _STEP_R[d]), int(c + _STEP_C[d])
        # With another label ahead on the left the way turns left, also where ahead on the right is the label
        # again: cells that touch at a corner only stay apart. With the label on both sides it turns right.
        if _left(labels, r, c, d) != label:
            touches |= _right(labels, r, c, d) == label
            d = (d + 1) % 4
        elif _right(labels, r, c, d) == label:
            d = (d + 3) % 4
    return n, touches


@njit(cache=True, nogil=True)
def _trace(labels: Ints32, ends: Ints) -> tuple[Ints32, Ints, Ints32, Mask]:
    """The fields of `Rings`.

    Args:
        labels: int32 (rows, cols).
        ends: int64 (m,), rising flat indices of all labelled cells with another label above or below them, or
            more.
    """
    rows, cols = labels.shape
    seen = np.zeros((rows + 1, cols + 1), np.uint8)
    # Every ring and every corner belongs to the lower or the upper side of such a cell, a corner to one end
    # of it.
    corners = np.empty((4 * len(ends), 2), np.int32)
    starts = np.zeros(2 * len(ends) + 1, np.int64)
    owners, touching = np.empty(2 * len(ends), np.int32), np.empty(2 * len(ends), np.bool_)
    k = 0
    for i in ends:
        r0, c0 = i // cols, i % cols
        label = labels[r0, c0]
        below = r0 > 0 and labels[r0 - 1, c0] == label
        above = r0 + 1 < rows and labels[r0 + 1, c0] == label
        # Every ring has a lower and an upper side, so that none is missed.
        for side in (0, 2):
            if (below and side == 0) or (above and side == 2):
                continue
            r1, c1 = (r0, c0) if side == 0 else (r0 + 1, c0 + 1)
            if seen[r1, c1] & (1 << side):
                continue
            n, touching[k] = _walk(labels, (r1, c1, side), label, seen, corners[starts[k] :])
            starts[k + 1] = starts[k] + n
            owners[k] = label
            k += 1
    return corners[: starts[k]], starts[: k + 1], owners[:k], touching[:k]


@njit(cache=True, nogil=True)
def _ends(labels: Ints32) -> Mask:
    """Labelled cells with another label above or below them, or nothing."""
    rows, cols = labels.shape
    out = np.empty((rows, cols), np.bool_)
    for r in range(rows):
        below, above = max(r - 1, 0), min(r + 1, rows - 1)
        if below == r or above == r:  # the first row and the last
            for c in range(cols):
                out[r, c] = labels[r, c] != 0
        else:
            for c in range(cols):
                label = labels[r, c]
                out[r, c] = (label != 0) & ((labels[below, c] != label) | (labels[above, c] != label))
    return out
