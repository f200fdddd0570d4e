"""Walls and representative lines (ROSE2, section III-B; IAS-15, section III).

Aligned segments of one direction that touch or nearly touch make a wall. Walls of one direction that lie closer to each
other than a doorway is wide share a representative line: the heaviest wall takes in the lighter ones around it, so that
two far walls are never chained together by the walls between them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from layoutexplore.layout.segments import AlignedSegments


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

    group: NDArray[np.int64]
    direction: NDArray[np.int64]
    offset: NDArray[np.float64]
    start: NDArray[np.float64]
    end: NDArray[np.float64]
    length: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.direction)


def find_walls(segments: AlignedSegments, gap: float) -> WallGroups:
    """Chains of segments of one direction, each within `gap` metres of the next (DBSCAN with one point a cluster)."""
    n = len(segments)
    first, second = _pairs_within(segments.direction, segments.offset, gap)
    apart = np.maximum(segments.start[first], segments.start[second]) - np.minimum(segments.end[first], segments.end[second])
    aside = segments.offset[first] - segments.offset[second]
    near = np.maximum(apart, 0.0) ** 2 + aside**2 <= gap**2
    return summarise(segments, components(first[near], second[near], n))


def merge_walls(segments: AlignedSegments, walls: WallGroups, distance: float) -> WallGroups:
    """Groups of walls of one direction whose lines are closer than `distance` metres to the heaviest among them."""
    leader = np.full(len(walls), -1, np.int64)
    order = np.lexsort((np.arange(len(walls)), -walls.length.round(9)))
    key = walls.direction * 1e6 + walls.offset
    by_key = np.argsort(key, kind="stable")
    sorted_key = key[by_key]
    for wall in order:
        if leader[wall] < 0:
            low, high = np.searchsorted(sorted_key, (key[wall] - distance, key[wall] + distance))
            members = by_key[low:high]
            members = members[leader[members] < 0]
            leader[members] = wall
            leader[wall] = wall
    _, group_of_wall = np.unique(leader, return_inverse=True)
    return summarise(segments, group_of_wall.reshape(-1)[walls.group])


def chain_lines(segments: AlignedSegments, distance: float) -> WallGroups:
    """Groups of segments of one direction by single linkage of their lines' distances (IAS-15's spatial clusters)."""
    order = np.lexsort((segments.offset, segments.direction))
    direction, offset = segments.direction[order], segments.offset[order]
    breaks = (np.diff(direction) != 0) | (np.diff(offset) >= distance)
    group = np.empty(len(order), np.int64)
    group[order] = np.concatenate(([0], np.cumsum(breaks))) if len(order) else 0
    return summarise(segments, group)


def summarise(segments: AlignedSegments, group: NDArray[np.int64]) -> WallGroups:
    """The groups' directions, offsets and extents, given the group of each segment (0 ... m - 1, none empty)."""
    count = int(group.max()) + 1 if len(group) else 0
    start, end = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(start, group, segments.start)
    np.maximum.at(end, group, segments.end)
    direction = np.zeros(count, np.int64)
    direction[group] = segments.direction
    return WallGroups(
        group=group.astype(np.int64),
        direction=direction,
        offset=grouped_median(segments.offset, segments.length, group, count),
        start=start,
        end=end,
        length=sums(group, segments.length, count),
    )


def grouped_median(
    values: NDArray[np.float64], weights: NDArray[np.float64], group: NDArray[np.int64], count: int
) -> NDArray[np.float64]:
    """Weighted lower median float64 (count,) of the values of each group; no group is empty.

    Example:
        >>> grouped_median(np.array([3.0, 1.0, 2.0]), np.array([1.0, 5.0, 1.0]), np.array([0, 0, 0]), 1).tolist()
        [1.0]
    """
    order = np.lexsort((values, group))
    values, weights, group = values[order], np.maximum(weights[order], 1e-9), group[order]
    total = np.bincount(group, weights, count)
    before = np.concatenate(([0.0], np.cumsum(total)))[:-1]
    reached = np.cumsum(weights) - before[group] >= total[group] / 2 - 1e-9
    first = np.full(count, len(values), np.int64)
    np.minimum.at(first, group[reached], np.flatnonzero(reached))
    return values[first] if count else np.zeros(0)


def sums(index: NDArray[np.int64], weights: NDArray[np.float64], count: int = 0) -> NDArray[np.float64]:
    """Sum of the weights (n,) of each index (n,), float64 (count or more,)."""
    return np.asarray(np.bincount(index, weights, count), np.float64)


def components(first: NDArray[np.int64], second: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Connected components int64 (count,) of an undirected graph, numbered by their first member."""
    graph = scipy.sparse.coo_array((np.ones(len(first), np.int8), (first, second)), shape=(count, count))
    _, label = connected_components(graph, directed=False)
    _, first_member, inverse = np.unique(label, return_index=True, return_inverse=True)
    rank = np.empty(len(first_member), np.int64)
    rank[np.argsort(first_member)] = np.arange(len(first_member))
    return rank[inverse.reshape(-1)]


def _pairs_within(
    group: NDArray[np.int64], position: NDArray[np.float64], distance: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Index pairs of members of one group whose positions differ by at most `distance`."""
    key = group * 1e6 + position
    order = np.argsort(key, kind="stable")
    last = np.searchsorted(key[order], key[order] + distance, side="right")
    here = np.arange(len(key))
    count = last - here - 1
    first = np.repeat(here, count)
    step = np.arange(len(first)) - np.repeat(np.cumsum(count) - count, count) + 1
    return order[first], order[first + step]
