"""A corridor with a row of rooms, some of them shut, and its pictures."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN

WALL, WIDTH, DEPTH = 6, 80, 90  # cells


def office(
    shut: tuple[int, ...], rooms: int = 6, resolution: float = 0.05
) -> tuple[NDArray[np.int8], NDArray[np.int8]]:
    """What is seen and the truth, int8 (rows, cols) from the top: rooms above a corridor, some shut."""

    def n(cells: int) -> int:
        """Cells of 0.05 m in cells of the grid."""
        return round(cells * 0.05 / resolution)

    free = np.zeros((n(DEPTH + WALL + 90), n(20 + rooms * (WIDTH + WALL))), bool)
    corridor = slice(n(10 + DEPTH + WALL), n(10 + DEPTH + WALL + 50))
    free[corridor, n(10) : free.shape[1] - n(10 + WALL)] = True
    seen = free.copy()
    for k in range(rooms):
        left = 10 + k * (WIDTH + WALL)
        room = np.s_[n(10) : n(10 + DEPTH), n(left) : n(left + WIDTH)]
        door = np.s_[n(10 + DEPTH) : n(10 + DEPTH + WALL), n(left + 25) : n(left + 45)]
        free[room] = free[door] = True
        if k in shut:
            seen[n(13 + DEPTH) : n(10 + DEPTH + WALL), n(left + 25) : n(left + 45)] = True
        else:
            seen[room] = seen[door] = True
    return with_walls(seen), with_walls(free)


def with_walls(free: NDArray[np.bool_]) -> NDArray[np.int8]:
    rim = cv2.dilate(free.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return np.where(free, FREE, np.where(rim, OCCUPIED, UNKNOWN)).astype(np.int8)


def draw(cells: NDArray[np.int8], path: Path) -> None:
    cv2.imwrite(str(path), np.where(cells == FREE, 254, np.where(cells == OCCUPIED, 0, 205)).astype(np.uint8))
