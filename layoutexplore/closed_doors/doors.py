"""Closed doors in a grid: straight stretches of wall that are set back between two jambs, with nothing known behind.

A shut leaf is seen from one side only. It is a straight, unbroken line of occupied cells, free in front, unknown behind,
and at both ends the wall's face steps forward by a part of the wall's thickness.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from layoutexplore.grid import FREE, OCCUPIED, UNKNOWN

_BREAK = 5  # a leaf may be broken by stray cells, fewer than this


@dataclass(frozen=True, kw_only=True)
class DoorConfig:
    """What a closed door looks like, in metres.

    Attributes:
        width_min: Narrowest leaf.
        width_max: Widest leaf.
        recess_min: Least depth of the niche it stands in, at both ends.
        recess_max: Deepest niche; beyond it the ends are corners of a room.
        behind: Least depth of unknown space behind it.
    """

    width_min: float = 0.7
    width_max: float = 2.8
    recess_min: float = 0.1
    recess_max: float = 1.0
    behind: float = 0.6


@dataclass(frozen=True)
class Door:
    """A closed door in a grid turned so that the unknown space lies towards lower rows.

    Attributes:
        row: Row of the leaf.
        start: First column of the leaf.
        stop: Column behind its last one.
        recess: Rows by which the wall's face stands before the leaf, the smaller of both ends.
        recess_other: The larger of both.
    """

    row: int
    start: int
    stop: int
    recess: int
    recess_other: int


def find_doors(cells: NDArray[np.int8], resolution: float, config: DoorConfig | None = None) -> list[Door]:
    """The closed doors of one direction: free space at higher rows, unknown at lower ones.

    Args:
        cells: int8 (rows, cols), as in `OccupancyGrid`.
        resolution: Metres a cell.
        config: What a door looks like.
    """
    config = config or DoorConfig()
    reach = max(round(config.recess_max / resolution), 2)
    padded = np.pad(cells, reach + 4, constant_values=UNKNOWN)
    occupied, free, unknown = padded == OCCUPIED, padded == FREE, padded == UNKNOWN
    leaf = occupied.copy()
    leaf[:-2] &= free[1:-1] | free[2:]
    leaf[1:] &= unknown[:-1]
    leaf = cv2.morphologyEx(leaf.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((1, _BREAK), np.uint8)) > 0
    found = []
    shift = reach + 4
    least = config.recess_min / resolution - 0.5
    for row in (np.flatnonzero(leaf[shift:-shift].any(axis=1)) + shift).tolist():
        edges = np.flatnonzero(np.diff(np.concatenate([[False], leaf[row], [False]]))).tolist()
        for start, stop in zip(edges[::2], edges[1::2], strict=True):
            if not config.width_min <= (stop - start) * resolution <= config.width_max:
                continue
            left = _step(occupied, free, row, range(start - 3, start + 2), reach)
            right = _step(occupied, free, row, range(stop - 1, stop + 4), reach)
            if min(left, right) < least or not _hides(unknown, row, start, stop, round(config.behind / resolution)):
                continue
            found.append(Door(row - shift, start - shift, stop - shift, min(left, right), max(left, right)))
    return found


def _step(occupied: NDArray[np.bool_], free: NDArray[np.bool_], row: int, columns: range, reach: int) -> int:
    """Rows by which the wall's face stands before the leaf at one of its ends; 0 for none within reach."""
    best = 0
    for column in columns:
        rows = np.flatnonzero(occupied[row + 1 : row + reach + 1, column])
        if len(rows) and free[row + rows[-1] + 2 : row + rows[-1] + 4, column].any():
            best = max(best, int(rows[-1]) + 1)
    return best


def _hides(unknown: NDArray[np.bool_], row: int, start: int, stop: int, depth: int) -> bool:
    """Whether nothing is known behind the leaf down to a depth."""
    columns = [start + 3, (start + stop) // 2, stop - 4]
    return bool(unknown[max(row - depth, 0) : row, columns].all())
