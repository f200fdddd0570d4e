"""The mirror image of a plan, registered to it wall on wall: what may lie in parts never seen."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from layoutexplore.grids.arrays import Cells, Floats, Floats32, Mask
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, in_cells

_COARSE = 0.2
"""Metres a side of the coarse cells that the search looks at first."""

_OVERLAP = 0.45
"""Least share of what is known that must fall on known cells."""


@dataclass(frozen=True, eq=False)
class Mirror:
    """A mirrored plan.

    Attributes:
        cells: int8 (rows, cols), the plan mirrored onto itself, unknown where nothing falls.
        score: Walls that fall on walls, over these and those that fall on free space, 0..1.
        overlap: Share of the known cells that fall on known cells, 0..1.
    """

    cells: Cells
    score: float
    overlap: float


def best_mirror(cells: Cells, resolution: float) -> Mirror:
    """The better of the mirror images along rows and along columns.

    Args:
        cells: int8 (rows, cols), as in `OccupancyGrid`, with walls along rows and columns.
        resolution: Metres a cell.
    """
    side = in_cells(_COARSE, resolution)
    walls = _shrink(cells == OCCUPIED, side, 0.05)
    floor = _shrink(cells == FREE, side, 0.5)
    quality, overlap, axis, place = max(_place(walls, floor, axis) for axis in (0, 1))
    # Index k: cell i of the map falls on cell k - i of the mirrored one.
    shifts = range((place - 1) * side, (place + 2) * side)
    fine = max(shifts, key=lambda shift: _hits(cells, axis, shift))
    size = cells.shape[axis]
    source = fine - np.arange(size)
    inside = (source >= 0) & (source < size)
    out = np.full_like(cells, UNKNOWN)
    np.moveaxis(out, axis, 0)[inside] = np.moveaxis(cells, axis, 0)[source[inside]]
    return Mirror(out, quality, overlap)


def _place(walls: Floats32, floor: Floats32, axis: int) -> tuple[float, float, int, int]:
    """The best fit of the mirror image across an axis, its overlap, the axis, and the place."""
    known = np.maximum(walls, floor)
    hits = _correlate(np.asarray(cv2.blur(walls, (3, 3)), np.float32), axis)
    misses = _correlate(walls, axis, floor) * 2
    overlap = _correlate(known, axis) / max(float(known.sum()), 1.0)
    quality = np.where(overlap >= _OVERLAP, hits / (hits + misses + 0.02 * walls.sum() + 1e-9), 0.0)
    best = int((quality * overlap).argmax())
    return float(quality[best]), float(overlap[best]), axis, best


def _shrink(mask: Mask, side: int, least: float) -> Floats32:
    """Coarse cells of so many cells a side whose share of true cells is higher than the least."""
    size = (-(-mask.shape[1] // side), -(-mask.shape[0] // side))
    padded = np.zeros((size[1] * side, size[0] * side), np.float32)
    padded[: mask.shape[0], : mask.shape[1]] = mask
    return np.asarray(cv2.resize(padded, size, interpolation=cv2.INTER_AREA) > least, np.float32)


def _correlate(mask: Floats32, axis: int, other: Floats32 | None = None) -> Floats:
    """Sum over cells i of mask[i] * other[k - i] for every k, summed over the other axis too."""
    other = mask if other is None else other
    count = 2 * mask.shape[axis]
    product = np.fft.rfft(mask, count, axis) * np.fft.rfft(other, count, axis)
    return np.asarray(np.fft.irfft(product.sum(1 - axis), count))


def _hits(cells: Cells, axis: int, shift: int) -> int:
    size = cells.shape[axis]
    index = np.arange(max(shift - size + 1, 0), min(shift + 1, size))
    if not len(index):
        return 0
    walls = cells == OCCUPIED
    here, there = np.take(walls, index, axis), np.take(walls, shift - index, axis)
    return int((here & there).sum())
