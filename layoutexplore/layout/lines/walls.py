"""Walls and representative lines (ROSE2, section III-B; IAS-15, section III).

Aligned segments of one direction that touch or nearly touch make a wall. Walls of one direction that lie
closer to each other than a doorway is wide share a representative line: the heaviest wall takes in the
lighter ones around it, so that two far walls are never chained together by the walls between them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Floats, Ints
from layoutexplore.grids.components import join, number_sets
from layoutexplore.layout.lines.segments import AlignedSegments


@dataclass(frozen=True, kw_only=True, eq=False)
class WallGroups:
    """Groups of aligned segments, m groups of n segments.

    Attributes:
        group: int64 (n,), the group of each segment.
        direction: int64 (m,), index of each group's direction.
        offset: float64 (m,), lateral median of the segments' midpoints, weighted by length, in metres.
        start: float64 (m,), smallest coordinate along the direction.
        end: float64 (m,), largest coordinate along the direction.
        length: float64 (m,), summed length of the segments.
    """

    group: Ints
    direction: Ints
    offset: Floats
    start: Floats
    end: Floats
    length: Floats

    def __len__(self) -> int:
        return len(self.direction)

    def ends(self, directions: Floats) -> tuple[Floats, Floats]:
        """Both ends float64 (m, 2) of every group, in metres, by the directions float64 (k,) in radians."""
        c, s = np.cos(directions)[self.direction], np.sin(directions)[self.direction]
        start, end = (
            np.stack((at * c - self.offset * s, at * s + self.offset * c), axis=1)
            for at in (self.start, self.end)
        )
        return start, end


def find_walls(segments: AlignedSegments, gap: float) -> WallGroups:
    """Chains of segments of one direction, each within `gap` metres of the next (DBSCAN of one point)."""
    key = segments.direction * 1e6 + segments.offset
    order = np.argsort(key, kind="stable")
    return summarise(
        segments, _chains(order, key, segments.offset, segments.start, segments.end, gap, gap**2)
    )


@njit(cache=True, nogil=True)
def _chains(
    order: Ints, key: Floats, offset: Floats, start: Floats, end: Floats, gap: float, gap_squared: float
) -> Ints:
    """Chain of each segment; `order` sorts `key`, which rises with the direction, then with the offset."""
    parent = np.arange(len(order)).astype(np.int32)
    for n in range(len(order)):
        i = order[n]
        for m in range(n + 1, len(order)):
            j = order[m]
            # keys rise with the offset, and far apart between directions: none behind is in reach
            if key[j] > key[i] + gap:
                break
            apart = max(max(start[i], start[j]) - min(end[i], end[j]), 0.0)
            aside = offset[i] - offset[j]
            if apart * apart + aside * aside <= gap_squared:
                join(parent, i, j)
    return number_sets(parent)


def merge_walls(segments: AlignedSegments, walls: WallGroups, distance: float) -> WallGroups:
    """Groups of walls of one direction, their lines closer than `distance` metres to the heaviest of them."""
    heaviest = np.argsort(-walls.length.round(9), kind="stable")
    key = walls.direction * 1e6 + walls.offset
    by_key = np.argsort(key, kind="stable")
    return summarise(segments, _lines_of_walls(heaviest, by_key, key[by_key], distance)[walls.group])


@njit(cache=True, nogil=True)
def _lines_of_walls(heaviest: Ints, by_key: Ints, key: Floats, distance: float) -> Ints:
    """Line of each wall; `heaviest` sorts the walls by falling length, `by_key` by the rising `key`."""
    count = len(heaviest)
    place = np.empty(count, np.int64)
    place[by_key] = np.arange(count)
    # a wall that leads joins no other one; what a heavier one has taken stays with it
    leader = np.full(count, -1, np.int64)
    for wall in heaviest:
        if leader[wall] < 0:
            at = key[place[wall]]
            for n in range(np.searchsorted(key, at - distance), np.searchsorted(key, at + distance)):
                if leader[by_key[n]] < 0:
                    leader[by_key[n]] = wall
            # the range is half open: with a distance of 0 it does not hold the wall itself
            leader[wall] = wall
    rank = np.zeros(count + 1, np.int64)
    for wall in range(count):
        rank[wall + 1] = rank[wall] + (leader[wall] == wall)
    return rank[leader]


def chain_lines(segments: AlignedSegments, distance: float) -> WallGroups:
    """Groups of segments of one direction by single linkage of their lines (IAS-15's spatial clusters)."""
    order = np.lexsort((segments.offset, segments.direction))
    direction, offset = segments.direction[order], segments.offset[order]
    breaks = (np.diff(direction) != 0) | (np.diff(offset) >= distance)
    group = np.empty(len(order), np.int64)
    group[order] = np.concatenate(([0], np.cumsum(breaks))) if len(order) else 0
    return summarise(segments, group)


def on_heaviest(lines: WallGroups, most: int) -> Ints | None:
    """Rows int64 (k,), rising, of the segments on the `most` lines of largest length; None for all of them.

    A line goes with all its segments: what is left falls into the same walls and lines again.
    """
    if len(lines) <= most:
        return None
    kept = np.zeros(len(lines), np.bool_)
    kept[np.argsort(-lines.length.round(9), kind="stable")[:most]] = True
    return np.flatnonzero(kept[lines.group])


def summarise(segments: AlignedSegments, group: Ints) -> WallGroups:
    """The groups' directions, offsets and extents, given each segment's group (0 ... m - 1, none empty)."""
    count = int(group.max()) + 1 if len(group) else 0
    direction, start, end, length = _extents(group, count, segments.direction, segments.start, segments.end)
    return WallGroups(
        group=group,
        direction=direction,
        offset=grouped_median(segments.offset, segments.length, group, count),
        start=start,
        end=end,
        length=length,
    )


@njit(cache=True, nogil=True)
def _extents(
    group: Ints, count: int, direction: Ints, start: Floats, end: Floats
) -> tuple[Ints, Floats, Floats, Floats]:
    """Direction, start, end and summed length of each group."""
    directions, lengths = np.zeros(count, np.int64), np.zeros(count)
    starts, ends = np.full(count, np.inf), np.full(count, -np.inf)
    for n in range(len(group)):
        k = group[n]
        directions[k] = direction[n]
        starts[k], ends[k] = min(starts[k], start[n]), max(ends[k], end[n])
        lengths[k] += end[n] - start[n]
    return directions, starts, ends, lengths


def grouped_median(values: Floats, weights: Floats, group: Ints, count: int) -> Floats:
    """Weighted lower median float64 (count,) of the values of each group; no group is empty.

    Example:
        >>> values, weights = np.array([3.0, 1.0, 2.0]), np.array([1.0, 5.0, 1.0])
        >>> grouped_median(values, weights, np.array([0, 0, 0]), 1).tolist()
        [1.0]
    """
    return np.asarray(_medians(np.lexsort((values, group)), values, weights, group, count))


@njit(cache=True, nogil=True)
def _medians(order: Ints, values: Floats, weights: Floats, group: Ints, count: int) -> Floats:
    """The medians; `order` sorts by group first and value then."""
    total = np.zeros(count)
    for n in order:
        # a group of weights 0 has a median too
        total[group[n]] += max(weights[n], 1e-9)
    # groups follow each other in `order`: one running sum serves them all
    before = np.zeros(count + 1)
    before[1:] = np.cumsum(total)
    out = np.full(count, np.nan)
    running = 0.0
    for n in order:
        running += max(weights[n], 1e-9)
        k = group[n]
        if np.isnan(out[k]) and running - before[k] >= total[k] / 2 - 1e-9:
            out[k] = values[n]
    return out


def sums(index: Ints, weights: Floats, count: int = 0) -> Floats:
    """Sum of the weights (n,) of each index (n,), float64 (count or more,)."""
    return np.asarray(np.bincount(index, weights, count), np.float64)
