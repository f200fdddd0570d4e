"""The cells that a ray crosses (Amanatides and Woo, "A fast voxel traversal algorithm", 1987)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Cells
from layoutexplore.grids.grid import FREE

_STEEPEST = 1.0 - 1e-9

_FAR = 1e300
"""More than any length, and yet a number: 0 times the infinite inverse of a tiny motion would be none."""


@njit(cache=True, nogil=True)
def ray_frame(x: float, y: float, dx: float, dy: float) -> tuple[float, float, float, float, float, bool]:
    """A ray in the frame of the axis that it moves more along, both axes turned so that it moves forward.

    With k counting the cell borders met along and n those met across, the ray meets border k at distance
    `(k - along) * per_along`, where it is in the cell `int(across + slope * (k - along))` across from where
    it started, and border n across at distance `(n - across) * per_across`.

    Returns:
        along, across: Position in the start's cell, 0..1, seen in the direction of motion.
        slope: Cells across per cell along, at most 1.
        per_along, per_across: Distance per cell along and across.
        x_leads: Whether x is the axis along.
    """
    from_x = x - math.floor(x) if dx >= 0.0 else math.floor(x) + 1.0 - x
    from_y = y - math.floor(y) if dy >= 0.0 else math.floor(y) + 1.0 - y
    size_x, size_y = abs(dx), abs(dy)
    # A hair below 1, so that rounding never makes a ray cross two borders in one column.
    if size_x >= size_y:
        return (
            from_x,
            from_y,
            min(size_y / size_x, _STEEPEST),
            1.0 / size_x,
            min(1.0 / size_y, _FAR) if size_y > 0.0 else np.inf,
            True,
        )
    return (
        from_y,
        from_x,
        min(size_x / size_y, _STEEPEST),
        1.0 / size_y,
        min(1.0 / size_x, _FAR) if size_x > 0.0 else np.inf,
        False,
    )


@njit(cache=True, nogil=True)
def steps(dx: float, dy: float, x_leads: bool, cols: int) -> tuple[np.uint64, np.uint64]:
    """Change of a cell's index in a ravelled grid of `cols` columns per move along and across."""
    step_x, step_y = (1 if dx >= 0.0 else -1), (cols if dy >= 0.0 else -cols)
    return np.uint64(step_x if x_leads else step_y), np.uint64(step_y if x_leads else step_x)


@njit(cache=True, nogil=True)
def is_free_line(cells: Cells, row: int, col: int, to_row: int, to_col: int) -> bool:
    """Whether the line from one cell's centre to another's runs through free cells only, the first one aside.

    At a corner it steps to the next column first, so that the way back may run through other cells.
    """
    d_row, d_col = to_row - row, to_col - col
    step_row, step_col = (1 if d_row > 0 else -1), (1 if d_col > 0 else -1)
    n_row, n_col = abs(d_row), abs(d_col)
    i, j = 0, 0
    while i < n_row or j < n_col:
        # The next border crossed: compare (i + 1/2) / n_row with (j + 1/2) / n_col without a division. From
        # centre to centre this is exact, which `ray_frame`, in floating point, would not be at corners.
        if j >= n_col or (i < n_row and (1 + 2 * i) * n_col < (1 + 2 * j) * n_row):
            row += step_row
            i += 1
        else:
            col += step_col
            j += 1
        if cells[row, col] != FREE:
            return False
    return True
