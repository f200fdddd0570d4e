"""From the probabilities of single cells to the shapes of rooms.

One cell of each lattice cell is classified, each by itself; rooms have straight walls. So the rectangle is
sought that the classified cells of a room fit best, cells inside it are taken for likelier and those outside
for less likely than the classifier says, and between the centres of the lattice cells probabilities change
gradually. Then the likeliest cells make the shape.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.arrays import Cells, Floats, Floats32, Mask
from layoutexplore.grids.grid import UNKNOWN
from layoutexplore.predictors.cell_model.features import CandidateCells
from layoutexplore.predictors.room_completion import Shape

EVIDENCE = 1.0
"""Log-odds that a cell gains inside of its room's rectangle, and loses outside of it."""

_STARTS = (0.3, 0.5, 0.7)
"""Probabilities whose cells' boxes a rectangle is improved from."""

_DOUBT = 1e-4
"""No probability is nearer to 0 or 1 than this."""


class Window(NamedTuple):
    """The lattice cells near a region.

    Attributes:
        region: Its id.
        row, col: First lattice cell.
        chance: float64 (rows, cols), probability that a lattice cell belongs to the region's room, 0 where
            it was not classified.
        classified: bool (rows, cols), where it was.
    """

    region: int
    row: int
    col: int
    chance: Floats
    classified: Mask


def room_shapes(cells: Cells, candidates: CandidateCells, probability: Floats) -> dict[int, Shape]:
    """By region the unknown cells that belong to its room; the likelier one of two rooms has a cell.

    Args:
        cells: int8 (rows, cols), what is known.
        candidates: The classified cells.
        probability: float64 (n,) of each that it belongs to the room of its region.
    """
    stride = candidates.stride
    rooms = np.zeros(cells.shape, np.int32)
    best = np.zeros(cells.shape, np.float32)
    boxes: dict[int, tuple[slice, slice]] = {}
    for window in _windows(candidates, probability):
        chance, classified = _interpolate(straightened(window), stride)
        row, col = window.row * stride, window.col * stride
        low, high = max(-row, 0), max(-col, 0)
        box = np.s_[row + low : row + chance.shape[0], col + high : col + chance.shape[1]]
        known_size = cells[box].shape
        inner = np.s_[low : low + known_size[0], high : high + known_size[1]]
        chance, classified = chance[inner], classified[inner] & (cells[box] == UNKNOWN)
        if classified.any():
            taken = classified & (chance >= likeliest_overlap(chance[classified])) & (chance > best[box])
            rooms[box][taken], best[box][taken] = window.region, chance[taken]
            boxes[window.region] = box
    return {region: Shape(box[0].start, box[1].start, rooms[box] == region) for region, box in boxes.items()}


def likeliest_overlap(probability: NDArray[np.floating]) -> float:
    """The probability from which cells make the shape of the greatest expected overlap with a room.

    The expected intersection over union of the likeliest n cells is close to their summed probability over n
    plus the summed probability of all others, so that the best threshold is that ratio over one plus that
    ratio: below a half.

    Example:
        >>> likeliest_overlap(np.array([0.9, 0.2, 0.8, 0.4]))
        0.4
    """
    falling = np.sort(probability)[::-1]
    summed = falling.cumsum(dtype=np.float64)
    overlap = summed / (np.arange(1, len(falling) + 1) + summed[-1] - summed)
    return float(falling[overlap.argmax()])


def straightened(window: Window) -> Window:
    """The same lattice cells, likelier inside the rectangle that fits them best, less likely outside."""
    sure = np.clip(window.chance, _DOUBT, 1.0 - _DOUBT)
    evidence = np.full(sure.shape, -EVIDENCE)
    row0, row1, col0, col1 = best_rectangle(window.chance, window.classified)
    evidence[row0:row1, col0:col1] = EVIDENCE
    odds = sure / (1.0 - sure) * np.exp(evidence)
    return window._replace(chance=np.where(window.classified, odds / (1.0 + odds), 0.0))


def best_rectangle(chance: Floats, classified: Mask) -> tuple[int, int, int, int]:
    """The rectangle of the greatest expected overlap with a room, found by moving one side at a time.

    Args:
        chance: float64 (rows, cols), 0 where nothing is classified.
        classified: bool (rows, cols), where something is; all else costs nothing and brings nothing.

    Returns:
        Its half-open box (row0, row1, col0, col1).

    Example:
        >>> chance = np.array([[0.9, 0.8, 0.1], [0.9, 0.1, 0.1], [0.1, 0.1, 0.1]])
        >>> best_rectangle(chance, np.ones((3, 3), bool))
        (0, 2, 0, 2)
    """
    chances, counts = (
        np.pad(a, ((1, 0), (1, 0))).cumsum(0).cumsum(1) for a in (chance, classified.astype(np.float64))
    )
    best, box = -1.0, (0, 0, 0, 0)
    for start in _STARTS:
        rows, cols = np.nonzero(chance >= start)
        if len(rows):
            value, *sides = _climb(chances, counts, rows.min(), rows.max() + 1, cols.min(), cols.max() + 1)
            if value > best:
                best, box = value, (sides[0], sides[1], sides[2], sides[3])
    return box


@njit(cache=True, nogil=True)
def _climb(
    chances: Floats, counts: Floats, row0: int, row1: int, col0: int, col1: int
) -> tuple[float, int, int, int, int]:
    """Move the sides of a rectangle until none has a better place; its expected overlap and its sides.

    The sums float64 (rows + 1, cols + 1) are those of all lattice cells above and left of a corner.
    """
    total = chances[-1, -1]
    sides = np.array([row0, row1, col0, col1])
    best, better = -1.0, True
    while better:
        better = False
        # One side after the other, each to its best place: the overlap only rises, so that this ends.
        for side in range(4):
            limit = chances.shape[side // 2] - 1
            first, last = (0, sides[side + 1] - 1) if side % 2 == 0 else (sides[side - 1] + 1, limit)
            place = sides[side]
            for k in range(first, last + 1):
                sides[side] = k
                a, b, c, d = sides  # half-open: rows a..b, columns c..d
                inside = chances[b, d] - chances[a, d] - chances[b, c] + chances[a, c]
                count = counts[b, d] - counts[a, d] - counts[b, c] + counts[a, c]
                value = inside / max(count + total - inside, 1e-9)
                # By more than rounding, lest two equal places take turns for ever.
                if value > best + 1e-9:
                    best, place, better = value, k, True
            sides[side] = place
    return best, sides[0], sides[1], sides[2], sides[3]


def _windows(candidates: CandidateCells, probability: Floats) -> Iterator[Window]:
    """The lattice cells near each region, with a rim of one that is not classified."""
    places = candidates.cells // candidates.stride
    order = np.argsort(candidates.region, kind="stable")
    for part in np.split(order, np.flatnonzero(np.diff(candidates.region[order])) + 1):
        if len(part) == 0:
            continue
        at = places[part]
        first = at.min(axis=0) - 1
        chance = np.zeros(at.max(axis=0) - first + 2)
        classified = np.zeros(chance.shape, np.bool_)
        rows, cols = (at - first).T
        chance[rows, cols], classified[rows, cols] = probability[part], True
        yield Window(int(candidates.region[part[0]]), int(first[0]), int(first[1]), chance, classified)


def _interpolate(window: Window, stride: int) -> tuple[Floats32, Mask]:
    """Probability of each cell, linear between the centres of lattice cells, and whether that is known.

    Lattice cells that were not classified take the mean of their classified neighbours.
    """
    chance, classified = window.chance.astype(np.float32), window.classified.astype(np.float32)
    near = [
        cv2.boxFilter(a, -1, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT)
        for a in (chance, classified)
    ]
    filled = np.where(window.classified, chance, near[0] / np.maximum(near[1], 1.0))
    size = (stride * chance.shape[1], stride * chance.shape[0])
    smooth = np.asarray(cv2.resize(filled, size, interpolation=cv2.INTER_LINEAR), np.float32)
    return smooth, window.classified.repeat(stride, 0).repeat(stride, 1)
