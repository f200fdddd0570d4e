"""A corridor with a row of rooms, some of them shut, and its pictures."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN

WALL, WIDTH, DEPTH = 6, 80, 90  # cells


def office(shut: tuple[int, ...], rooms: int = 6) -> tuple[NDArray[np.int8], NDArray[np.int8]]:
    """What is seen and the truth, int8 (rows, cols) from the top: a corridor with a row of rooms above it, some of them shut."""
    cols = 20 + rooms * (WIDTH + WALL)
    free = np.zeros((DEPTH + WALL + 90, cols), bool)
    corridor = slice(10 + DEPTH + WALL, 10 + DEPTH + WALL + 50)
    free[corridor, 10 : cols - 10 - WALL] = True
    seen = free.copy()
    for k in range(rooms):
        left = 10 + k * (WIDTH + WALL)
        room = np.s_[10 : 10 + DEPTH, left : left + WIDTH]
        door = np.s_[10 + DEPTH : 10 + DEPTH + WALL, left + 25 : left + 45]
        free[room] = free[door] = True
        if k in shut:
            seen[13 + DEPTH : 10 + DEPTH + WALL, left + 25 : left + 45] = True
        else:
            seen[room] = seen[door] = True
    return _with_walls(seen), _with_walls(free)


def _with_walls(free: NDArray[np.bool_]) -> NDArray[np.int8]:
    rim = cv2.dilate(free.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return np.where(free, FREE, np.where(rim, OCCUPIED, UNKNOWN)).astype(np.int8)


def draw(cells: NDArray[np.int8], path: Path) -> None:
    cv2.imwrite(str(path), np.where(cells == FREE, 254, np.where(cells == OCCUPIED, 0, 205)).astype(np.uint8))
