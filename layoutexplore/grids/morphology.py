"""Morphology on masks: discs, inflation, growing."""

from __future__ import annotations

import math
from functools import lru_cache

import cv2
import numpy as np
from numba import njit

from layoutexplore.errors import ConfigError, MapError
from layoutexplore.grids.arrays import Bytes, Cells, Floats32, Ints32, Mask
from layoutexplore.grids.grid import UNKNOWN, check_resolution


def inflate(occupied: Mask, radius: float, resolution: float) -> Mask:
    """Cells whose centre is closer than the radius to the centre of an occupied cell.

    Args:
        occupied: bool (rows, cols).
        radius: In metres; 0 gives a copy.
        resolution: Side of a cell in metres.

    Returns:
        bool (rows, cols). Outside of the array there is nothing.

    Example:
        >>> inflate(np.array([[False, False, False, True]]), radius=0.2, resolution=0.1).tolist()
        [[False, False, True, True]]
    """
    check_resolution(resolution)
    if not (math.isfinite(radius) and radius >= 0):
        raise ConfigError(f"the radius must be metres, 0 or more, got {radius}")
    world = check_mask(occupied)
    reach = radius / resolution
    near = disc(reach)
    if near.size == 1:
        return world.copy()
    if reach <= _SMALL_DISC:
        return cv2.dilate(world.view(np.uint8), near).view(np.bool_)
    distance = cv2.distanceTransform((~world).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return distance.astype(np.float64) ** 2 < _squared(reach) if world.any() else world.copy()


def check_mask(mask: Mask) -> Mask:
    """The mask, C-contiguous; raises `MapError` unless it is bool (rows, cols) and not empty."""
    if mask.ndim != 2 or mask.dtype != np.bool_ or mask.size == 0:
        raise MapError(
            f"planning needs a non-empty bool array in two dimensions, got {mask.dtype} {mask.shape}"
        )
    return np.ascontiguousarray(mask)


def _squared(radius: float) -> float:
    """The square of a radius in cells: those at exactly the radius lie outside, however it was rounded."""
    return radius * radius - 1e-9


_SMALL_DISC = 8
"""Radius up to which a disc is laid around every cell; beyond, distances are faster."""


def dilate_by_disc(mask: Mask, radius: float) -> Mask:
    """Cells whose centre is as close as the radius to the centre of a cell of the mask, or closer.

    Args:
        mask: bool (rows, cols).
        radius: In cells, 0 or more; time and memory do not grow with it.

    Example:
        >>> dilate_by_disc(np.array([[False, False, False, True]]), 2.0).tolist()
        [[False, True, True, True]]
    """
    marked = check_mask(mask)
    if radius <= _SMALL_DISC:
        return cv2.dilate(marked.view(np.uint8), disc(radius, closed=True)).view(np.bool_)
    if not marked.any():
        return marked.copy()
    distance = cv2.distanceTransform((~marked).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    # Squares of distances are whole numbers.
    return np.asarray(distance < math.sqrt(math.floor(radius * radius) + 0.5), np.bool_)


def with_neighbours(mask: Mask, reach: int = 1) -> Mask:
    """The cells of a mask bool (rows, cols), and those around one: by default those that touch it.

    Args:
        mask: bool (rows, cols).
        reach: Cells within so many rows and columns of one of the mask belong to it, 0 or more.

    Example:
        >>> with_neighbours(np.array([[False, False, False, True]])).tolist()
        [[False, False, True, True]]
    """
    square = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
    return cv2.dilate(np.ascontiguousarray(mask).view(np.uint8), square).view(np.bool_)


def depth_inside(mask: Mask) -> Floats32:
    """Cells float32 (rows, cols) from the centre of each cell of a mask to that of the nearest one outside.

    All around the array is outside, and cells outside are 0 deep.

    Args:
        mask: bool (rows, cols).

    Example:
        >>> depth_inside(np.array([[True, True, False]])).tolist()
        [[1.0, 1.0, 0.0]]
    """
    padded = np.pad(mask, 1).view(np.uint8)
    return np.asarray(cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1])


def opened_by_box(mask: Mask, rows: int, cols: int) -> Mask:
    """The cells of a mask that a box of so many rows and columns covers that lies in it, or half outside.

    Args:
        mask: bool (rows, cols).
        rows: Of the box, 1 or more.
        cols: Of the box.

    Example:
        >>> opened_by_box(np.array([[True, False, False, True, True, False]]), 1, 2).tolist()
        [[True, False, False, True, True, False]]
    """
    box, row, col = np.ones((rows, cols), np.uint8), rows // 2, cols // 2
    # A box of an even side has no middle: it may lie at one place more than there are cells, and on the way
    # back its other middle counts, or all would move by a cell.
    spare = (0, 1 - rows % 2), (0, 1 - cols % 2)
    inside = cv2.erode(np.pad(mask, spare, constant_values=True).view(np.uint8), box, anchor=(col, row))
    covered = cv2.dilate(inside, box, anchor=(cols - 1 - col, rows - 1 - row))
    return np.asarray(covered[: mask.shape[0], : mask.shape[1]] > 0)


def closed_by_box(mask: Mask, rows: int, cols: int) -> Mask:
    """A mask, and what is too narrow around it for a box of so many rows and columns: see `opened_by_box`.

    Args:
        mask: bool (rows, cols).
        rows: Of the box, 1 or more.
        cols: Of the box.

    Example:
        >>> closed_by_box(np.array([[True, False, True, False, False, True]]), 1, 2).tolist()
        [[True, True, True, False, False, True]]
    """
    return ~opened_by_box(~mask, rows, cols)


@lru_cache(maxsize=32)
def disc(radius: float, *, closed: bool = False) -> Bytes:
    """The cells within a radius of a middle one, centre to centre, as uint8 (n, n) of 0 and 1.

    Args:
        radius: In cells, 0 or more.
        closed: Whether centres at exactly the radius belong to the disc.

    Returns:
        As small as possible (n is odd), read-only.

    Example:
        >>> disc(1.0).tolist(), disc(1.0, closed=True).tolist()
        ([[1]], [[0, 1, 0], [1, 1, 1], [0, 1, 0]])
    """
    span = np.arange(-math.ceil(radius), math.ceil(radius) + 1)
    squares = span[:, None] ** 2 + span[None, :] ** 2
    near = squares <= radius * radius if closed else squares < _squared(radius)
    near[near.shape[0] // 2, near.shape[1] // 2] = True
    rows = np.flatnonzero(near.any(axis=1))
    out = near[rows[0] : rows[-1] + 1, rows[0] : rows[-1] + 1].astype(np.uint8)
    out.setflags(write=False)
    return out


@lru_cache(maxsize=32)
def disc_offsets(radius: float, *, closed: bool = False) -> Ints32:
    """The offsets int32 (n, 2) of the cells of `disc` from the middle one, in raster order."""
    near = disc(radius, closed=closed)
    return np.ascontiguousarray(np.argwhere(near) - near.shape[0] // 2, np.int32)


def nearest_cells(mask: Mask) -> tuple[Floats32, Ints32]:
    """For every cell the nearest one of a mask, which holds at least one: how far it is, and where.

    Returns:
        float32 (rows, cols), distances in cells; int32 (rows, cols, 2), (row, col).

    Example:
        >>> distance, place = nearest_cells(np.array([[False, False, True]]))
        >>> distance.tolist(), place[0, 0].tolist()
        ([[2.0, 1.0, 0.0]], [0, 2])
    """
    distance, label = cv2.distanceTransformWithLabels(
        (~mask).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    places = np.zeros((int(label.max()) + 1, 2), np.int32)
    places[label[mask]] = np.argwhere(mask)
    return np.asarray(distance, np.float32), places[label]


MOST_THICKNESS = 32_767
"""Of a line that OpenCV draws."""


def draw_way(cells: Bytes, start: Ints32, end: Ints32, width: float, value: int) -> None:
    """Give the cells of a straight way between two cells (row, col) a value.

    Args:
        cells: uint8 (rows, cols), drawn into.
        start: int32 (2,).
        end: int32 (2,).
        width: In cells; at least one is drawn.
        value: The value.
    """
    (r0, c0), (r1, c1) = start.tolist(), end.tolist()
    cv2.line(cells, (c0, r0), (c1, r1), value, min(max(1, round(width)), MOST_THICKNESS))


@njit(cache=True, nogil=True, inline="always")
def borders_unknown(cells: Cells, row: int, col: int) -> bool:
    """Whether one of the four neighbours of a cell of a grid is unknown."""
    rows, cols = cells.shape
    return bool(
        (row > 0 and cells[row - 1, col] == UNKNOWN)
        or (row + 1 < rows and cells[row + 1, col] == UNKNOWN)
        or (col > 0 and cells[row, col - 1] == UNKNOWN)
        or (col + 1 < cols and cells[row, col + 1] == UNKNOWN)
    )


@njit(cache=True, nogil=True)
def measure_clearance(field: Bytes) -> None:
    """Turn what is not 0 into the Chebyshev distance to the nearest 0, at most 255; the border is 0."""
    rows, cols = field.shape
    # Down from the cells before, then up from those behind (Rosenfeld and Pfaltz, "Sequential operations in
    # digital picture processing", JACM 1966): a step is one, also aslant, so that two passes do.
    for r in range(1, rows - 1):
        before, here = field[r - 1], field[r]
        for c in range(1, cols - 1):
            if here[c]:
                nearest = min(before[c - 1], before[c], before[c + 1], here[c - 1])
                here[c] = min(nearest, 254) + 1
    for r in range(rows - 2, 0, -1):
        behind, here = field[r + 1], field[r]
        for c in range(cols - 2, 0, -1):
            nearest = min(behind[c - 1], behind[c], behind[c + 1], here[c + 1])
            here[c] = min(here[c], min(nearest, 254) + 1)


def grow(seeds: Mask, free: Mask, steps: float) -> Mask:
    """Free cells within an octile geodesic distance of the seeds, the free seeds included.

    Args:
        seeds: bool (rows, cols).
        free: bool (rows, cols), where the way may lead; no corner is cut.
        steps: Distance in cells.
    """
    inside = np.ascontiguousarray(seeds & free)
    edge = inside & with_neighbours(free & ~inside)
    return _grow(inside, edge, np.ascontiguousarray(free), steps + 1e-4)


@njit(cache=True, nogil=True)
def _grow(seeds: Mask, edge: Mask, free: Mask, limit: float) -> Mask:
    """Label-correcting wave from the seeds' edge: distances sink until no cell improves a neighbour."""
    rows, cols = seeds.shape
    distance = np.full((rows, cols), np.inf, np.float32)
    queued = np.zeros((rows, cols), np.bool_)
    # A cell is in a front once at most, though it may come again in later ones, when its distance has sunk.
    front = np.empty(rows * cols, np.int32)
    behind = np.empty(rows * cols, np.int32)
    size = 0
    for r in range(rows):
        for c in range(cols):
            if seeds[r, c]:
                distance[r, c] = 0.0
            if edge[r, c]:
                front[size] = r * cols + c
                size += 1
    while size:
        following = 0
        for k in range(size):
            r, c = divmod(front[k], cols)
            queued[r, c] = False
            for dr in range(-1, 2):
                for dc in range(-1, 2):
                    rr, cc = r + dr, c + dc
                    if (
                        (dr == 0 and dc == 0)
                        or rr < 0
                        or cc < 0
                        or rr >= rows
                        or cc >= cols
                        or not free[rr, cc]
                    ):
                        continue
                    # A diagonal step needs both cells that it squeezes past.
                    if dr != 0 and dc != 0 and not (free[r, cc] and free[rr, c]):
                        continue
                    further = distance[r, c] + np.float32(1.4142135 if dr != 0 and dc != 0 else 1.0)
                    if further < distance[rr, cc] and further <= limit:
                        distance[rr, cc] = further
                        if not queued[rr, cc]:
                            queued[rr, cc] = True
                            behind[following] = rr * cols + cc
                            following += 1
        front, behind = behind, front
        size = following
    return distance < np.inf
