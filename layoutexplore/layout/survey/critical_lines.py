"""Critical lines: from each critical point to the walls on both of its sides (Bormann et al. 2016).

The cells that are searched for lie in buckets, squares of the grid: a search looks at the buckets around a
cell, ring by ring, until no nearer cell can follow.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import ZERO, Bytes, Floats, Ints, Ints32, Mask

BUCKET = 16
"""Side of a bucket: how fast a search is, not what it finds."""


@njit(cache=True, nogil=True)
def _fill_buckets(cells: Ints32, rows: int, cols: int) -> tuple[Ints, Ints]:
    """First entry of each bucket, row by row and one more, and the cells' indices bucket by bucket."""
    high, wide = rows // BUCKET + 1, cols // BUCKET + 1
    first = np.zeros(high * wide + 1, np.int64)
    for i in range(len(cells)):
        first[cells[i, 0] // BUCKET * wide + cells[i, 1] // BUCKET + 1] += 1
    first = np.cumsum(first)
    place = first.copy()
    order = np.empty(len(cells), np.int64)
    for i in range(len(cells)):
        bucket = cells[i, 0] // BUCKET * wide + cells[i, 1] // BUCKET
        order[place[bucket]] = i
        place[bucket] += 1
    return first, order


@njit(cache=True, nogil=True)
def _nearest(
    cells: Ints32, first: Ints, order: Ints, size: tuple[int, int], r: int, c: int, away: int, apart: int
) -> int:
    """The cell nearest to (r, c) that is farther than `apart` from cell `away`, -1 if there is none.

    Ties go in raster order; with `away` -1 every cell will do.
    """
    high, wide = size[0] // BUCKET + 1, size[1] // BUCKET + 1
    row, col = r // BUCKET, c // BUCKET
    best, least = -1, np.int64(1) << 60
    for ring in range(max(high, wide)):
        # cells of this ring of buckets and of all further ones are farther than `reach`; one as far may tie
        reach = max((ring - 1) * BUCKET, 0)
        if best >= 0 and reach * reach > least:
            break
        for i in range(max(row - ring, 0), min(row + ring + 1, high)):
            # whole rows of buckets below and above, only both ends of the rows between
            step = 1 if abs(i - row) == ring or ring == 0 else 2 * ring
            for j in range(col - ring, col + ring + 1, step):
                if j < 0 or j >= wide:
                    continue
                for k in range(first[i * wide + j], first[i * wide + j + 1]):
                    one = order[k]
                    y, x = np.int64(cells[one, 0]), np.int64(cells[one, 1])
                    far = (y - r) ** 2 + (x - c) ** 2
                    if far > least or (
                        away >= 0 and (y - cells[away, 0]) ** 2 + (x - cells[away, 1]) ** 2 <= apart * apart
                    ):
                        continue
                    if far < least or (y, x) < (cells[best, 0], cells[best, 1]):
                        best, least = one, far
    return best


@njit(cache=True, nogil=True)
def _basis_points(points: Ints32, walls: Ints32, distance: Bytes) -> Ints:
    """Indices (n, 2) of each point's two basis points, -1 for none; the second depends on the first."""
    size = distance.shape
    first, order = _fill_buckets(walls, size[0], size[1])
    out = np.full((len(points), 2), -1, np.int64)
    for i in range(len(points)):
        r, c = points[i]
        out[i, 0] = _nearest(walls, first, order, size, r, c, ZERO - 1, ZERO)
        if out[i, 0] >= 0:
            out[i, 1] = _nearest(walls, first, order, size, r, c, out[i, 0], int(np.int64(distance[r, c])))
    return out


@njit(cache=True, nogil=True)
def _beaten(points: Ints32, angle: Floats, length: Floats, radius: Floats, rows: int, cols: int) -> Mask:
    """Points with a rival within their radius whose angle is wider, or as wide and whose line is shorter.

    All are compared, the beaten ones too: the order of the points does not matter.
    """
    wide = cols // BUCKET + 1
    first, order = _fill_buckets(points, rows, cols)
    out = np.zeros(len(points), np.bool_)
    for i in range(len(points)):
        r, c = points[i, 0], points[i, 1]
        reach = int(radius[i])
        for row in range(max(r - reach, 0) // BUCKET, min(r + reach, rows - 1) // BUCKET + 1):
            for col in range(max(c - reach, 0) // BUCKET, min(c + reach, cols - 1) // BUCKET + 1):
                for k in range(first[row * wide + col], first[row * wide + col + 1]):
                    j = order[k]
                    apart = (points[j, 0] - r) ** 2 + (points[j, 1] - c) ** 2
                    if j == i or apart > radius[i] ** 2:
                        continue
                    # a rival's line of three cells or less is as short as any: the first point stays
                    longer = length[i] > length[j] and (length[j] > 3 or j < i)
                    if angle[i] < angle[j] or (angle[i] == angle[j] and longer):
                        out[i] = True
    return out


def critical_lines(points: Ints32, walls: Ints32, distance: Bytes, spacing: float) -> Ints32:
    """The lines that cut the free space: int32 (n, 3, 2), a critical point and its two basis points.

    The first basis point is the nearest cell of the walls, the second the nearest that is farther from the
    first than the point from the walls. Of points closer than `spacing` times their distance to the walls
    only the best stays: that with the widest angle between its two lines, then that with the shortest lines.

    Args:
        points: int32 (n, 2), the critical points as (row, col).
        walls: int32 (m, 2), cells beside the walls.
        distance: uint8 (rows, cols), to the walls in cells.
        spacing: As a share of the distance.
    """
    if not len(points) or not len(walls):
        return np.zeros((0, 3, 2), np.int32)
    points, walls = np.ascontiguousarray(points, np.int32), np.ascontiguousarray(walls, np.int32)
    basis = _basis_points(points, walls, np.ascontiguousarray(distance))
    found = (basis >= 0).all(axis=1)
    points, basis = np.ascontiguousarray(points[found]), basis[found]
    a, b = ((walls[basis[:, i]] - points).astype(np.float64) for i in (0, 1))
    lengths = np.hypot(*a.T), np.hypot(*b.T)
    cosine = (a * b).sum(axis=1) / np.maximum(lengths[0] * lengths[1], 1e-9)
    angle = np.arccos(np.clip(cosine, -1, 1)).round(9)
    radius = spacing * distance[points[:, 0], points[:, 1]].astype(np.float64)
    lost = _beaten(points, angle, lengths[0] + lengths[1], radius, *distance.shape)
    return np.stack((points, walls[basis[:, 0]], walls[basis[:, 1]]), axis=1)[~lost]
