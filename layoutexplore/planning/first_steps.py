"""The beginning of a path, for a robot that stops on its way to look around."""

from __future__ import annotations

import numpy as np

from layoutexplore.grids.arrays import Ints32

LAST_STEPS = 0.3
"""Metres: no stop is made so near to the end of a path, where the robot looks around in any case."""


def first_steps(path: Ints32, resolution: float, step: float) -> Ints32 | None:
    """The beginning of a path, as long as a step; None when hardly more than a step is left of it.

    Args:
        path: int32 (k, 2), neighbouring cells.
        resolution: Metres per cell.
        step: Metres.

    Example:
        >>> path = np.array([[0, 0], [1, 1], [1, 2], [1, 3], [1, 4]], np.int32)
        >>> first_steps(path, 0.5, 1.2).tolist()
        [[0, 0], [1, 1], [1, 2]]
        >>> first_steps(path[:4], 0.5, 1.5) is None
        True
    """
    walked = np.cumsum(np.hypot(*np.diff(path, axis=0).T)) * resolution
    if len(walked) == 0 or walked[-1] <= step + LAST_STEPS:
        return None
    return path[: int(np.searchsorted(walked, step - 1e-6)) + 2]
