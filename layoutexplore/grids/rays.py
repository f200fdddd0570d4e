"""The cells that a ray crosses (Amanatides and Woo, "A fast voxel traversal algorithm", 1987)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

_STEEPEST = 1.0 - 1e-9


@njit(cache=True, nogil=True)
def trace(x: float, y: float, dx: float, dy: float) -> tuple[float, float, float, float, float, bool]:
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
            1.0 / size_y if size_y > 0.0 else np.inf,
            True,
        )
    return (
        from_y,
        from_x,
        min(size_x / size_y, _STEEPEST),
        1.0 / size_y,
        1.0 / size_x if size_x > 0.0 else np.inf,
        False,
    )


@njit(cache=True, nogil=True)
def steps(dx: float, dy: float, x_leads: bool, cols: int) -> tuple[np.uint64, np.uint64]:
    """Change of a cell's index in a ravelled grid of `cols` columns where the ray of `trace` moves on along and across."""
    step_x, step_y = (1 if dx >= 0.0 else -1), (cols if dy >= 0.0 else -cols)
    return np.uint64(step_x if x_leads else step_y), np.uint64(step_y if x_leads else step_x)
