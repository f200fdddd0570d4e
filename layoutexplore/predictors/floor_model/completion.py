"""A map completed by the network: the squares that it sees of any grid, and what it foresees of the cells."""

from __future__ import annotations

import math

import numpy as np

from layoutexplore.grids.arrays import Bytes, Cells, Ints
from layoutexplore.grids.boxes import known_box
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, in_cells
from layoutexplore.predictors.floor_model.network import KINDS, WHOLE, FloorNetwork

SQUARE = 0.1
"""Metres: side of what the network sees as one."""

FLOOR, WALL = 0.5, 0.05
"""Probability of floor from which on a cell is foreseen free, and below which it is foreseen occupied."""

BEYOND = 2.0
"""Metres of unknown space that the network is shown around what it is asked: a border looks like no wall."""

MOST_AHEAD = 6.0
"""Metres from known floor up to which the network has learnt to look."""


def completed_map(network: FloorNetwork, cells: Cells, resolution: float, ahead: float) -> Cells:
    """What the network foresees of a map.

    Args:
        network: The network.
        cells: int8 (rows, cols), what is known: 0 free, 100 occupied, -1 unknown.
        resolution: Metres a cell.
        ahead: Metres beyond what is known that are asked for.

    Returns:
        int8 (rows, cols): 0 foreseen free, 100 foreseen occupied, -1 where it can not be told or is too far
        away. Known cells are judged, too.
    """
    out = np.full(cells.shape, UNKNOWN, np.int8)
    row0, row1, col0, col1 = known_box(cells, in_cells(ahead + BEYOND, resolution))
    if row1 == 0:
        return out
    part = cells[row0:row1, col0:col1]
    odds = network.score(known_squares(part, resolution))
    rows, cols = (_squares_of_cells(size, resolution) for size in part.shape)
    found = odds[np.ix_(rows, cols)]
    window = out[row0:row1, col0:col1]
    window[found > _log_odds(FLOOR)] = FREE
    window[found < _log_odds(WALL)] = OCCUPIED
    return out


def known_squares(cells: Cells, resolution: float) -> Bytes:
    """What the network sees of a map: uint8 (KINDS, rows, cols), padded to multiples of `WHOLE` squares.

    Of finer cells a square is occupied where one of them is, and else free where one of them is.

    Args:
        cells: int8 (rows, cols), what is known.
        resolution: Metres a cell.
    """
    kinds = np.where(cells == OCCUPIED, np.uint8(2), np.equal(cells, FREE).view(np.uint8))
    for axis, size in enumerate(cells.shape):
        if resolution < SQUARE:
            squares = _squares_of_cells(size, resolution)
            first = np.flatnonzero(np.diff(squares, prepend=-1))
            kinds = np.maximum.reduceat(kinds, first, axis=axis)
        else:
            count = math.ceil(size * resolution / SQUARE - 1e-6)
            looked_up = ((np.arange(count) + 0.5) * SQUARE / resolution).astype(np.int64)
            kinds = kinds.take(np.minimum(looked_up, size - 1), axis=axis)
    known = np.zeros((KINDS, *(-(-size // WHOLE) * WHOLE for size in kinds.shape)), np.uint8)
    for k in range(KINDS):
        known[k, : kinds.shape[0], : kinds.shape[1]] = kinds == k + 1
    return known


def _squares_of_cells(size: int, resolution: float) -> Ints:
    """int64 (size,): the square that the middle of each of so many cells lies in."""
    return np.asarray((np.arange(size) + 0.5) * (resolution / SQUARE), np.int64)


def _log_odds(probability: float) -> float:
    return math.log(probability / (1.0 - probability))
