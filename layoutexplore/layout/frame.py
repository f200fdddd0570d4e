"""The local frame of a grid: metres from the lower left corner of cell (0, 0), axes along columns and rows.

All geometry of the layout methods happens in this frame; the results are moved to the world by the grid's origin.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from layoutexplore.grid import OccupancyGrid, Pose


def to_world(points: NDArray[np.float64], origin: Pose) -> NDArray[np.float64]:
    """World points float64 (n, 2) of local points (n, 2).

    Example:
        >>> to_world(np.array([[1.0, 0.0]]), Pose(2.0, 3.0, np.pi / 2)).round(6).tolist()
        [[2.0, 4.0]]
    """
    if not origin.theta:
        return np.asarray(points + np.array((origin.x, origin.y)))
    c, s = np.cos(origin.theta), np.sin(origin.theta)
    return np.asarray(points @ np.array([[c, s], [-s, c]]) + np.array((origin.x, origin.y)))


def angles_to_world(angles: NDArray[np.float64], origin: Pose) -> NDArray[np.float64]:
    """Directions in radians in [0, pi) of the world frame, given directions in the local frame."""
    return np.asarray(np.mod(angles + origin.theta, np.pi))


def angles_to_local(angles: NDArray[np.float64], origin: Pose) -> NDArray[np.float64]:
    """Directions in radians in [0, pi) of the local frame, given directions in the world frame.

    Example:
        >>> angles_to_local(np.array([0.5]), Pose(0.0, 0.0, 0.2)).round(6).tolist()
        [0.3]
    """
    return np.asarray(np.mod(angles - origin.theta, np.pi))


def extent(grid: OccupancyGrid) -> tuple[float, float]:
    """Width and height of the grid in metres."""
    return grid.shape[1] * grid.resolution, grid.shape[0] * grid.resolution
