"""Room segmentation by critical lines of the Voronoi graph (Thrun and Bücken; Bormann et al. 2016).

The graph is the skeleton of the free space, spurs pruned. Cells of it where the free space is narrowest are critical
points; the lines from them to the walls cut the free space into pieces, and pieces that share much of their border merge.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from layoutexplore.layout.baselines_merging import merge_by_borders
from layoutexplore.layout.wavefront import grow_labels


@dataclass(frozen=True, kw_only=True)
class VoronoiConfig:
    """Options of the Voronoi method (Bormann et al., Table I).

    Attributes:
        neighbourhood: A critical point is the narrowest of 280 / D cells of the graph, D its distance to the walls in cells.
        iterations: A neighbourhood grows so many times at most.
        spacing: Of two critical points closer than this share of their distance to the walls one is dropped.
        area_min: Smallest piece [m2].
        merge_area: A room with one neighbour merges with it below this area [m2].
    """

    neighbourhood: int = 280
    iterations: int = 150
    spacing: float = 0.5
    area_min: float = 0.1
    merge_area: float = 12.5


@njit("uint8[:,::1](uint8[:,::1])", cache=True, nogil=True)
def _thin(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Skeleton of a mask whose border cells are 0 (Zhang and Suen's two sub-iterations)."""
    rows, cols = image.shape
    out = image.copy()
    alive = np.empty(rows * cols, np.int32)
    n = 0
    for r in range(1, rows - 1):
        for c in range(1, cols - 1):
            if out[r, c]:
                alive[n] = r * cols + c
                n += 1
    gone = np.empty(n, np.int32)
    changed = True
    while changed:
        changed = False
        for phase in range(2):
            m = 0
            for k in range(n):
                r, c = alive[k] // cols, alive[k] % cols
                p2, p3, p4, p5 = out[r - 1, c], out[r - 1, c + 1], out[r, c + 1], out[r + 1, c + 1]
                p6, p7, p8, p9 = out[r + 1, c], out[r + 1, c - 1], out[r, c - 1], out[r - 1, c - 1]
                total = p2 + p3 + p4 + p5 + p6 + p7 + p8 + p9
                if total < 2 or total > 6:
                    continue
                turns = (p2 < p3) + (p3 < p4) + (p4 < p5) + (p5 < p6) + (p6 < p7) + (p7 < p8) + (p8 < p9) + (p9 < p2)
                if turns != 1:
                    continue
                if phase == 0 and p2 * p4 * p6 == 0 and p4 * p6 * p8 == 0:
                    gone[m] = alive[k]
                    m += 1
                if phase == 1 and p2 * p4 * p8 == 0 and p2 * p6 * p8 == 0:
                    gone[m] = alive[k]
                    m += 1
            for k in range(m):
                out[gone[k] // cols, gone[k] % cols] = 0
            if m > 0:
                changed = True
                left = 0
                for k in range(n):
                    if out[alive[k] // cols, alive[k] % cols]:
                        alive[left] = alive[k]
                        left += 1
                n = left
    return out


@njit(cache=True, nogil=True)
def _degree(graph: NDArray[np.uint8], r: int, c: int) -> int:
    count = 0
    for rr in range(r - 1, r + 2):
        for cc in range(c - 1, c + 2):
            count += graph[rr, cc]
    return int(count - graph[r, c])


@njit("void(uint8[:,::1], int64)", cache=True, nogil=True)
def _prune(graph: NDArray[np.uint8], passes: int) -> None:
    """Delete ends of spurs in raster order, pass by pass, up to the nodes (cells of at least three neighbours)."""
    rows, cols = graph.shape
    node = np.zeros((rows, cols), np.bool_)
    for r in range(1, rows - 1):
        for c in range(1, cols - 1):
            node[r, c] = graph[r, c] > 0 and _degree(graph, r, c) >= 3
    for _ in range(passes):
        changed = False
        for r in range(1, rows - 1):
            for c in range(1, cols - 1):
                if graph[r, c] and not node[r, c] and _degree(graph, r, c) <= 1:
                    graph[r, c] = 0
                    changed = True
        if not changed:
            break


@njit("int32[:,::1](uint8[:,::1], uint8[:,::1], int64, int64)", cache=True, nogil=True)
def _critical_points(
    graph: NDArray[np.uint8], distance: NDArray[np.uint8], neighbourhood: int, iterations: int
) -> NDArray[np.int32]:
    rows, cols = graph.shape
    left = graph.copy()
    members = np.empty(rows * cols, np.int32)
    points = np.empty((rows * cols // 4 + 1, 2), np.int32)
    count = 0
    for r in range(rows):
        for c in range(cols):
            if not left[r, c]:
                continue
            wanted = neighbourhood // max(int(distance[r, c]), 1)
            left[r, c] = 0
            members[0] = r * cols + c
            n, begin = 1, 0
            for _ in range(iterations):
                if n > wanted or begin == n:
                    break
                end = n
                for k in range(begin, end):
                    r0, c0 = members[k] // cols, members[k] % cols
                    for rr in range(max(r0 - 1, 0), min(r0 + 2, rows)):
                        for cc in range(max(c0 - 1, 0), min(c0 + 2, cols)):
                            if left[rr, cc]:
                                left[rr, cc] = 0
                                members[n] = rr * cols + cc
                                n += 1
                begin = end
            best = members[0]
            for k in range(1, n):
                m = members[k]
                if distance[m // cols, m % cols] < distance[best // cols, best % cols]:
                    best = m
            points[count, 0] = best // cols
            points[count, 1] = best % cols
            count += 1
    return points[:count].copy()


def voronoi_graph(free: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Cells of the pruned Voronoi graph, uint8 (rows, cols): the skeleton inside the opened and twice eroded free space."""
    image = np.pad(free.astype(np.uint8), 1)
    square = np.ones((3, 3), np.uint8)
    inner = cv2.erode(cv2.morphologyEx(image, cv2.MORPH_OPEN, square), square, iterations=2)
    graph = _thin(np.ascontiguousarray(image)) & cast("NDArray[np.uint8]", inner)
    graph = np.ascontiguousarray(graph)
    _prune(graph, 100)
    return np.ascontiguousarray(graph[1:-1, 1:-1])


def critical_lines(
    free: NDArray[np.bool_], points: NDArray[np.int32], distance: NDArray[np.uint8], spacing: float
) -> list[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]]:
    """The lines that cut the free space: each critical point that stays with its two basis points, as (row, col)."""
    ring = free & (cv2.erode(np.pad(free, 1).astype(np.uint8), np.ones((3, 3), np.uint8))[1:-1, 1:-1] == 0)
    walls = np.argwhere(ring)
    if len(walls) == 0 or len(points) == 0:
        return []
    tree = cKDTree(walls)
    found = []
    for point in points.astype(np.int64):
        reach = int(distance[point[0], point[1]])
        first = _nearest(tree, walls, point, point, 0.0)
        second = None if first is None else _nearest(tree, walls, point, first, float(reach))
        if first is None or second is None:
            continue
        a, b = (first - point).astype(float), (second - point).astype(float)
        lengths = float(np.hypot(*a)), float(np.hypot(*b))
        cosine = float(a @ b) / max(lengths[0] * lengths[1], 1e-9)
        found.append((point, first, second, round(float(np.arccos(np.clip(cosine, -1, 1))), 9), sum(lengths), reach))
    kept = []
    centres = cKDTree(np.array([f[0] for f in found])) if found else None
    for i, (point, first, second, angle, length, reach) in enumerate(found):
        assert centres is not None
        rivals = [j for j in centres.query_ball_point(point, spacing * reach) if j != i]
        beaten = any(
            angle < found[j][3] or (angle == found[j][3] and length > found[j][4] and (found[j][4] > 3 or j < i)) for j in rivals
        )
        if not beaten:
            kept.append((point, first, second))
    return kept


def _nearest(
    tree: cKDTree, walls: NDArray[np.int64], point: NDArray[np.int64], away_from: NDArray[np.int64], apart: float
) -> NDArray[np.int64] | None:
    """The wall cell nearest to a point that is farther than `apart` from another; ties in raster order."""
    count = 16
    while True:
        distances, indices = tree.query(point, k=min(count, len(walls)))
        distances, indices = np.atleast_1d(distances), np.atleast_1d(indices)
        good = np.hypot(*(walls[indices] - away_from).T) > apart if apart > 0 else np.ones(len(indices), bool)
        if good.any():
            nearest = distances[good].min()
            return np.asarray(walls[indices[good & (distances <= nearest + 1e-9)].min()])
        if count >= len(walls):
            return None
        count *= 8


def voronoi_labels(free: NDArray[np.bool_], resolution: float, config: VoronoiConfig) -> NDArray[np.int32]:
    """Rooms of the Voronoi method, int32 (rows, cols), 0 outside the free space."""
    distance = np.minimum(np.rint(cv2.distanceTransform(np.pad(free, 1).astype(np.uint8), cv2.DIST_L2, 5)), 255)
    distance = np.ascontiguousarray(distance[1:-1, 1:-1].astype(np.uint8))
    points = _critical_points(voronoi_graph(free), distance, config.neighbourhood, config.iterations)
    cut = free.astype(np.uint8)
    for point, first, second in critical_lines(free, points, distance, config.spacing):
        for end in (first, second):
            cv2.line(cut, (int(point[1]), int(point[0])), (int(end[1]), int(end[0])), 0, 2)
    contours, _ = cv2.findContours(cut, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    count, parts = cv2.connectedComponents(cut, connectivity=8)
    areas = np.zeros(count)
    for contour in contours:
        col, row = contour[0, 0]
        areas[parts[row, col]] = cv2.contourArea(contour) * resolution**2
    keep = areas >= config.area_min
    keep[0] = False
    seeds = np.where(keep[parts], parts, 0).astype(np.int32)
    return merge_by_borders(grow_labels(seeds, free), resolution, merge_area=config.merge_area)
