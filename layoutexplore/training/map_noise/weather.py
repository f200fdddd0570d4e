"""What befalls recorded maps and no simulated one: missing pieces of wall, blind spots, things, bends.

A network that always meets whole walls takes every opening for one within a room.
"""

from __future__ import annotations

import cv2
import numpy as np

from layoutexplore.grids.arrays import Cells, Ints32, Mask
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, in_cells
from layoutexplore.training.simulated_maps import furnish_cells

MISSING, BLIND = 12.0, 3.0
"""Missing pieces of wall and blind spots on a hundred square metres of free space, at most."""

LONG, SHORT = (0.2, 2.5), (0.2, 0.7)
"""Lengths and widths of both [m]."""

THINGS = 0.3
"""Pieces of furniture a square metre, at most."""

BEND, WAVE = 0.12, 2.5
"""Walls are moved aside by so much (standard deviation, at most) in waves of so many metres [m]."""


def weather(cells: Cells, rooms: Ints32, resolution: float, rng: np.random.Generator) -> tuple[Cells, Ints32]:
    """A map and its rooms after what befalls recorded ones, each of it more or less or not at all.

    Args:
        cells: int8 (rows, cols), trinary.
        rooms: int32 (rows, cols), the true room of each cell, 0 for none.
        resolution: Metres a cell.
        rng: Source of randomness.
    """
    out, truth = cells.copy(), rooms
    area = np.count_nonzero(cells == FREE) * resolution**2 / 100
    if rng.random() < 0.7:
        left = FREE if rng.random() < 0.7 else UNKNOWN
        count = rng.poisson(MISSING * area * rng.random())
        out[_pieces(out == OCCUPIED, count, resolution, rng) & (out == OCCUPIED)] = left
    if rng.random() < 0.5:
        count = rng.poisson(BLIND * area * rng.random())
        out[_pieces(out == OCCUPIED, count, resolution, rng) & (out == FREE)] = UNKNOWN
    if rng.random() < 0.5:
        known = np.where(out == FREE, rooms, 0).astype(np.int32)
        things = furnish_cells(np.zeros(out.shape, np.bool_), known, THINGS * rng.random(), resolution, rng)
        out[things & (out == FREE)] = OCCUPIED
    if rng.random() < 0.5:
        out, truth = _bent(out, truth, resolution, rng)
    return out, truth


def _pieces(around: Mask, count: int, resolution: float, rng: np.random.Generator) -> Mask:
    """Boxes along the rows or columns with their middles on some cells: bool (rows, cols)."""
    out, places = np.zeros(around.shape, np.bool_), np.argwhere(around)
    if not len(places):
        return out
    for row, col in places[rng.integers(len(places), size=count)]:
        high, wide = (in_cells(float(rng.uniform(*side)) / 2, resolution) for side in (LONG, SHORT))
        high, wide = (high, wide) if rng.random() < 0.5 else (wide, high)
        out[max(row - high, 0) : row + high + 1, max(col - wide, 0) : col + wide + 1] = True
    return out


def _bent(cells: Cells, rooms: Ints32, resolution: float, rng: np.random.Generator) -> tuple[Cells, Ints32]:
    """Cells and rooms looked up at places that are moved aside in waves."""
    size = BEND / resolution * rng.random()
    waves = tuple(max(round(n * resolution / WAVE), 2) for n in cells.shape)
    drawn = [rng.normal(0, size, waves).astype(np.float32) for _ in range(2)]
    aside = [cv2.resize(one, cells.shape[::-1], interpolation=cv2.INTER_CUBIC) for one in drawn]
    row, col = np.mgrid[: cells.shape[0], : cells.shape[1]].astype(np.float32)
    at = [
        np.clip(np.rint(base + move).astype(np.int64), 0, most - 1)
        for base, move, most in zip((row, col), aside, cells.shape, strict=True)
    ]
    return cells[at[0], at[1]], rooms[at[0], at[1]]
