"""The local frame of a grid: metres from the lower left corner of cell (0, 0), axes along columns and rows.

All geometry of the layout methods happens in this frame; the results are moved to the world by the grid's
origin.
"""

from __future__ import annotations

import math

import numpy as np

from layoutexplore.grids.arrays import Floats, Ints
from layoutexplore.grids.grid import OccupancyGrid, Pose


def to_world(points: Floats, origin: Pose) -> Floats:
    """World points float64 (n, 2) of local points (n, 2).

    Example:
        >>> to_world(np.array([[1.0, 0.0]]), Pose(2.0, 3.0, np.pi / 2)).round(6).tolist()
        [[2.0, 4.0]]
    """
    if not origin.theta:
        return np.asarray(points + np.array((origin.x, origin.y)))
    c, s = np.cos(origin.theta), np.sin(origin.theta)
    return np.asarray(points @ np.array([[c, s], [-s, c]]) + np.array((origin.x, origin.y)))


def to_local(points: Floats, origin: Pose) -> Floats:
    """Local points float64 (n, 2) of world points (n, 2).

    Example:
        >>> to_local(np.array([[2.0, 4.0]]), Pose(2.0, 3.0, np.pi / 2)).round(6).tolist()
        [[1.0, 0.0]]
    """
    c, s = math.cos(origin.theta), math.sin(origin.theta)
    return np.asarray((points - np.array((origin.x, origin.y))) @ np.array([[c, -s], [s, c]]))


def undirected(angles: Floats) -> Floats:
    """Angles of undirected lines, brought into [0, pi) radians.

    Example:
        >>> undirected(np.array([-1e-17, np.pi])).tolist()
        [0.0, 0.0]
    """
    turned = np.mod(angles, np.pi)
    return np.where(turned < np.pi, turned, 0.0)  # what is hardly below 0 is rounded up to pi


def ranks(values: Floats) -> Ints:
    """The place int64 (n,) of each value (n,) among all of them, rising; equal ones as they come.

    Example:
        >>> ranks(np.array([0.3, 0.1, 0.2])).tolist()
        [2, 0, 1]
    """
    out = np.empty(len(values), np.int64)
    out[np.argsort(values, kind="stable")] = np.arange(len(values))
    return out


def angles_to_world(angles: Floats, origin: Pose) -> Floats:
    """Directions in radians in [0, pi) of the world frame, given directions in the local frame."""
    return undirected(angles + origin.theta)


def angles_to_local(angles: Floats, origin: Pose) -> Floats:
    """Directions in radians in [0, pi) of the local frame, given directions in the world frame.

    Example:
        >>> angles_to_local(np.array([0.5]), Pose(0.0, 0.0, 0.2)).round(6).tolist()
        [0.3]
    """
    return undirected(angles - origin.theta)


def extent(grid: OccupancyGrid) -> tuple[float, float]:
    """Width and height of the grid in metres."""
    return grid.shape[1] * grid.resolution, grid.shape[0] * grid.resolution
