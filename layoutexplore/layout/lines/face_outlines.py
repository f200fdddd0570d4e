"""Unions of faces: polygons from the half-edges, and cells from the polygons.

A *grouping* gives each bounded face of an arrangement a group number, or -1 for none.
"""

from __future__ import annotations

import numpy as np
import shapely
from numba import njit

from layoutexplore.grids.arrays import Floats, Ints, Ints32, Mask
from layoutexplore.grids.polygons import valid_polygons
from layoutexplore.layout.lines.faces import Arrangement


def paint_faces(arrangement: Arrangement, shape: tuple[int, int], resolution: float) -> Ints32:
    """The one face that holds each cell's centre, int32 (rows, cols); -1 outside the box."""
    corners, offsets = arrangement.rings
    image = np.full(shape, -1, np.int32)
    _paint_convex(corners / resolution - 0.5, offsets, image)
    return image


@njit(cache=True, nogil=True)
def _paint_convex(corners: Floats, offsets: Ints, image: Ints32) -> None:
    """Fill convex rings, counter-clockwise, corners (n, 2) as (col, row), row by row between two edges."""
    rows, cols = image.shape
    left = np.empty(rows, np.int64)
    right = np.empty(rows, np.int64)
    for face in range(len(offsets) - 1):
        first, last = offsets[face], offsets[face + 1]
        low, high = rows, 0
        for i in range(first, last):
            j = i + 1 if i + 1 < last else first
            # a rising edge bounds the face on its right, a falling one on its left
            rising = corners[j, 1] > corners[i, 1]
            a, b = (i, j) if rising else (j, i)
            # rows and columns are half open, so that a centre on an edge is in one of its two faces only
            from_row = max(int(np.ceil(corners[a, 1])), 0)
            to_row = min(int(np.ceil(corners[b, 1])), rows)
            if from_row >= to_row:
                continue
            slope = (corners[b, 0] - corners[a, 0]) / (corners[b, 1] - corners[a, 1])
            for row in range(from_row, to_row):
                col = int(np.ceil(corners[a, 0] + (row - corners[a, 1]) * slope))
                if rising:
                    right[row] = min(max(col, 0), cols)
                else:
                    left[row] = min(max(col, 0), cols)
            low, high = min(low, from_row), max(high, to_row)
        for row in range(low, high):
            for col in range(left[row], right[row]):
                image[row, col] = face


def outline(arrangement: Arrangement, group: Ints, count: int) -> list[shapely.Polygon]:
    """Polygons of the groups 0 ... count - 1 in local metres, with their holes, without needless corners.

    Args:
        arrangement: The faces.
        group: int64 (f,), each group connected through the faces' edges.
        count: Number of groups.
    """
    rings, owner, area = _boundary_rings(arrangement, group)
    shells: list[Floats | None] = [None] * count
    holes: list[list[Floats]] = [[] for _ in range(count)]
    best = np.zeros(count)
    for ring, index, size in zip(rings, owner, area, strict=True):
        if size <= 0:
            holes[index].append(ring)
        elif size > best[index]:
            shells[index], best[index] = ring, size
    groups = [k for k in range(count) if shells[k] is not None]
    polygons = np.array([shapely.Polygon()] * count, object)
    if groups:
        corners = [ring for k in groups for ring in (shells[k], *holes[k]) if ring is not None]
        of_group = np.repeat(np.arange(len(groups)), [1 + len(holes[k]) for k in groups])
        of_ring = np.repeat(np.arange(len(corners)), [len(ring) for ring in corners])
        polygons[groups] = shapely.polygons(
            shapely.linearrings(np.concatenate(corners), indices=of_ring), indices=of_group
        )
    return valid_polygons(polygons)


def _boundary_rings(arrangement: Arrangement, group: Ints) -> tuple[list[Floats], Ints, Floats]:
    """Closed boundaries of all groups: corners (n, 2), the group each bounds on its left, and signed area."""
    of_half = np.where(arrangement.face >= 0, group[arrangement.face], -1)
    twin = np.arange(len(of_half)) ^ 1
    outer = (of_half >= 0) & (of_half != of_half[twin])
    after = arrangement.following.copy()
    while (inner := ~outer[after] & outer).any():
        after[inner] = arrangement.following[twin[after[inner]]]
    halves, ends, owner = _walk_around(after, outer, arrangement.line, of_half)
    corners = arrangement.vertices[arrangement.edges.reshape(-1)[halves]]
    rings = np.split(corners, ends[:-1]) if len(ends) else []
    return rings, owner, _signed_areas(rings)


@njit(cache=True, nogil=True)
def _walk_around(after: Ints, outer: Mask, line: Ints, of_half: Ints) -> tuple[Ints, Ints, Ints]:
    """Half-edges that begin at the corners of boundaries, where each boundary ends among them, its group."""
    waiting = outer.copy()
    walked, kept = np.empty(len(outer), np.int64), np.empty(len(outer), np.int64)
    ends, owner = np.empty(len(outer), np.int64), np.empty(len(outer), np.int64)
    count = rings = 0
    for start in range(len(outer)):
        if not waiting[start]:
            continue
        length, here = 0, start
        while waiting[here]:
            waiting[here] = False
            walked[length] = here
            length += 1
            here = after[here]
        first, before = count, walked[length - 1]
        for k in range(length):
            # a corner is where the boundary goes on along another line
            if line[before // 2] != line[walked[k] // 2]:
                kept[count] = walked[k]
                count += 1
            before = walked[k]
        if count - first <= 2:
            # no ring has so few corners: a boundary along lines that coincide keeps all of them
            kept[first : first + length] = walked[:length]
            count = first + length
        ends[rings], owner[rings] = count, of_half[start]
        rings += 1
    return kept[:count], ends[:rings], owner[:rings]


def _signed_areas(rings: list[Floats]) -> Floats:
    """Area of each ring of corners (n, 2), above 0 where it runs counter-clockwise."""
    if not rings:
        return np.zeros(0)
    x, y = np.concatenate(rings).T
    begin = np.cumsum([0, *(len(ring) for ring in rings)])
    following = np.arange(1, len(x) + 1)
    following[begin[1:] - 1] = begin[:-1]
    return np.asarray(np.add.reduceat(x * y[following] - y * x[following], begin[:-1])) / 2
