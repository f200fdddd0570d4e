"""The probabilistic Hough transform of a mask: the same segments as OpenCV's, in less time.

The cells come in a random order. Each votes for the lines through it, one for every degree; as soon as a line
has enough votes it is followed from the cell to both sides, and the cells of what is found leave the map,
with their votes if it is long enough. The steps and the random numbers are OpenCV's own; its table of votes
has a column for every distance at every angle, this one only for those that the map has, so that it fits into
the processor's cache.

References:
    Matas, Galambos, Kittler, "Robust detection of lines using the progressive probabilistic Hough transform"
    (CVIU 2000).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.arrays import Bytes, Floats32, Ints, Ints32
from layoutexplore.grids.bitsets import true_cells

ANGLES = 180
"""Directions of lines: one a degree."""

_SHIFT = 16
"""Binary digits behind the point of a place on a line."""

_MULTIPLIER, _LOW = np.uint64(4164903690), np.uint64(0xFFFFFFFF)
"""Of the random numbers: OpenCV's multiply with carry, whose seed is all ones."""

# OpenCV takes the degree in single precision, which moves the lines of large maps
_TURNS = [float(np.float32(math.radians(1.0))) * n for n in range(ANGLES)]
_COS = np.array([math.cos(turn) for turn in _TURNS], np.float32)
_SIN = np.array([math.sin(turn) for turn in _TURNS], np.float32)


LONGEST_IMAGE = 16_384
"""An image has at most so many rows and columns, so that the votes of a line fit in 16 bits."""

Votes = NDArray[np.int16]


class VoteTable(NamedTuple):
    """The votes of the lines, angle after angle.

    Attributes:
        votes: int16 (n,): a line of an image of `LONGEST_IMAGE` rows and columns meets 32,767 cells at most,
            those of its diagonal and of the one beside it.
        origin: int32 (ANGLES,), where the line of each angle stands that passes through the first cell.
        cos: float32 (ANGLES,), of the normals of the lines.
        sin: float32 (ANGLES,).
        places: int32 (ANGLES,), takes where the lines through one cell stand.
    """

    votes: Votes
    origin: Ints32
    cos: Floats32
    sin: Floats32
    places: Ints32


def hough_segments(image: Bytes, votes: int, length: int, gap: int) -> Ints32:
    """What `cv2.HoughLinesP` finds at steps of one cell and one degree.

    Args:
        image: uint8 (rows, cols), 1 where a cell may lie on a line, else 0.
        votes: A line is followed once it has so many.
        length: Of the shortest segment, in columns or rows [cells].
        gap: Longest gap inside a segment [cells].

    Returns:
        int32 (n, 4), column and row of both ends.

    Example:
        >>> hough_segments(np.eye(5, dtype=np.uint8), 3, 3, 0).tolist()
        [[0, 0, 4, 4]]
    """
    rows, cols = image.shape
    # a distance is largest, or smallest, in one of the corners
    corners = np.array([(0, 0), (0, cols - 1), (rows - 1, 0), (rows - 1, cols - 1)], np.float32)
    distances = np.rint(corners[:, 1:] * _COS + corners[:, :1] * _SIN).astype(np.int64)
    low, high = distances.min(axis=0), distances.max(axis=0)
    begin = np.concatenate(([0], np.cumsum(high - low + 1)))
    table = VoteTable(
        np.zeros(begin[-1], np.int16),
        (begin[:-1] - low).astype(np.int32),
        _COS,
        _SIN,
        np.empty(ANGLES, np.int32),
    )
    return _search(image.copy(), true_cells(image.view(np.bool_)), table, votes, length, gap)


@njit(cache=True, nogil=True)
def _places(table: VoteTable, row: int, col: int) -> Ints32:
    """Where the lines through a cell stand in the table, int32 (ANGLES,), written over by the next call."""
    places, y, x = table.places, np.float32(row), np.float32(col)
    for n in range(ANGLES):
        places[n] = table.origin[n] + np.int32(np.rint(x * table.cos[n] + y * table.sin[n]))
    return places


@njit(cache=True, nogil=True)
def _vote(table: VoteTable, row: int, col: int, enough: int) -> int:
    """Let a cell vote; the angle of the line with most votes, the first of equal ones, -1 without enough."""
    best, most = -1, enough - 1
    places = _places(table, row, col)
    for n in range(ANGLES):
        found = table.votes[np.uint64(places[n])] + 1
        table.votes[np.uint64(places[n])] = found
        if found > most:
            best, most = n, found
    return best


@njit(cache=True, nogil=True)
def _walk_end(open_cells: Bytes, at: tuple[int, int], step: tuple[int, int], gap: int) -> int:
    """Steps from a cell to the last open one of a segment.

    Places and steps are of columns and rows, with `_SHIFT` binary digits behind the point.
    """
    (x, y), last, k, missed = at, 0, 0, 0
    rows, cols = open_cells.shape
    while True:
        r, c = y >> _SHIFT, x >> _SHIFT
        if not (0 <= r < rows and 0 <= c < cols):
            return last
        if open_cells[r, c]:
            last, missed = k, 0
        else:
            missed += 1
            if missed > gap:
                return last
        k += 1
        x, y = x + step[0], y + step[1]


@njit(cache=True, nogil=True)
def _take(
    open_cells: Bytes, table: VoteTable, at: tuple[int, int], step: tuple[int, int], count: int, long: bool
) -> None:
    """Take the open cells of a walk of so many steps out of the map, and if it is long, their votes too."""
    x, y = at
    for _ in range(count + 1):
        r, c = y >> _SHIFT, x >> _SHIFT
        if open_cells[r, c]:
            if long:
                # also those that have not voted: such a line has fewer votes than none
                places = _places(table, r, c)
                for n in range(ANGLES):
                    table.votes[np.uint64(places[n])] -= 1
            open_cells[r, c] = 0
        x, y = x + step[0], y + step[1]


@njit(cache=True, nogil=True)
def _line(table: VoteTable, angle: int, row: int, col: int) -> tuple[tuple[int, int], tuple[int, int]]:
    """A cell and the step along a line through it, for `_walk_end`: one whole column, or one whole row."""
    one, half = 1 << _SHIFT, 1 << (_SHIFT - 1)
    a, b = -table.sin[angle], table.cos[angle]
    # what changes by whole cells has nothing behind the point, the other one begins in the cell's middle
    if abs(a) > abs(b):
        slope = int(np.rint(b * np.float32(one) / abs(a)))
        return (col << _SHIFT, (row << _SHIFT) + half), (one if a > 0 else -one, slope)
    slope = int(np.rint(a * np.float32(one) / abs(b)))
    return ((col << _SHIFT) + half, row << _SHIFT), (slope, one if b > 0 else -one)


@njit(cache=True, nogil=True)
def _search(open_cells: Bytes, cells: Ints, table: VoteTable, enough: int, length: int, gap: int) -> Ints32:
    """The segments; `open_cells` and their flat indices `cells`, rising, are changed."""
    cols, n, count = open_cells.shape[1], 0, len(cells)
    found, state = np.empty((64, 4), np.int32), ~np.uint64(0)
    while count > 0:
        state = (state & _LOW) * _MULTIPLIER + (state >> np.uint64(32))
        k = (state & _LOW) % np.uint64(count)
        i, count = cells[k], count - 1
        cells[k] = cells[count]
        row, col = i // cols, i % cols
        # it may have left with a segment already
        if not open_cells[row, col]:
            continue
        angle = _vote(table, row, col, enough)
        if angle < 0:
            continue
        at, (dx, dy) = _line(table, angle, row, col)
        ahead = _walk_end(open_cells, at, (dx, dy), gap)
        behind = _walk_end(open_cells, at, (-dx, -dy), gap)
        x0, y0 = (at[0] + ahead * dx) >> _SHIFT, (at[1] + ahead * dy) >> _SHIFT
        x1, y1 = (at[0] - behind * dx) >> _SHIFT, (at[1] - behind * dy) >> _SHIFT
        long = abs(x1 - x0) >= length or abs(y1 - y0) >= length
        _take(open_cells, table, at, (dx, dy), ahead, long)
        _take(open_cells, table, at, (-dx, -dy), behind, long)
        if long:
            if n == len(found):
                found = np.concatenate((found, np.empty_like(found)))
            found[n, 0], found[n, 1], found[n, 2], found[n, 3] = x0, y0, x1, y1
            n += 1
    return found[:n].copy()
