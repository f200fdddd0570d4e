"""The Voronoi graph of the free space, and its critical points (Thrun and Bücken; Bormann et al. 2016).

The sites are the cells of the free space's contours, as in the survey, and not its skeleton: a ragged wall
makes many short branches, and the critical points among them make the many regions that the method merges
afterwards.
"""

from __future__ import annotations

from typing import Any, cast

import cv2
import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Bytes, Floats, Ints32, Mask


def contour_cells(free: Mask) -> Ints32:
    """Cells int32 (n, 2) as (row, col) along the contours of a mask and of its holes, each once."""
    contours, _ = cv2.findContours(free.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    if not contours:
        return np.zeros((0, 2), np.int32)
    cells = np.concatenate([contour[:, 0, ::-1] for contour in contours])
    _, first = np.unique(cells[:, 0].astype(np.int64) * free.shape[1] + cells[:, 1], return_index=True)
    return np.ascontiguousarray(cells[np.sort(first)], np.int32)


PASSES = 100
"""Of the pruning of spurs."""


def voronoi_graph(free: Mask, sites: Ints32) -> Bytes:
    """Cells of the pruned Voronoi graph, uint8 (rows, cols).

    Edges are drawn whose ends both lie in the opened and twice eroded free space; then ends of spurs are
    deleted.

    Args:
        free: bool (rows, cols).
        sites: int32 (n, 2), the cells whose graph it is, as (row, col).
    """
    image = np.pad(free.astype(np.uint8), 1)
    square = np.ones((3, 3), np.uint8)
    inner = cv2.erode(cv2.morphologyEx(image, cv2.MORPH_OPEN, square), square, iterations=2)[1:-1, 1:-1]
    graph = np.zeros((free.shape[0] + 2, free.shape[1] + 2), np.uint8)
    _draw_edges(voronoi_edges(sites, free.shape), np.ascontiguousarray(cast("Bytes", inner)), graph)
    _prune(graph, PASSES)
    return np.ascontiguousarray(graph[1:-1, 1:-1])


def voronoi_edges(sites: Ints32, shape: tuple[int, int]) -> Floats:
    """Finite edges float64 (n, 4) of the sites' Voronoi diagram, as the rows and columns of their ends."""
    rows, cols = shape
    if len(sites) < 3:
        return np.zeros((0, 4))
    triangulation: Any = cv2.Subdiv2D((-1, -1, cols + 2, rows + 2))
    triangulation.insert(sites[:, ::-1].astype(np.float32))
    # an empty tuple for none
    corners = np.reshape(triangulation.getTriangleList(), (-1, 3, 2)).astype(np.float64)
    centres = _circumcentres(corners)
    # The two triangles on a side are neighbours: sort the sides by the numbers of their ends.
    number = (corners[:, :, 1] * cols + corners[:, :, 0]).astype(np.int64)
    other = number[:, (1, 2, 0)]
    key = (np.minimum(number, other) * (rows * cols) + np.maximum(number, other)).reshape(-1)
    order = np.argsort(key, kind="stable")
    twins = np.flatnonzero(key[order[1:]] == key[order[:-1]])
    return np.concatenate((centres[order[twins] // 3], centres[order[twins + 1] // 3]), axis=1)


def _circumcentres(corners: Floats) -> Floats:
    """Centres (row, col) float64 (n, 2) of circles through corners (x, y) (n, 3, 2); NaN where flat."""
    a = corners[:, 0]
    (bx, by), (cx, cy) = (corners[:, 1] - a).T, (corners[:, 2] - a).T
    twice = 2 * (bx * cy - by * cx)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.where(twice == 0, np.nan, 1 / twice)
    b, c = bx * bx + by * by, cx * cx + cy * cy
    return np.stack((a[:, 1] + (bx * c - cx * b) * scale, a[:, 0] + (cy * b - by * c) * scale), axis=1)


@njit(cache=True, nogil=True)
def _draw_edges(edges: Floats, inner: Bytes, graph: Bytes) -> None:
    """Draw edges with both ends inside, lines of 8-connected cells, into a graph with a border of a cell."""
    rows, cols = inner.shape
    for k in range(len(edges)):
        edge = edges[k]
        # asked so that NaN is outside
        if not (min(edge[0], edge[2]) >= 0 and max(edge[0], edge[2]) <= rows - 1):
            continue
        if not (min(edge[1], edge[3]) >= 0 and max(edge[1], edge[3]) <= cols - 1):
            continue
        r0, c0 = int(np.rint(edge[0])), int(np.rint(edge[1]))
        r1, c1 = int(np.rint(edge[2])), int(np.rint(edge[3]))
        if inner[r0, c0] == 0 or inner[r1, c1] == 0:
            continue
        steps = max(abs(r1 - r0), abs(c1 - c0))
        for i in range(steps + 1):
            share = i / max(steps, 1)
            r, c = np.floor(r0 + share * (r1 - r0) + 0.5), np.floor(c0 + share * (c1 - c0) + 0.5)
            graph[int(r) + 1, int(c) + 1] = 1


@njit(cache=True, nogil=True)
def _degree(graph: Bytes, r: int, c: int) -> int:
    """Neighbours of a cell in the graph."""
    count = 0
    for rr in range(r - 1, r + 2):
        for cc in range(c - 1, c + 2):
            count += graph[rr, cc]
    return int(count - graph[r, c])


@njit(cache=True, nogil=True)
def _prune(graph: Bytes, passes: int) -> None:
    """Delete ends of spurs in raster order, pass by pass, up to nodes (cells of three neighbours or more)."""
    rows, cols = graph.shape
    # cells that are no nodes, in raster order; a cell deleted makes the next one an end in the same pass
    loose = np.empty((rows * cols, 2), np.int32)
    n = 0
    for r in range(1, rows - 1):
        for c in range(1, cols - 1):
            if graph[r, c] and _degree(graph, r, c) < 3:
                loose[n, 0], loose[n, 1] = r, c
                n += 1
    for _ in range(passes):
        left = 0
        for k in range(n):
            r, c = loose[k, 0], loose[k, 1]
            if _degree(graph, r, c) <= 1:
                graph[r, c] = 0
            else:
                loose[left, 0], loose[left, 1] = r, c
                left += 1
        if left == n:
            break
        n = left


@njit(cache=True, nogil=True)
def _take_neighbourhood(left: Bytes, members: Ints32, r: int, c: int, wanted: int, iterations: int) -> int:
    """Move cells around one of the graph from `left` to `members`, ring by ring, until more than wanted.

    As the authors count, a cell is one for each cell of the ring before that it lies beside. Returns how many
    were moved; the last ring is always whole.
    """
    rows, cols = left.shape
    left[r, c] = 0
    members[0] = r * cols + c
    n, begin, counted = 1, 0, 0
    for _ in range(iterations):
        if counted > wanted or begin == n:
            break
        end = n
        for k in range(begin, end):
            r0, c0 = members[k] // cols, members[k] % cols
            for rr in range(max(r0 - 1, 0), min(r0 + 2, rows)):
                for cc in range(max(c0 - 1, 0), min(c0 + 2, cols)):
                    # a 2 is queued already, in this ring
                    counted += left[rr, cc] > 0
                    if left[rr, cc] == 1:
                        left[rr, cc] = 2
                        members[n] = rr * cols + cc
                        n += 1
        for k in range(end, n):
            left[members[k] // cols, members[k] % cols] = 0
        begin = end
    return n


@njit(cache=True, nogil=True)
def _critical_points(graph: Bytes, distance: Bytes, neighbourhood: int, iterations: int) -> Ints32:
    """`critical_points` of contiguous arrays."""
    rows, cols = graph.shape
    # every cell is in one stretch only: what one has taken begins none
    left = graph.copy()
    members = np.empty(rows * cols, np.int32)
    points = np.empty((256, 2), np.int32)
    count = 0
    for r in range(rows):
        for c in range(cols):
            if not left[r, c]:
                continue
            wanted = neighbourhood // max(int(distance[r, c]), 1)
            n = _take_neighbourhood(left, members, r, c, wanted, iterations)
            best = members[0]
            for k in range(1, n):
                m = members[k]
                if distance[m // cols, m % cols] < distance[best // cols, best % cols]:
                    best = m
            if count >= len(points):
                points = np.concatenate((points, np.empty_like(points)))
            points[count, 0], points[count, 1] = best // cols, best % cols
            count += 1
    return points[:count].copy()


def critical_points(graph: Bytes, distance: Bytes, neighbourhood: int, iterations: int) -> Ints32:
    """The narrowest cell of each stretch of the graph, int32 (n, 2) as (row, col); ties go to the first met.

    Args:
        graph: uint8 (rows, cols), 1 for the cells of the graph.
        distance: uint8 (rows, cols), to the walls in cells.
        neighbourhood: A stretch has this many cells, divided by the distance where it begins, those that lie
            beside several of the stretch counted several times.
        iterations: A stretch grows so many times at most.
    """
    return _critical_points(
        np.ascontiguousarray(graph), np.ascontiguousarray(distance), neighbourhood, iterations
    )
