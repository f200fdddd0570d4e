"""Merging of the Voronoi method's regions by the share of their border (Bormann et al. 2016)."""

from __future__ import annotations

import heapq

import numpy as np
from numba import njit

from layoutexplore.errors import checks_making
from layoutexplore.grids.arrays import Ints, Ints32

RULES = "abcde"
"""The authors' rules in their order: each is through with all regions before the next one begins."""


@checks_making
class Borders:
    """Who borders on whom: cells along each region's border by the label they belong to.

    Attributes:
        area: Cells of each region, by label.
        shares: For each region, cells next to it by label, 0 for walls.
        perimeter: The sum of each region's shares.
    """

    def __init__(self, labels: Ints32) -> None:
        count = int(labels.max(initial=0)) + 1
        self.area: list[int] = np.bincount(labels.ravel(), minlength=count).tolist()
        self.shares: list[dict[int, int]] = [{} for _ in range(count)]
        padded = np.ascontiguousarray(np.pad(labels, 1))
        keys, cells = np.unique(_border_cells(padded, count), return_counts=True)
        for key, number in zip(keys.tolist(), cells.tolist(), strict=True):
            self.shares[key // count][key % count] = number
        self.perimeter = [sum(shares.values()) for shares in self.shares]

    def merge(self, gone: int, into: int) -> None:
        """Make one region of two; their common border vanishes."""
        self.area[into] += self.area[gone]
        self.area[gone] = 0
        for other, cells in self.shares[gone].items():
            if other != into:
                self.shares[into][other] = self.shares[into].get(other, 0) + cells
            if other > 0:
                theirs = self.shares[other].pop(gone)
                if other != into:
                    self.shares[other][into] = self.shares[other].get(into, 0) + theirs
        self.shares[gone], self.perimeter[gone] = {}, 0
        self.perimeter[into] = sum(self.shares[into].values())

    def around(self, region: int) -> set[int]:
        """The region, its neighbours and theirs: all whose merging depends on the shares of the first two."""
        near = {region, *self.shares[region]} - {0}
        return near.union(*(self.shares[k] for k in near)) - {0}


@njit(cache=True, nogil=True)
def _border_cells(padded: Ints32, count: int) -> Ints:
    """Pairs as label * count + other, for each cell of the other beside the label, once a label and cell.

    `padded` are the labels with a border of zeros.
    """
    rows, cols = padded.shape
    pairs = np.empty((1024, 2), np.int64)
    n = 0
    seen = np.empty(8, np.int64)
    for r in range(1, rows - 1):
        for c in range(1, cols - 1):
            mine = padded[r, c]
            # nearly all cells have eight neighbours of their own label: found without a branch
            same = (padded[r, c - 1] == mine) & (padded[r, c + 1] == mine)
            for cc in range(c - 1, c + 2):
                same &= (padded[r - 1, cc] == mine) & (padded[r + 1, cc] == mine)
            if same:
                continue
            m = 0
            for rr in range(r - 1, r + 2):
                for cc in range(c - 1, c + 2):
                    other = padded[rr, cc]
                    if other == mine or other == 0:
                        continue
                    known = False
                    for k in range(m):
                        known = known or seen[k] == other
                    if not known:
                        seen[m] = other
                        m += 1
                        if n >= len(pairs):
                            pairs = np.concatenate((pairs, np.empty_like(pairs)))
                        pairs[n, 0] = other
                        pairs[n, 1] = mine
                        n += 1
    return pairs[:n, 0] * count + pairs[:n, 1]


def merge_target(borders: Borders, region: int, rule: str, area: float, merge_area: float) -> int:
    """The neighbour that a region of so many square metres merges into by one of `RULES`, 0 for none."""
    shares, perimeter = borders.shares[region], borders.perimeter[region]
    neighbours = sorted((k for k in shares if k > 0), key=lambda k: (-shares[k], k))
    if not neighbours:
        return 0
    if rule == "d":
        return next((k for k in neighbours if _share_much(borders, region, k)), 0)
    largest = neighbours[0]
    wall, border = shares.get(0, 0) / perimeter, shares[largest] / perimeter
    if rule == "a":
        merges = len(neighbours) == 1 and area < merge_area and wall <= 0.75
    elif rule == "b":
        their_wall = borders.shares[largest].get(0, 0) / borders.perimeter[largest]
        merges = area < 2.0 and border > 0.2 and their_wall <= 0.8
    elif rule == "c":
        is_end = len(neighbours) == 1 or wall + border > 0.98
        merges = is_end and wall > 0.5 and border > 0.15 and not _crossroads(borders, largest)
    else:
        merges = border > 0.4
    return largest if merges else 0


def _share_much(borders: Borders, region: int, other: int) -> bool:
    """Rule (d): the common border is much of the region's, by its share of wall, and some of the other's."""
    shares, perimeter = borders.shares[region], borders.perimeter[region]
    wall, mine = shares.get(0, 0) / perimeter, shares[other] / perimeter
    theirs = borders.shares[other].get(region, 0) / borders.perimeter[other]
    # counted, not divided: a room with one neighbour has exactly 1 - border of wall
    between = 0.95 - 2 * mine < wall and shares.get(0, 0) < perimeter - shares[other]
    return (mine > 0.2 or (mine > 0.1 and between)) and theirs > 0.1


def _crossroads(borders: Borders, region: int) -> bool:
    """More than two neighbours, and the wall and the two largest of them are not nearly all of its border."""
    shares = borders.shares[region]
    sizes = sorted((v for k, v in shares.items() if k > 0), reverse=True)
    return len(sizes) > 2 and (shares.get(0, 0) + sum(sizes[:2])) < 0.95 * borders.perimeter[region]


def merge_by_borders(labels: Ints32, resolution: float, *, merge_area: float) -> Ints32:
    """Merge regions by one of `RULES` after the other, always the smallest that it applies to; ties by label.

    Regions without a target wait outside the queue until a merge changes something around them.

    Args:
        labels: int32 (rows, cols), 0 for walls.
        resolution: Metres a cell.
        merge_area: A region with one neighbour merges with it below this area [m2].
    """
    borders = Borders(labels)
    into = np.arange(len(borders.area), dtype=np.int32)
    for rule in RULES:
        queue = [(area, region) for region, area in enumerate(borders.area) if region > 0 and area > 0]
        queued = set(queue)
        heapq.heapify(queue)
        while queue:
            entry = heapq.heappop(queue)
            queued.discard(entry)
            area, region = entry
            if borders.area[region] != area:
                continue
            target = merge_target(borders, region, rule, area * resolution**2, merge_area)
            if target == 0:
                continue
            borders.merge(region, target)
            into[region] = target
            for other in borders.around(target):
                entry = borders.area[other], other
                if entry not in queued:
                    queued.add(entry)
                    heapq.heappush(queue, entry)
    while (into[into] != into).any():
        into = into[into]
    return np.asarray(into[labels])
