"""Frontiers: where what is known to be free borders the unknown (Yamauchi, 1997).

A frontier cell is a free cell (value 0) with an unknown cell (-1) to its left, right, above or below.
Frontier cells that touch, corners included, are one cluster. Clusters come in raster order of their first
cells, their cells in raster order. Beyond the border of the array nothing is unknown: a map that is cut out
tightly has no frontier where its free cells end there, until it is padded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from layoutexplore.errors import MapError, checks_arguments, checks_making
from layoutexplore.grids.arrays import Bytes, Cells, Ints, Ints32, Mask, shows_shapes
from layoutexplore.grids.boxes import Box, box_size, grown_box
from layoutexplore.grids.components import join, number_sets
from layoutexplore.grids.grid import FREE, UNKNOWN


@shows_shapes
@dataclass(frozen=True, eq=False)
class FrontierClusters:
    """Clusters of frontier cells.

    Attributes:
        cells: int32 (m, 2) as (row, col), cluster after cluster.
        offsets: int64 (k + 1,): cluster i is `cells[offsets[i]:offsets[i + 1]]`.
    """

    cells: Ints32
    offsets: Ints

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @classmethod
    def of(cls, clusters: Sequence[Ints32]) -> FrontierClusters:
        """Clusters int32 (n, 2), put one behind the other."""
        offsets = np.cumsum([0, *(len(cluster) for cluster in clusters)], dtype=np.int64)
        members = np.concatenate([np.empty((0, 2), np.int32), *clusters])
        return cls(np.ascontiguousarray(members, np.int32), offsets)

    def cluster(self, i: int) -> Ints32:
        """Cells int32 (n, 2) as (row, col) of one cluster."""
        return self.cells[self.offsets[i] : self.offsets[i + 1]]

    def chosen(self, kept: Mask) -> FrontierClusters:
        """The clusters with some of their cells, bool (m,); those that are empty then fall away.

        Example:
            >>> clusters = FrontierClusters.of([np.array([[0, 0], [0, 1]]), np.array([[0, 3]])])
            >>> some = clusters.chosen(np.array([False, True, False]))
            >>> some.cells.tolist(), some.offsets.tolist()
            ([[0, 1]], [0, 1])
        """
        ends = np.concatenate([[0], np.cumsum(kept)])[self.offsets]
        # A cluster of which nothing is left ends where it begins.
        return FrontierClusters(self.cells[kept], ends[np.concatenate([[True], np.diff(ends) > 0])])


@checks_arguments
def find_frontiers(cells: Cells) -> FrontierClusters:
    """All frontier clusters of a grid.

    Args:
        cells: int8 (rows, cols); -1 unknown, 0 free, 100 occupied.

    Example:
        >>> clusters = find_frontiers(np.array([[0, 0, -1], [0, 100, 100], [0, 0, -1]], np.int8))
        >>> len(clusters), clusters.cluster(1).tolist()
        (2, [[2, 1]])
    """
    cells = check_grid(cells)
    flat = _scan(cells, 0, cells.shape[0], 0, cells.shape[1])
    return FrontierClusters(*_cluster(flat, cells.shape[1]))


@checks_making
class FrontierDetector:
    """Frontier clusters of a grid that changes, at the cost of what changed.

    Args:
        shape: (rows, cols) of the grid, which is taken to be all unknown at first.

    Example:
        >>> cells = np.full((4, 4), -1, np.int8)
        >>> detector = FrontierDetector(cells.shape)
        >>> cells[1, 2] = 0
        >>> detector.update(cells, (1, 2, 2, 3)).cells.tolist()
        [[1, 2]]
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self.shape = (int(shape[0]), int(shape[1]))
        self._flat = np.empty(0, np.int64)

    def update(self, cells: Cells, box: Box) -> FrontierClusters:
        """The clusters after cells inside the box have changed; the same as `find_frontiers(cells)`.

        Args:
            cells: int8 (rows, cols), the grid.
            box: (row0, row1, col0, col1), half open, around all cells that changed since the last call; may
                be empty.

        Raises:
            MapError: The grid has another shape than the detector.
        """
        cells = check_grid(cells)
        if cells.shape != self.shape:
            raise MapError(f"this detector follows a grid of shape {self.shape}, got {cells.shape}")
        if box_size(box):
            # A cell next to a changed one may have become, or ceased to be, a frontier.
            around = grown_box(box, 1, self.shape)
            self._flat = _merge(self._flat, _scan(cells, *around), self.shape[1], *around)
        return FrontierClusters(*_cluster(self._flat, self.shape[1]))


def check_grid(cells: Cells) -> Cells:
    """The cells int8 (rows, cols), C-contiguous; raises `MapError` where they are anything else."""
    if cells.ndim != 2 or cells.dtype != np.int8:
        raise MapError(f"frontiers need int8 cells in two dimensions, got {cells.dtype} {cells.shape}")
    return np.ascontiguousarray(cells)


@njit(cache=True, nogil=True)
def _mark_row(here: Cells, left: Cells, right: Cells, above: Cells, below: Cells, mark: Bytes) -> None:
    """Mark free cells beside an unknown one; without branches, so that it compiles to SIMD."""
    for c in range(here.size):
        unknown = (left[c] == UNKNOWN) | (right[c] == UNKNOWN) | (above[c] == UNKNOWN) | (below[c] == UNKNOWN)
        mark[c] = (here[c] == FREE) & unknown


@njit(cache=True, nogil=True)
def _scan(cells: Cells, row0: int, row1: int, col0: int, col1: int) -> Ints:
    """Flat indices of the frontier cells in a box, in raster order."""
    rows, cols = cells.shape
    # Of so much memory only the pages that are written cost anything.
    found = np.empty((row1 - row0) * (col1 - col0), np.int64)
    count = 0
    inner0, inner1 = max(col0, 1), min(col1, cols - 1)
    # One byte a column, looked through eight at a time.
    mark = np.zeros((cols + 7) // 8 * 8, np.uint8)
    words = mark.view(np.uint64)
    for r in range(row0, row1):
        # A row beyond the edge is replaced by the row itself: next to itself no free cell is unknown.
        above, below = cells[max(r - 1, 0)], cells[min(r + 1, rows - 1)]
        if inner1 > inner0:
            here = cells[r, inner0:inner1]
            left, right = cells[r, inner0 - 1 : inner1 - 1], cells[r, inner0 + 1 : inner1 + 1]
            _mark_row(here, left, right, above[inner0:inner1], below[inner0:inner1], mark[inner0:inner1])
        for c in (0, cols - 1):
            if col0 <= c < col1:
                beside = cells[r, max(c - 1, 0)] == UNKNOWN or cells[r, min(c + 1, cols - 1)] == UNKNOWN
                mark[c] = cells[r, c] == FREE and (beside or above[c] == UNKNOWN or below[c] == UNKNOWN)
        for w in range(col0 // 8, (col1 + 7) // 8):
            if words[w] == 0:
                continue
            for c in range(8 * w, 8 * w + 8):
                if mark[c]:
                    found[count] = r * cols + c
                    count += 1
    return found[:count].copy()


@njit(cache=True, nogil=True)
def _merge(old: Ints, fresh: Ints, cols: int, row0: int, row1: int, col0: int, col1: int) -> Ints:
    """The old sorted indices outside of the box and the fresh ones inside, sorted."""
    merged = np.empty(old.size + fresh.size, np.int64)
    first, behind = _first_from(old, row0 * cols), _first_from(old, row1 * cols)
    _copy(old[:first], merged)
    count, j = first, 0
    for i in range(first, behind):
        index = old[i]
        # Inside of the box only the fresh ones hold.
        if col0 <= index % cols < col1:
            continue
        while j < fresh.size and fresh[j] < index:
            merged[count] = fresh[j]
            count += 1
            j += 1
        merged[count] = index
        count += 1
    _copy(fresh[j:], merged[count:])
    count += fresh.size - j
    _copy(old[behind:], merged[count:])
    return merged[: count + old.size - behind].copy()


@njit(cache=True, nogil=True)
def _copy(source: Ints, target: Ints) -> None:
    """Write numbers to where others begin."""
    # Not by slices: the text of what numba says of those that do not fit takes seconds to compile.
    for i in range(source.size):
        target[i] = source[i]


@njit(cache=True, nogil=True)
def _first_from(ordered: Ints, least: int) -> int:
    """Where in ascending numbers the first one stands that is not smaller than `least`."""
    low, high = 0, ordered.size
    while low < high:
        middle = (low + high) // 2
        if ordered[middle] < least:
            low = middle + 1
        else:
            high = middle
    return low


@njit(cache=True, nogil=True)
def _cluster(flat: Ints, cols: int) -> tuple[Ints32, Ints]:
    """Group sorted flat indices into 8-connected clusters: cells (m, 2) and offsets (k + 1,)."""
    m = flat.size
    parent = np.arange(m).astype(np.int32)
    row = np.empty(m, np.int32)
    col = np.empty(m, np.int32)
    # Entries [above, line) lie in the row above, from the current cell's upper left neighbour on; [line, i)
    # in its own.
    above, line, current, start = 0, 0, -1, -cols
    for i in range(m):
        if flat[i] >= start + cols:
            r = flat[i] // cols
            above = line if r == current + 1 else i
            line, current, start = i, r, r * cols
        row[i], col[i] = current, flat[i] - start
        if i > line and col[i - 1] == col[i] - 1:
            parent[i] = parent[i - 1]
        while above < line and col[above] < col[i] - 1:
            above += 1
        k = above
        while k < line and col[k] <= col[i] + 1:
            join(parent, k, i)
            k += 1
    # Roots are the first cells of their clusters, so numbering them in order puts the clusters in order.
    label = number_sets(parent)
    count = label.max() + 1 if m else 0
    offsets = np.zeros(count + 1, np.int64)
    for i in range(m):
        offsets[label[i] + 1] += 1
    for k in range(count):
        offsets[k + 1] += offsets[k]
    place = offsets[:-1].copy()
    cells = np.empty((m, 2), np.int32)
    for i in range(m):
        k = place[label[i]]
        cells[k, 0], cells[k, 1] = row[i], col[i]
        place[label[i]] += 1
    return cells, offsets
