"""The seen part of every room: known free space with the doors shut.

A door is a short gap in a wall behind which the space widens on both sides. With the doors shut, what lies further than
`CORE` from walls and doors falls into cores, and every free cell goes to the core it can be walked to soonest. Shadows do
not matter: the distance is measured to walls alone, not to what is unknown.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grid import FREE, OCCUPIED, UNKNOWN

DOOR_WIDTHS = (0.45, 2.2)
"""Metres: narrowest and widest gap that counts as a door."""

DOOR_WALL = 0.3
"""Metres of wall in line with a door, on one side at least."""

WIDENING, WIDENING_DEPTH = 0.4, 0.6
"""Metres: beside a door the space is wider by this much within this distance, on both sides."""

CORE = 0.5
"""Metres: two regions are one where the way between them is wider than twice this."""


@dataclass(frozen=True, eq=False)
class Regions:
    """The seen rooms of a grid.

    Attributes:
        labels: int32 (rows, cols), region of each known free cell, from 1; 0 elsewhere.
        count: Number of regions.
        door_width: float32 (rows, cols), width in metres of the gap that a cell lies in, 0 elsewhere.
    """

    labels: NDArray[np.int32]
    count: int
    door_width: NDArray[np.float32]


def seen_regions(cells: NDArray[np.int8], resolution: float) -> Regions:
    """Divide the known free space into the seen parts of rooms.

    Args:
        cells: int8 (rows, cols), -1 unknown, 0 free, 100 occupied.
        resolution: Metres per cell.

    Example:
        >>> rows = ["#########", "#...#...#", "#.......#", "#...#...#", "#########"]
        >>> cells = np.array([[100 if c == "#" else 0 for c in row] for row in rows], np.int8)
        >>> regions = seen_regions(np.kron(cells, np.ones((8, 8), np.int8)), 0.1)
        >>> regions.count, round(float(regions.door_width.max()), 1)
        (2, 0.8)
    """
    labels, door_width = np.zeros(cells.shape, np.int32), np.zeros(cells.shape, np.float32)
    box = _known_box(cells, round((DOOR_WIDTHS[1] + WIDENING) / resolution) + 1)
    part = np.ascontiguousarray(cells[box])
    occupied, free = part == OCCUPIED, part == FREE
    doors = find_doors(occupied, resolution)
    distance = cv2.distanceTransform((~occupied & (doors == 0)).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_3)
    core = (free & (distance * resolution > CORE)).astype(np.uint8)
    count, cores = cv2.connectedComponents(core, connectivity=4, ltype=cv2.CV_32S)
    labels[box], count = _grow(cores.astype(np.int32), free, int(count))
    door_width[box] = doors
    return Regions(labels, count - 1, door_width)


def _known_box(cells: NDArray[np.int8], margin: int) -> tuple[slice, slice]:
    """Where something is known, with a margin; the whole grid when nothing is."""
    known = cells != UNKNOWN
    rows, cols = np.flatnonzero(known.any(1)), np.flatnonzero(known.any(0))
    if len(rows) == 0:
        return np.s_[:, :]
    return np.s_[max(rows[0] - margin, 0) : rows[-1] + margin + 1, max(cols[0] - margin, 0) : cols[-1] + margin + 1]


def region_boxes(regions: Regions) -> NDArray[np.int64]:
    """Per region int64 (count + 1, 5): number of cells, and the half-open box (row0, col0, row1, col1) around them."""
    return _boxes(regions.labels, regions.count)


def find_doors(occupied: NDArray[np.bool_], resolution: float) -> NDArray[np.float32]:
    """Gaps along rows and columns that may be doors: float32 (rows, cols), their width in metres, 0 elsewhere."""
    lengths = (*DOOR_WIDTHS, DOOR_WALL, WIDENING, WIDENING_DEPTH)
    sizes = np.array([max(round(length / resolution), 1) for length in lengths], np.int64)
    along = _gaps(np.ascontiguousarray(occupied), sizes)
    across = _gaps(np.ascontiguousarray(occupied.T), sizes).T
    width = np.where((along == 0) | ((across > 0) & (across < along)), across, along)
    return np.ascontiguousarray(width).astype(np.float32) * np.float32(resolution)


@njit(cache=True, nogil=True)
def _gaps(occupied: NDArray[np.bool_], sizes: NDArray[np.int64]) -> NDArray[np.int32]:
    """Widths in cells of the doors along the rows."""
    narrowest, widest, wall, widening, depth = int(sizes[0]), int(sizes[1]), int(sizes[2]), int(sizes[3]), int(sizes[4])
    rows, cols = occupied.shape
    runs = np.zeros((rows, cols), np.int32)
    for r in range(rows):
        begin = 0
        for c in range(cols + 1):
            if c == cols or occupied[r, c]:
                runs[r, begin:c] = c - begin
                begin = c + 1
    gaps = np.zeros((rows, cols), np.int32)
    for r in range(rows):
        c = 1
        while c < cols:
            n = int(runs[r, c])
            if n >= narrowest and n <= widest and c + n < cols and occupied[r, c - 1]:
                middle = c + n // 2
                if (
                    (_wall_run(occupied, r, c - 1, -1, wall) or _wall_run(occupied, r, c + n, 1, wall))
                    and _widens(runs, r, middle, -1, depth, n + widening)
                    and _widens(runs, r, middle, 1, depth, n + widening)
                ):
                    gaps[r, c : c + n] = n
            c += max(n, 1)
    return gaps


@njit(cache=True, nogil=True)
def _wall_run(occupied: NDArray[np.bool_], r: int, c: int, step: int, wanted: int) -> bool:
    """Whether a wall that may step aside by a cell goes on for so many cells."""
    for _ in range(wanted):
        if not 0 <= c < occupied.shape[1]:
            return False
        if not (occupied[r, c] or occupied[max(r - 1, 0), c] or occupied[min(r + 1, occupied.shape[0] - 1), c]):
            return False
        c += step
    return True


@njit(cache=True, nogil=True)
def _widens(runs: NDArray[np.int32], r: int, c: int, step: int, depth: int, wanted: int) -> bool:
    for k in range(1, depth + 1):
        row = r + step * k
        if row < 0 or row >= runs.shape[0] or runs[row, c] == 0:
            return False
        if runs[row, c] >= wanted:
            return True
    return False


@njit(cache=True, nogil=True)
def _grow(labels: NDArray[np.int32], free: NDArray[np.bool_], count: int) -> tuple[NDArray[np.int32], int]:
    """Spread labels over free 4-neighbours in rings; free space without any core becomes regions of its own."""
    rows, cols = labels.shape
    queue = np.empty((rows * cols, 2), np.int32)
    last = 0
    for r in range(rows):
        for c in range(cols):
            if labels[r, c]:
                queue[last] = r, c
                last += 1
    first = _spread(labels, free, queue, 0, last)
    for r in range(rows):
        for c in range(cols):
            if free[r, c] and labels[r, c] == 0:
                labels[r, c] = count
                count += 1
                queue[first] = r, c
                first = _spread(labels, free, queue, first, first + 1)
    return labels, count


@njit(cache=True, nogil=True)
def _spread(labels: NDArray[np.int32], free: NDArray[np.bool_], queue: NDArray[np.int32], first: int, last: int) -> int:
    rows, cols = labels.shape
    while first < last:
        row, col = queue[first]
        first += 1
        for step in range(4):
            r, c = row + (step == 0) - (step == 1), col + (step == 2) - (step == 3)
            if 0 <= r < rows and 0 <= c < cols and free[r, c] and labels[r, c] == 0:
                labels[r, c] = labels[row, col]
                queue[last] = r, c
                last += 1
    return last


@njit(cache=True, nogil=True)
def _boxes(labels: NDArray[np.int32], count: int) -> NDArray[np.int64]:
    boxes = np.zeros((count + 1, 5), np.int64)
    for r in range(labels.shape[0]):
        for c in range(labels.shape[1]):
            label = labels[r, c]
            if label == 0:
                continue
            box = boxes[label]
            if box[0] == 0:
                box[1], box[2], box[3], box[4] = r, c, r, c
            box[0] += 1
            box[1], box[2] = min(box[1], r), min(box[2], c)
            box[3], box[4] = max(box[3], r + 1), max(box[4], c + 1)
    return boxes
