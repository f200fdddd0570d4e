"""From cells to polygons: the exact outline of a mask, by walking along the sides of its cells.

Every side between a cell of the mask and one outside is walked once, the mask on the left. Where two cells
touch at a corner only, the walk stays with its cell, so that polygons are four-connected; a walk that comes
through such a corner twice is cut into two rings, because a ring must not touch itself. Rings that run
counter-clockwise are shells.
"""

from __future__ import annotations

import cv2
import numpy as np
import shapely
from numba import njit
from numpy.typing import NDArray
from shapely import MultiPolygon, Polygon

from layoutexplore.grids.polygons import Point


def trace(mask: NDArray[np.bool_], resolution: float, origin: Point) -> Polygon | MultiPolygon:
    """The outline of a mask's cells as polygons in metres (to the micrometre), one a four-connected part.

    Args:
        mask: bool (rows, cols).
        resolution: Side of a cell in metres.
        origin: World point of the lower left corner of cell (0, 0).

    Example:
        >>> trace(np.array([[True, True], [True, False]]), 0.5, (0.0, 0.0)).area
        0.75
    """
    padded = np.ascontiguousarray(np.pad(mask, 1), np.bool_)
    count, parts = cv2.connectedComponents(padded.astype(np.uint8), connectivity=4, ltype=cv2.CV_32S)
    points, starts, owners = _walk(padded, parts.astype(np.int32))
    world = np.round(np.asarray(origin) + (points - 1.0) * resolution, 6)
    shells: list[list[NDArray[np.float64]]] = [[] for _ in range(count)]
    holes: list[list[NDArray[np.float64]]] = [[] for _ in range(count)]
    for first, last, owner in zip(starts[:-1], starts[1:], owners, strict=True):
        ring = world[first:last]
        following = np.roll(ring, -1, axis=0)
        turned = float((ring[:, 0] * following[:, 1] - following[:, 0] * ring[:, 1]).sum())
        (shells if turned > 0 else holes)[owner].append(ring)
    polygons = [Polygon(shells[part][0], holes[part]) for part in range(1, count)]
    return polygons[0] if len(polygons) == 1 else shapely.multipolygons(polygons) if polygons else Polygon()


@njit(cache=True, nogil=True)
def _is_side(mask: NDArray[np.bool_], r: int, c: int, way: int) -> bool:
    """Whether a side with the mask on its left leaves the corner (r, c) to the right, up, left or down (way 0 to 3)."""
    if way == 0:
        return bool(mask[r, c] and not mask[r - 1, c])
    if way == 1:
        return bool(mask[r, c - 1] and not mask[r, c])
    if way == 2:
        return bool(mask[r - 1, c - 1] and not mask[r, c - 1])
    return bool(mask[r - 1, c] and not mask[r - 1, c - 1])


@njit(cache=True, nogil=True)
def _walk(
    mask: NDArray[np.bool_], parts: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int32]]:
    """All rings of a mask with an empty border.

    Returns:
        Corners float64 (n, 2) as (col, row) of the rings one after the other, where each begins int64 (rings
        + 1,), and the part int32 (rings,) that each belongs to.
    """
    rows, cols = mask.shape
    sides = 0
    for r in range(1, rows):
        for c in range(1, cols):
            sides += int(mask[r, c] != mask[r - 1, c]) + int(mask[r, c] != mask[r, c - 1])
    points, starts, owners = (
        np.empty((sides, 2), np.float64),
        np.zeros(sides + 1, np.int64),
        np.empty(sides, np.int32),
    )
    walked = np.zeros((rows, cols), np.bool_)  # the sides to the right; every ring begins with one
    place = np.full((rows, cols), -1, np.int32)  # of a corner on the path
    path = np.empty((sides + 1, 2), np.int32)
    rings = 0
    for row in range(1, rows):
        for col in range(1, cols):
            if walked[row, col] or not _is_side(mask, row, col, 0) or _is_side(mask, row, col - 1, 0):
                continue
            r, c, way, length = row, col, 0, 0
            while True:
                if place[r, c] >= 0:  # a corner met before: what lies between is a ring of its own
                    first = place[r, c]
                    rings = _keep(path, first, length, place, points, starts, rings)
                    owners[rings - 1] = parts[row, col]
                    length = first
                if way == 0 and walked[r, c]:
                    break
                place[r, c] = length
                path[length, 0], path[length, 1] = r, c
                length += 1
                turn = way
                while turn == way:  # to the next corner
                    if way == 0:
                        walked[r, c] = True
                    r, c = r + (way == 1) - (way == 3), c + (way == 0) - (way == 2)
                    for change in (1, 0, 3):
                        if _is_side(mask, r, c, (way + change) % 4):
                            turn = (way + change) % 4
                            break
                way = turn
    return points[: starts[rings]].copy(), starts[: rings + 1].copy(), owners[:rings].copy()


@njit(cache=True, nogil=True)
def _keep(
    path: NDArray[np.int32],
    first: int,
    length: int,
    place: NDArray[np.int32],
    points: NDArray[np.float64],
    starts: NDArray[np.int64],
    rings: int,
) -> int:
    """Move the end of a path to the finished rings; returns their number."""
    end = starts[rings]
    for k in range(first, length):
        points[end, 0], points[end, 1] = path[k, 1], path[k, 0]
        place[path[k, 0], path[k, 1]] = -1
        end += 1
    starts[rings + 1] = end
    return rings + 1
