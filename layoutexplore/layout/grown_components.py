"""Components that grow over a mask, ring by ring, followed through changes at the cost of what changes.

Seeds fall into 4-connected components, and every bare cell goes to the seed with the shortest path to it, as
`layoutexplore.grids.flood.spread_in_place` finds it. A bare cell at the end of a path of n steps depends on
nothing farther away than n cells, neither by its length nor by what is queued first. So when cells change in
a box, only the bare cells within the longest path of it are grown anew; the others follow their seeds, which
may have another number now. Seeds are kept as runs, which are few.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from layoutexplore.errors import checks_making
from layoutexplore.grids.arrays import ZERO, Bytes, Cells, Ints, Ints32, Labels, Mask
from layoutexplore.grids.boxes import Box, box_size, grown_box, union
from layoutexplore.grids.components import join_runs
from layoutexplore.grids.flood import Row, list_marked, mark_border
from layoutexplore.grids.runs import run_end, runs_of, write_runs

SEED, BARE = -128, 0
"""What a cell can be; all other values stand for cells without a label."""

_NO_RUNS = np.empty((0, 3), np.int32)

_LEAST_CONTEXT = 8
"""Least margin of the part that is grown anew, whatever a cell measures: paths are followed from outside."""

LARGE = 0.5
"""Where more than this share of the grid would be grown anew, all of it is, which needs no copy."""


@checks_making
class GrownComponents:
    """The labels of a grid that changes, which has neither seeds nor bare cells at first.

    Args:
        shape: (rows, cols).
        large: See `LARGE`.

    Attributes:
        labels: int16 (rows, cols), int32 once there are more than that can number: of each seed and bare
            cell, from 1, 0 elsewhere. Components of seeds are numbered by their first cell in raster order;
            behind them follow the components of bare cells that no seed reaches.
        count: Number of components.

    Example:
        >>> grown = GrownComponents((1, 6))
        >>> grown.update(np.array([[SEED, BARE, BARE, SEED, 7, BARE]], np.int8), (0, 1, 0, 6))
        >>> grown.labels.tolist(), grown.count
        ([[1, 1, 2, 2, 0, 3]], 3)
    """

    def __init__(self, shape: tuple[int, int], *, large: float = LARGE) -> None:
        self._large = large
        self.labels: Labels = np.zeros(shape, np.int16)
        self.count = self._seeds = self._depth = 0
        self._seed_runs = self._left_runs = _NO_RUNS

    def update(self, cells: Cells, box: Box) -> None:
        """Follow the changes of the grid.

        Args:
            cells: int8 (rows, cols), C-contiguous: `SEED`, `BARE` or anything else.
            box: What differs from the last call lies in it (half open).
        """
        row0, row1, _, _ = box
        first, last = np.searchsorted(self._seed_runs[:, 0], (row0, row1))
        new = runs_of(cells[row0:row1], SEED) + np.array([row0, 0, 0], np.int32)
        runs = np.concatenate([self._seed_runs[:first], new, self._seed_runs[last:]])
        number = join_runs(runs, cells, 0) + 1
        seeds = int(number.max(initial=0))
        self._seed_runs = runs
        if not (self._holds(seeds) and self._grow_part(cells, box, number, seeds)):
            self._grow_all(cells, number, seeds)
        self._number_left_over(cells)
        if not self._holds(self.count):
            self._grow_all(cells, number, seeds)
            self._number_left_over(cells)

    def _holds(self, count: int) -> bool:
        """Whether the labels can number so many; if not, they can from now on, and all are to be written."""
        if count <= np.iinfo(self.labels.dtype).max:
            return True
        self.labels = np.zeros(self.labels.shape, np.int32)
        return False

    def _grow_all(self, cells: Cells, number: Ints, seeds: int) -> None:
        """Label all cells but those that no seed reaches, which are -1."""
        rows, cols = self.labels.shape
        write_marks(cells, self._seed_runs, number, (0, 0), self.labels)
        self._depth = grow_marked(self.labels, (0, rows, 0, cols))
        self._left_runs = runs_of(self.labels, -1)
        self._seeds = seeds

    def _grow_part(self, cells: Cells, box: Box, number: Ints, seeds: int) -> bool:
        """Label what may have changed; False, with nothing said of the labels, where that is too much."""
        now, split = _renumbered(self._seed_runs, number, self.labels, box, self._seeds)
        shape, depth = self.labels.shape, self._depth
        # Components that no seed had reached may touch the box, however short paths are.
        part = grown_box(box, max(depth, 1), shape)
        if split.any():
            part = union(part, grown_box(_box_of(self._seed_runs, self.labels, split, box), depth, shape))
        part = self._with_left_over(part)
        context = max(depth, _LEAST_CONTEXT)
        while True:
            around = grown_box(part, context, shape)
            if box_size(around) > self._large * self.labels.size:
                return False
            row0, row1, col0, col1 = around
            first, last = np.searchsorted(self._seed_runs[:, 0], (row0, row1))
            window = np.empty((row1 - row0, col1 - col0), self.labels.dtype)
            here = slice(row0, row1), slice(col0, col1)
            write_marks(cells[here], self._seed_runs[first:last], number[first:last], (row0, col0), window)
            inner = part[0] - row0, part[1] - row0, part[2] - col0, part[3] - col0
            deepest = grow_marked(window, inner)
            if deepest <= context:
                break
            context = 2 * deepest
        grown = window[inner[0] : inner[1], inner[2] : inner[3]]
        left = runs_of(grown, -1) + np.array([part[0], part[2], part[2]], np.int32)
        # Bare cells that nothing reaches in the window may be reached from outside of it.
        if len(left) and _leave(left - np.array([row0, col0, col0], np.int32), window, inner):
            return False
        if (now[now > 0] != np.flatnonzero(now)).any():
            _relabel(self.labels, now)
        self.labels[part[0] : part[1], part[2] : part[3]] = grown
        kept = self._left_runs[~_touching(self._left_runs, part)]
        runs = np.concatenate([kept, left])
        self._left_runs = runs[np.lexsort((runs[:, 1], runs[:, 0]))]
        self._depth, self._seeds = max(depth, deepest), seeds
        return True

    def _with_left_over(self, part: Box) -> Box:
        """A box that holds all or nothing of each component of bare cells that no seed had reached."""
        runs = self._left_runs
        while True:
            near = np.unique(self.labels[runs[:, 0], runs[:, 1]][_touching(runs, part)])
            wider = part
            if len(near):
                runs_near = runs[np.isin(self.labels[runs[:, 0], runs[:, 1]], near)]
                wider = union(part, _around(runs_near))
            if wider == part:
                return part
            part = wider

    def _number_left_over(self, cells: Cells) -> None:
        """Number the components of bare cells that no seed reaches."""
        number = join_runs(self._left_runs, cells, 0) + 1 + self._seeds
        write_runs(self._left_runs, number, self.labels)
        self.count = int(number.max(initial=self._seeds))


def _around(runs: Ints32) -> Box:
    """The box around runs int32 (n, 3)."""
    return int(runs[0, 0]), int(runs[-1, 0]) + 1, int(runs[:, 1].min()), int(runs[:, 2].max())


def _touching(runs: Ints32, box: Box) -> Mask:
    """Bool (n,): which runs int32 (n, 3) have a cell in a box."""
    row0, row1, col0, col1 = box
    return (runs[:, 0] >= row0) & (runs[:, 0] < row1) & (runs[:, 1] < col1) & (runs[:, 2] > col0)


@njit(cache=True, nogil=True)
def write_marks(cells: Cells, runs: Ints32, number: Ints, corner: tuple[int, int], labels: Labels) -> None:
    """The numbers of seeds, -1 for bare cells and 0 for others, all over the labels of a part of the grid.

    Args:
        cells: int8 (rows, cols), the part.
        runs: int32 (n, 3), the runs of seeds in its rows, of the whole grid.
        number: int64 (n,), their numbers.
        corner: Row and column of the part's first cell.
        labels: (rows, cols), of the part.
    """
    rows, cols = labels.shape
    for r in range(rows):
        here, line = cells[r], labels[r]
        for c in range(cols):
            line[c] = -1 if here[c] == BARE else 0
    for k in range(len(runs)):
        r = runs[k, 0] - corner[0]
        first, last = max(runs[k, 1] - corner[1], 0), min(runs[k, 2] - corner[1], cols)
        if first < last:
            labels[r, first:last] = np.int32(number[k])


@njit(cache=True, nogil=True)
def _find_front(labels: Labels) -> tuple[Ints32, int]:
    """The labelled cells with a neighbour of -1, flat and in raster order, and how many they are."""
    rows, cols = labels.shape
    front, n = np.empty(4096, np.int32), ZERO
    mark = np.zeros(8 * (cols // 8 + 1), np.uint8)
    below, here, above = np.empty(cols, np.uint8), np.empty(cols, np.uint8), np.empty(cols, np.uint8)
    for r in range(rows):
        _find_bare(labels[max(r - 1, 0)], below)
        _find_bare(labels[r], here)
        _find_bare(labels[min(r + 1, rows - 1)], above)
        mark_border(labels[r], here, below, above, mark)
        front, n = list_marked(mark, r * cols, front, n)
    return front, n


@njit(cache=True, nogil=True)
def _find_bare(label: Row, bare: Bytes) -> None:
    """Write which cells of a row are -1."""
    for c in range(label.size):
        bare[c] = label[c] == -1


@njit(cache=True, nogil=True)
def _any_inside(front: Ints32, n: int, cols: int, box: Box) -> bool:
    """Whether one of the first n flat cells lies in a box."""
    for k in range(n - 1, -1, -1):
        r, c = front[k] // cols, front[k] % cols
        if box[0] <= r < box[1] and box[2] <= c < box[3]:
            return True
    return False


@njit(cache=True, nogil=True)
def grow_marked(labels: Labels, inner: Box) -> int:
    """Spread labels above 0 over cells of -1, in the order of `spread_in_place` when queued backwards.

    Args:
        labels: (rows, cols), C-contiguous; what stays -1 is connected with no label.
        inner: A half-open box.

    Returns:
        The number of steps to the last cells in the inner box that are labelled.
    """
    cols, flat = labels.shape[1], labels.ravel()
    front, n = _find_front(labels)
    ahead = np.empty(front.size, np.int32)
    # A column too far comes out in another row, which matters where cells at the sides are bare alone.
    sides = cols > 1 and ((labels[:, 0] == -1).any() or (labels[:, cols - 1] == -1).any())
    steps_aside = (-cols, cols, -1, 1)
    step, deepest = 0, 0
    while n > 0:
        step += 1
        # A cell has three neighbours that are not labelled yet at most, but for those of the first front.
        if ahead.size < 4 * n:
            ahead = np.empty(4 * n, np.int32)
        m = ZERO
        for j in range(n):
            i = int(front[np.uint64(j)])
            label = flat[np.uint64(i)]
            for away in steps_aside:
                k = i + away
                if k < 0 or k >= flat.size:
                    continue
                place = np.uint64(k)
                if flat[place] != -1 or (sides and (away == 1 or away == -1) and k // cols != i // cols):
                    continue
                flat[place] = label
                ahead[np.uint64(m)] = k
                m += 1
        front, ahead, n = ahead, front, m
        if n > 0 and _any_inside(front, n, cols, inner):
            deepest = step
    return deepest


@njit(cache=True, nogil=True)
def _renumbered(runs: Ints32, number: Ints, labels: Labels, box: Box, seeds: int) -> tuple[Ints32, Mask]:
    """The new number int32 (seeds + 1,) of each of the old seeds' labels, 0 where nothing is left of it.

    And bool (seeds + 1,): whether it has several. Only cells outside of the box, where nothing has changed,
    have a say.
    """
    now, split = np.zeros(seeds + 1, np.int32), np.zeros(seeds + 1, np.bool_)
    row0, row1, col0, col1 = box
    for k in range(len(runs)):
        r, first, last = runs[k]
        inside = row0 <= r < row1
        # A run that crosses the box may have had different labels on either side of it.
        for end in range(2):
            c = first if end == 0 else last - 1
            if inside and (c >= col0 if end == 0 else c < col1):
                continue
            old = labels[r, c]
            if now[old] == 0:
                now[old] = number[k]
            elif now[old] != number[k]:
                split[old] = True
    return now, split


@njit(cache=True, nogil=True)
def _box_of(runs: Ints32, labels: Labels, chosen: Mask, box: Box) -> Box:
    """A box and what lies around all runs outside of it whose old label is chosen."""
    row0, row1, col0, col1 = box
    low_row, high_row, low_col, high_col = box
    for k in range(len(runs)):
        r, first, last = runs[k]
        inside = row0 <= r < row1
        before, behind = not inside or first < col0, not inside or last > col1
        if (before and chosen[labels[r, first]]) or (behind and chosen[labels[r, last - 1]]):
            low_row, high_row = min(low_row, r), max(high_row, r + 1)
            low_col, high_col = min(low_col, first), max(high_col, last)
    return low_row, high_row, low_col, high_col


@njit(cache=True, nogil=True)
def _relabel(labels: Labels, now: Ints32) -> None:
    """Give each label that seeds had, from 1 on, its new number; other labels stay."""
    for r in range(labels.shape[0]):
        row, c = labels[r], ZERO
        while c < row.size:
            label, first = row[c], c
            c = run_end(row, c, label)
            if 0 < label < len(now) and now[label] != label:
                row[first:c] = now[label]


@njit(cache=True, nogil=True)
def _leave(runs: Ints32, labels: Labels, inner: Box) -> bool:
    """Whether a run of -1 in an inner box goes on, above, below or beside it, outside of that box."""
    rows, cols = labels.shape
    row0, row1, col0, col1 = inner
    for k in range(len(runs)):
        r, first, last = runs[k]
        if first == col0 and first > 0 and labels[r, first - 1] == -1:
            return True
        if last == col1 and last < cols and labels[r, last] == -1:
            return True
        for beside in (r - 1, r + 1):
            if 0 <= beside < rows and not row0 <= beside < row1:
                for c in range(first, last):
                    if labels[beside, c] == -1:
                        return True
    return False
