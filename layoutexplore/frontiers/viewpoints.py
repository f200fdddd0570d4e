"""Where to stand to look at a frontier, and whether a frontier is still there.

A viewpoint is the reachable cell nearest to the cluster's middle that sees it: standing on the frontier
itself is rarely possible (it may lie closer to a wall than the robot's radius), and the nearest reachable
cell as the crow flies may lie on the other side of a wall, so the line of sight through known free cells
decides.
"""

from __future__ import annotations

import functools
import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.errors import checks_making
from layoutexplore.frontiers.detection import FrontierClusters
from layoutexplore.frontiers.table import FrontierList, FrontierTable
from layoutexplore.frontiers.visible_area import VisibleUnknownArea
from layoutexplore.grids.arrays import Cells, Floats, Ints, Ints32, Mask, Words
from layoutexplore.grids.boxes import Box, box_around
from layoutexplore.grids.grid import FREE, UNKNOWN, OccupancyGrid, Pose
from layoutexplore.grids.morphology import borders_unknown, disc_offsets
from layoutexplore.grids.rays import is_free_line
from layoutexplore.planning.distance_fields import DistanceField

MAX_REACH = 1.5
"""How far from the frontier a viewpoint may lie, in metres: beyond, the gap is too narrow for the robot."""

MIN_SIZE = 0.4
"""Metres; shorter frontiers are offered only when no longer one is left."""

GAIN_RANGE, GAIN_RAYS = 8.0, 120
"""Metres up to which the visible area of a viewpoint looks, and its rays."""

NONE_FAILED = np.empty(0, np.uint64)
"""For a map whose viewpoints are searched for the first time."""

Units = NDArray[np.integer]
"""Geodesic distances from the robot in any unit, or 0 where it can go and 1 elsewhere."""

_MIX = np.uint64(0x9E3779B97F4A7C15)


@checks_making
class ViewpointSelector:
    """Selects, for each frontier of a run, the viewpoint that the robot is offered.

    Args:
        shape: (rows, cols) of the grid.
        resolution: Metres per cell.
        min_size: Metres; shorter frontiers are offered only when no longer one is left.
        gain_range: Metres up to which the visible area looks.
        gain_rays: Rays per viewpoint for it.
    """

    def __init__(
        self, shape: tuple[int, int], resolution: float, *, min_size: float, gain_range: float, gain_rays: int
    ) -> None:
        self._cols, self._min_size = shape[1], min_size
        self._view = VisibleUnknownArea(shape, resolution, gain_range, gain_rays)
        self._blacklisted = np.empty(0, np.int64)
        self._failed = NONE_FAILED

    def blacklist(self, cells: Ints32) -> None:
        """Never offer these frontier cells int32 (n, 2) again: looking at them showed nothing new."""
        indices = cells.astype(np.int64) @ np.array([self._cols, 1])
        self._blacklisted = np.sort(np.concatenate([self._blacklisted, indices]))

    def forgive(self) -> None:
        """Offer the blacklisted cells again."""
        self._blacklisted = self._blacklisted[:0]
        self._failed = NONE_FAILED

    def frontiers(
        self,
        grid: OccupancyGrid,
        here: Pose,
        distances: DistanceField,
        clusters: FrontierClusters,
        changed: Box,
    ) -> FrontierList:
        """The frontiers that the robot can look at, nearest first by path length (ties in raster order).

        Args:
            grid: What the robot knows.
            here: Where it believes it is.
            distances: Path lengths from the robot.
            clusters: All frontier clusters of the grid.
            changed: Around all cells of the grid that changed since the last call.
        """
        clusters = self._without_blacklisted(clusters)
        view, found, self._failed = choose_viewpoints(
            grid.cells, distances.units, distances.settled, clusters, grid.resolution, self._failed
        )
        sizes = np.diff(clusters.offsets) * grid.resolution
        usable = found & (sizes >= self._min_size - 1e-9)
        kept = np.flatnonzero(usable if usable.any() else found)
        lengths = distances.to_cells(view[kept])
        order = np.argsort(lengths, kind="stable")
        kept, lengths = kept[order], lengths[order]
        areas = self._view.areas(grid.cells, view[kept], changed)
        middles = grid.cells_to_world(_middles(clusters.cells, clusters.offsets)[kept])
        x, y = np.ascontiguousarray(middles.T)
        away, not_predicted = np.hypot(x - here.x, y - here.y), np.zeros(len(kept))
        table = FrontierTable(
            x=x,
            y=y,
            path_length=lengths.astype(np.float64),
            straight_distance=away,
            size=sizes[kept],
            visible_area=areas,
            closed=not_predicted,
            expected_area=not_predicted,
            confidence=not_predicted,
        )
        return FrontierList(clusters, kept, table, view[kept])

    def _without_blacklisted(self, clusters: FrontierClusters) -> FrontierClusters:
        """The clusters without the blacklisted cells."""
        if len(self._blacklisted) == 0:
            return clusters
        indices = clusters.cells.astype(np.int64) @ np.array([self._cols, 1])
        nearest = self._blacklisted.searchsorted(indices).clip(max=len(self._blacklisted) - 1)
        return clusters.chosen(self._blacklisted[nearest] != indices)


def choose_viewpoints(
    cells: Cells,
    distances: Units,
    farthest: int,
    clusters: FrontierClusters,
    resolution: float,
    failed: Words,
) -> tuple[Ints32, Mask, Words]:
    """A viewpoint for every cluster.

    The cluster's cells are tried from the one nearest the centroid outwards; the first that a reachable cell
    within `MAX_REACH` sees decides, and the nearest such reachable cell is the viewpoint.

    Args:
        cells: int8 (rows, cols), the grid.
        distances: int (rows + 2, cols + 2), geodesic distance from the robot in any unit.
        farthest: The greatest of them that the robot can go.
        clusters: The frontier clusters.
        resolution: Metres per cell.
        failed: uint64 (n,), what the last call on this map returned, or `NONE_FAILED`: clusters for which it
            found none and around which nothing has changed are not searched again.

    Returns:
        int32 (k, 2) viewpoints, bool (k,) whether there is one, and the clusters without, for the next call.
    """
    offsets = _nearest_first(_reach(resolution))
    return _choose(cells, distances, farthest, clusters.cells, clusters.offsets, offsets, failed)


def cells_in_view(cells: Cells, frontier: Ints32, viewpoint: tuple[int, int], resolution: float) -> Ints32:
    """The cells int32 (m, 2) of a frontier that a viewpoint sees from within `MAX_REACH` metres."""
    return frontier[_are_in_view(cells, frontier, viewpoint[0], viewpoint[1], _reach(resolution))]


def facing(cells: Cells, frontier: Ints32, viewpoint: tuple[int, int]) -> float:
    """Heading in radians from a viewpoint (row, col) to the unknown cells along a frontier int32 (n, 2)."""
    row, col = _unknown_middle(cells, frontier)
    return math.atan2(row - viewpoint[0], col - viewpoint[1])


def _reach(resolution: float) -> int:
    """`MAX_REACH` in cells: whole ones, lest a viewpoint see a frontier from where it counts as not seen."""
    return math.ceil(MAX_REACH / resolution)


@functools.lru_cache(maxsize=8)
def _nearest_first(radius: int) -> Ints32:
    """int32 (n, 2): the offsets within a radius in cells, nearest first, ties by row and column."""
    offsets = disc_offsets(radius, closed=True)
    return offsets[np.argsort((offsets**2).sum(axis=1), kind="stable")]


@njit(cache=True, nogil=True)
def _middles(cells: Ints32, offsets: Ints) -> Floats:
    """The mean cell float64 (k, 2) of each cluster."""
    middles = np.empty((len(offsets) - 1, 2))
    for k in range(len(middles)):
        middles[k] = _middle(cells[offsets[k] : offsets[k + 1]])
    return middles


@njit(cache=True, nogil=True)
def _middle(cells: Ints32) -> tuple[float, float]:
    """The mean of cells int32 (n, 2)."""
    rows, cols = 0, 0
    for n in range(len(cells)):
        rows += cells[n, 0]
        cols += cells[n, 1]
    return rows / len(cells), cols / len(cells)


@njit(cache=True, nogil=True)
def _choose(
    cells: Cells,
    distances: Units,
    farthest: int,
    members: Ints32,
    starts: Ints,
    offsets: Ints32,
    failed: Words,
) -> tuple[Ints32, Mask, Words]:
    """Viewpoints, whether there are any, and digests of clusters without; those in `failed` are skipped."""
    count = len(starts) - 1
    view = np.zeros((count, 2), np.int32)
    found = np.zeros(count, np.bool_)
    still_failed, failures = np.empty(count, np.uint64), 0
    for k in range(count):
        cluster = members[starts[k] : starts[k + 1]]
        middle_row, middle_col = _middle(cluster)
        # Hardly ever is more than the nearest cell tried, so only then are they sorted.
        first, nearest = 0, np.inf
        for n in range(len(cluster)):
            away = (cluster[n, 0] - middle_row) ** 2 + (cluster[n, 1] - middle_col) ** 2
            if away < nearest:
                first, nearest = n, away
        row, col = cluster[first]
        found[k] = _find_viewpoint(cells, distances, farthest, row, col, offsets, view[k])
        if found[k]:
            continue
        digest = _digest(cells, distances, farthest, cluster, offsets[-1, 0])
        tried = False
        for n in range(len(failed)):
            tried |= failed[n] == digest
        if not tried:
            order = np.argsort(
                (cluster[:, 0] - middle_row) ** 2 + (cluster[:, 1] - middle_col) ** 2, kind="mergesort"
            )
            found[k] = _find_from_any(cells, distances, farthest, cluster[order], offsets, view[k])
        if not found[k]:
            still_failed[failures] = digest
            failures += 1
    return view, found, still_failed[:failures]


@njit(cache=True, nogil=True)
def _find_from_any(
    cells: Cells, distances: Units, farthest: int, ranked: Ints32, offsets: Ints32, view: Ints32
) -> bool:
    """As `_find_viewpoint` for the first that has one of a long frontier's cells, from the middle outwards.

    Sixteen or so, spread evenly, mostly stand for all, and are tried first; where they fail, the frontier may
    still be seen through a doorway that few of its cells lie in.
    """
    stride = max(1, len(ranked) // 16)
    for first in range(stride):
        for rank in range(first, len(ranked), stride):
            row, col = ranked[rank]
            if _find_viewpoint(cells, distances, farthest, row, col, offsets, view):
                return True
    return False


@njit(cache=True, nogil=True)
def _find_viewpoint(
    cells: Cells, distances: Units, farthest: int, row: int, col: int, offsets: Ints32, view: Ints32
) -> bool:
    """Whether a reachable cell at one of the offsets sees a cell; the first one is written into `view` (2,).

    Distances have a border of one cell, which is never reachable.
    """
    rows, cols = cells.shape
    # Nearest offsets first: the first that does is the nearest that does.
    for n in range(len(offsets)):
        r, c = row + offsets[n, 0], col + offsets[n, 1]
        if (
            0 <= r < rows
            and 0 <= c < cols
            and distances[r + 1, c + 1] <= farthest
            and is_free_line(cells, row, col, r, c)
        ):
            view[0], view[1] = r, c
            return True
    return False


@njit(cache=True, nogil=True)
def _digest(cells: Cells, distances: Units, farthest: int, cluster: Ints32, reach: int) -> np.uint64:
    """64 bits of what the search for a cluster's viewpoint reads: its cells, what is free and reachable."""
    # Equal digests are taken for equal surroundings; of 2^64 codes two hardly ever meet in one run.
    code = np.uint64(len(cluster))
    for n in range(len(cluster)):
        code = (code ^ np.uint64(cluster[n, 0] * cells.shape[1] + cluster[n, 1])) * _MIX
    top, bottom, left, right = box_around(cluster)
    row0, row1 = max(top - reach, 0), min(bottom + reach, cells.shape[0])
    col0, col1 = max(left - reach, 0), min(right + reach, cells.shape[1])
    for r in range(row0, row1):
        for c in range(col0, col1):
            kind = 2 * np.int64(cells[r, c] == FREE) + np.int64(distances[r + 1, c + 1] <= farthest)
            code = (code ^ np.uint64(kind)) * _MIX
            code ^= code >> np.uint64(29)
    return code


@njit(cache=True, nogil=True)
def _are_in_view(cells: Cells, frontier: Ints32, row: int, col: int, reach: int) -> Mask:
    """Which cells of a frontier a viewpoint sees from within so many cells, bool (n,)."""
    seen = np.zeros(len(frontier), np.bool_)
    for n in range(len(frontier)):
        r, c = frontier[n]
        # From the frontier to the viewpoint, as `_find_viewpoint` looked: at corners the reverse may differ.
        seen[n] = (r - row) ** 2 + (c - col) ** 2 <= reach**2 and is_free_line(cells, r, c, row, col)
    return seen


@njit(cache=True, nogil=True)
def remaining_share(cells: Cells, frontier: Ints32) -> float:
    """The share of cells int32 (n, 2), at least one, that are unknown or border the unknown, 0..1.

    Of a frontier it is what is left.
    """
    count = 0
    for n in range(len(frontier)):
        r, c = frontier[n]
        count += cells[r, c] == UNKNOWN or (cells[r, c] == FREE and borders_unknown(cells, r, c))
    return count / len(frontier)


@njit(cache=True, nogil=True)
def _unknown_middle(cells: Cells, frontier: Ints32) -> tuple[float, float]:
    """Mean (row, col) of the unknown 4-neighbours of a frontier's cells; of the cells when there is none."""
    rows, cols = cells.shape
    sum_row, sum_col, count = 0.0, 0.0, 0
    for n in range(len(frontier)):
        for d_row, d_col in ((-1, 0), (1, 0), (0, -1), (0, 1)):
            r, c = frontier[n, 0] + d_row, frontier[n, 1] + d_col
            if 0 <= r < rows and 0 <= c < cols and cells[r, c] == UNKNOWN:
                sum_row += r
                sum_col += c
                count += 1
    if count == 0:
        return frontier[:, 0].mean(), frontier[:, 1].mean()
    return sum_row / count, sum_col / count
