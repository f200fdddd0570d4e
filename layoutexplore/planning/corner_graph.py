"""The corners of a grid and what joins them, kept while the grid changes.

A floor of three million cells has some thousand corners (see `layoutexplore.planning.corner_sight`), so that
a search from one place to all others takes less than a millisecond. When cells change, only those corners are
joined anew whose edges depend on cells near the changes.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numba import njit

from layoutexplore.errors import checks_making
from layoutexplore.grids.arrays import Bytes, Ints, Ints32, Mask
from layoutexplore.planning.corner_search import Edges, Nodes, spread_from
from layoutexplore.planning.corner_sight import (
    Ground,
    corners_in_sight,
    is_corner,
    number_at,
    numbers_at,
    octile,
    room_for_corners,
    shut_ground,
    with_numbers,
    write_stops,
)

TILE = 16
"""Side of the tiles in which changes are noticed together, whatever a cell measures."""


class GraphChange(NamedTuple):
    """What an update has changed.

    Attributes:
        touched: int32 (n, 2), the cells that have changed, and those beside them.
        sums: int32 (tiles + 1, tiles + 1), tiles with changes above and left of each tile.
        old: int64 (n,), how far each corner was, before, from the nearest one that lost or changed edges;
            None where nothing has changed, or where it was not asked for.
        new: int64 (n,), how far each is now from the nearest one with new or changed edges; likewise.
    """

    touched: Ints32
    sums: Ints32
    old: Ints | None = None
    new: Ints | None = None


@checks_making
class CornerGraph:
    """Corners of a grid that changes, nowhere traversable at first.

    Args:
        shape: (rows, cols) of the grid.

    Attributes:
        ground: The grid.
        nodes: Its corners.
        edges: What joins them.
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self.ground = shut_ground(shape)
        rows, cols = self.ground.world.shape
        self._dirty = np.zeros((rows // TILE + 1, cols // TILE + 1), np.uint8)
        self._found = room_for_corners(self.ground)
        self._free = np.empty(0, np.int64)
        self._count, self._used = 1, 0  # Number 0 stands for no corner.
        cells, boxes = np.zeros((1024, 2), np.int32), np.zeros((1024, 4), np.int32)
        self.nodes = Nodes(cells, boxes, *np.zeros((2, 1024), np.int64))
        self.edges = Edges(*np.zeros((2, 1 << 14), np.int32))

    def update(self, window: Bytes, row: int, col: int, *, compare: bool = False) -> GraphChange:
        """Take over a part of the grid.

        Args:
            window: uint8 (n, m), 1 where a robot can go; nothing outside of it has changed.
            row: Of the window's first cell in the padded grid.
            col: Likewise.
            compare: Whether to tell which edges have changed.
        """
        touched = take_over(self.ground.world, window, row, col)
        self._dirty[:] = 0
        if len(touched) == 0:
            return GraphChange(touched, tile_sums(self._dirty))
        gone, new = _mark(self.ground, touched, self._dirty)
        lost, gained = self._numbers(gone), self._add(new)
        self.ground = with_numbers(self.ground, gone, np.zeros(len(gone), np.int64))
        write_stops(self.ground, touched)
        sums = tile_sums(self._dirty)
        numbers = outdated(self.nodes.cell, self.nodes.seen[: self._count], sums)
        numbers = numbers[~np.isin(numbers, lost)]
        first, degree = self._explore(numbers)
        differs = _differs(self.nodes, self.edges, numbers, first, degree) if compare else numbers
        old = self._distances(np.concatenate([lost, differs])) if compare else differs
        self.nodes.first[numbers], self.nodes.degree[numbers] = first, degree
        self.nodes.cell[lost], self.nodes.degree[lost] = 0, 0
        # Numbers are free only now: until here none stood for two corners.
        self._free = np.concatenate([self._free, lost])
        if not compare:
            return GraphChange(touched, sums)
        new_ends = self._distances(np.concatenate([gained, differs]))
        return GraphChange(touched, sums, old, new_ends)

    def distances_from(self, corners: Ints32, lengths: Ints) -> Ints:
        """Distances int64 (n,) of all corners, by number, from corners int32 (m,) with lengths int64 (m,)."""
        # A diagonal of the grid is as long as one and a half straight moves a row or column, at most.
        longest = 3 * max(self.ground.world.shape) // 2
        return spread_from(self.nodes, self.edges, corners, lengths, longest)

    def _numbers(self, cells: Ints32) -> Ints:
        return numbers_at(self.ground, cells).astype(np.int64)

    def _distances(self, numbers: Ints) -> Ints:
        return self.distances_from(numbers.astype(np.int32), np.zeros(len(numbers), np.int64))

    def _add(self, cells: Ints32) -> Ints:
        """Number corners. They see themselves, and no other yet: the change there makes them look."""
        again = self._free[max(len(self._free) - len(cells), 0) :]
        self._free = self._free[: len(self._free) - len(again)]
        more = np.arange(self._count, self._count + len(cells) - len(again))
        self._count += len(more)
        while self._count > len(self.nodes.cell):
            self.nodes = Nodes(*(np.concatenate([column, np.zeros_like(column)]) for column in self.nodes))
        numbers = np.concatenate([again, more])
        self.ground = with_numbers(self.ground, cells, numbers)
        self.nodes.cell[numbers], self.nodes.degree[numbers] = cells, 0
        self.nodes.seen[numbers] = np.repeat(cells, 2, axis=1) + np.array([0, 1, 0, 1], np.int32)
        return numbers

    def _explore(self, numbers: Ints) -> tuple[Ints, Ints]:
        """Where in the pool the edges of corners now lie, and how many they are."""
        first, degree = np.zeros((2, len(numbers)), np.int64)
        done = 0
        while True:
            done, self._used = _explore_from(
                self.ground, self.nodes, self.edges, numbers, (first, degree), (done, self._used), self._found
            )
            if done == len(numbers):
                return first, degree
            self._make_room(numbers[:done], first, degree)

    def _make_room(self, done: Ints, first: Ints, degree: Ints) -> None:
        """Leave out of the pool what nobody has any more, and make it larger where that does not do."""
        begins = np.concatenate([self.nodes.first[: self._count], first[: len(done)]])
        counts = np.concatenate([self.nodes.degree[: self._count], degree[: len(done)]])
        size = max(len(self.edges.end), 2 * (int(counts.sum()) + len(self._found)))
        fresh = Edges(np.zeros(size, np.int32), np.zeros(size, np.int32))
        self._used = _compact(begins, counts, self.edges, fresh)
        self.edges = fresh
        self.nodes.first[: self._count], first[: len(done)] = begins[: self._count], begins[self._count :]


def take_over(world: Bytes, window: Bytes, row: int, col: int) -> Ints32:
    """Make a part of a padded world like a window.

    Returns:
        int32 (n, 2), the inner cells that have changed or have one beside them that has, corners included.
    """
    changed = np.zeros((window.shape[0] + 2, window.shape[1] + 2), np.uint8)
    _take_over(world, window, row, col, changed)
    touched = np.asarray(cv2.dilate(changed, np.ones((3, 3), np.uint8)), np.uint8)
    return _inner_cells(touched, row - 1, col - 1, world.shape[0], world.shape[1])


@njit(cache=True, nogil=True)
def _take_over(world: Bytes, window: Bytes, row: int, col: int, changed: Bytes) -> None:
    """Make a part of the world like a window; 1 in `changed`, which has a border, where it was not."""
    for r in range(window.shape[0]):
        here, line, differs = world[row + r, col : col + window.shape[1]], window[r], changed[r + 1, 1:-1]
        for c in range(line.size):
            differs[c] = here[c] != line[c]
            here[c] = line[c]


@njit(cache=True, nogil=True)
def _inner_cells(mask: Bytes, row: int, col: int, rows: int, cols: int) -> Ints32:
    """Cells int32 (n, 2) of a mask that begins at (row, col), less those on the border of a grid."""
    cells, count = np.empty((np.count_nonzero(mask), 2), np.int32), 0
    for r in range(max(1 - row, 0), min(rows - 1 - row, mask.shape[0])):
        for c in range(max(1 - col, 0), min(cols - 1 - col, mask.shape[1])):
            if mask[r, c]:
                cells[count, 0], cells[count, 1] = row + r, col + c
                count += 1
    return cells[:count]


def tile_sums(dirty: Bytes) -> Ints32:
    """The number of dirty tiles above and left of each tile: int32, a row and a column more than tiles."""
    sums = np.zeros((dirty.shape[0] + 1, dirty.shape[1] + 1), np.int32)
    dirty.cumsum(0, dtype=np.int32).cumsum(1, out=sums[1:, 1:])
    return sums


@njit(cache=True, nogil=True)
def outdated(cells: Ints32, boxes: Ints32, sums: Ints32) -> Ints:
    """Numbers of the boxes (n, 4) that touch a tile with changes; those of cells in row 0 are not in use."""
    found = np.empty(len(boxes), np.int64)
    n = 0
    for k in range(len(boxes)):
        if cells[k, 0] == 0:
            continue
        # Half open, in tiles; the sums hold one row and column more than there are tiles.
        row0, row1 = boxes[k, 0] // TILE, (boxes[k, 1] - 1) // TILE + 1
        col0, col1 = boxes[k, 2] // TILE, (boxes[k, 3] - 1) // TILE + 1
        if sums[row1, col1] - sums[row0, col1] - sums[row1, col0] + sums[row0, col0] > 0:
            found[n] = k
            n += 1
    return found[:n].copy()


@njit(cache=True, nogil=True)
def _mark(ground: Ground, touched: Ints32, dirty: Bytes) -> tuple[Ints32, Ints32]:
    """Those of some cells that have ceased to be, and have become, corners; all are noted by tile."""
    gone, new = np.empty_like(touched), np.empty_like(touched)
    less, more = 0, 0
    for n in range(len(touched)):
        r, c = touched[n, 0], touched[n, 1]
        dirty[r // TILE, c // TILE] = 1
        # Numbers are dealt later: every cell is touched once.
        is_one, was_one = is_corner(ground.world, r, c), number_at(ground, r, c) > 0
        if is_one and not was_one:
            new[more] = touched[n]
            more += 1
        elif was_one and not is_one:
            gone[less] = touched[n]
            less += 1
    return gone[:less].copy(), new[:more].copy()


@njit(cache=True, nogil=True)
def _explore_from(
    ground: Ground,
    nodes: Nodes,
    edges: Edges,
    numbers: Ints,
    written: tuple[Ints, Ints],
    done: tuple[int, int],
    found: Ints32,
) -> tuple[int, int]:
    """Write the edges of corners into the pool, behind what is used of it, and the boxes they depend on.

    `written` receives where they begin and how many there are; `done` says how many corners are done already
    and how much of the pool is used. Returns the same: the pool may be too small for all of them.
    """
    (first, degree), used = written, done[1]
    for n in range(done[0], len(numbers)):
        k = numbers[n]
        row, col = nodes.cell[k, 0], nodes.cell[k, 1]
        count, row0, row1, col0, col1 = corners_in_sight(ground, row, col, found)
        # All of a corner's edges stand side by side: half of them are not begun with.
        if used + count > len(edges.end):
            return n, used
        nodes.seen[k, 0], nodes.seen[k, 1], nodes.seen[k, 2], nodes.seen[k, 3] = row0, row1, col0, col1
        first[n], degree[n] = used, count
        for m in range(count):
            r, c = found[m, 0], found[m, 1]
            edges.end[used], edges.length[used] = number_at(ground, r, c), octile(r - row, c - col)
            used += 1
    return len(numbers), used


@njit(cache=True, nogil=True)
def _differs(nodes: Nodes, edges: Edges, numbers: Ints, first: Ints, degree: Ints) -> Ints:
    """Those of some corners whose edges are not what they were."""
    differs: Mask = np.zeros(len(numbers), np.bool_)
    for n in range(len(numbers)):
        k = numbers[n]
        differs[n] = degree[n] != nodes.degree[k]
        # Edges are found in the same order each time; between the same corners they have the same length.
        for m in range(0 if differs[n] else degree[n]):
            differs[n] |= edges.end[first[n] + m] != edges.end[nodes.first[k] + m]
    return numbers[differs]


@njit(cache=True, nogil=True)
def _compact(first: Ints, degree: Ints, edges: Edges, fresh: Edges) -> int:
    """Copy edges into another pool, and write down where they begin there; how many there are."""
    used = 0
    for k in range(len(first)):
        begin, end = first[k], first[k] + degree[k]
        first[k] = used
        used += degree[k]
        fresh.end[first[k] : used] = edges.end[begin:end]
        fresh.length[first[k] : used] = edges.length[begin:end]
    return used
