"""From faces to rooms (IAS-15, section III; ROSE2, section III-C).

Adjacent faces have an affinity that falls with the covered share of their common edge; DBSCAN with one point
a cluster on one minus the normalised affinity is the same as the connected components of the pairs above a
threshold, which is what is computed here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.arrays import Floats, Ints, Mask
from layoutexplore.grids.components import components
from layoutexplore.layout.lines.faces import Arrangement
from layoutexplore.layout.lines.walls import sums

Number = TypeVar("Number", np.int32, np.int64)

MANY = 1000
"""Small rooms merge one by one, the smallest first; while there are more than this, all at once."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FaceGraph:
    """Which faces touch, and how much wall lies between them; p pairs.

    Attributes:
        first: int64 (p,), the smaller face index of each pair.
        second: int64 (p,), the larger one.
        length: float64 (p,), metres of common boundary.
        covered: float64 (p,), metres of it that seen wall covers.
    """

    first: Ints
    second: Ints
    length: Floats
    covered: Floats

    @property
    def weight(self) -> Floats:
        """float64 (p,): covered share of the common boundary."""
        return self.covered / np.maximum(self.length, 1e-9)


def dissolve(arrangement: Arrangement, open_edge: Mask) -> tuple[Ints, int]:
    """Unite the faces on both sides of the open edges, bool (e,).

    Returns:
        Group of each face, int64 (f,), numbered by the first member, and the number of groups.
    """
    left, right = arrangement.sides.T
    joined = open_edge & (left >= 0) & (right >= 0)
    group = components(left[joined], right[joined], len(arrangement))
    return group, int(group.max()) + 1 if len(group) else 0


def face_graph(arrangement: Arrangement, covered: Floats, group: Ints, count: int) -> FaceGraph:
    """Pairs of different groups with a common edge; `covered` float64 (e,) in metres, `group` int64 (f,)."""
    left, right = arrangement.sides.T
    between = (left >= 0) & (right >= 0)
    a, b = group[left[between]], group[right[between]]
    differ = a != b
    low, high = np.minimum(a, b)[differ], np.maximum(a, b)[differ]
    pair, inverse = np.unique(low * count + high, return_inverse=True)
    inverse = inverse.reshape(-1)
    length = sums(inverse, arrangement.edge_length[between][differ], len(pair))
    return FaceGraph(
        first=pair // max(count, 1),
        second=pair % max(count, 1),
        length=length,
        covered=sums(inverse, covered[between][differ], len(pair)),
    )


def cluster_faces(graph: FaceGraph, inside: Mask, sigma: float, affinity_min: float) -> Ints:
    """Room of each face, int64 (count,), -1 for faces that are not inside.

    Args:
        graph: The faces' neighbourhood.
        inside: bool (count,), the faces that can belong to a room.
        sigma: Scale of the covered share in the affinity exp(-w / sigma).
        affinity_min: Least normalised affinity of faces of one room (1 - eps of DBSCAN).
    """
    count = len(inside)
    both = inside[graph.first] & inside[graph.second]
    first, second = graph.first[both], graph.second[both]
    affinity = np.exp(-graph.weight[both] / sigma)
    degree = 1.0 + np.bincount(first, affinity, count) + np.bincount(second, affinity, count)
    normalised = affinity * (1 / degree[first] + 1 / degree[second]) / 2
    near = normalised >= affinity_min
    room = components(first[near], second[near], count)
    return renumber(np.where(inside, room, -1))


def renumber(group: NDArray[Number], first: int = 0) -> NDArray[Number]:
    """The same grouping (n,) numbered from `first` as groups appear; smaller members become `first` - 1."""
    return np.asarray(_renumber(np.ascontiguousarray(group), first))


@njit(cache=True, nogil=True)
def _renumber(group: NDArray[Any], first: int) -> NDArray[Any]:
    """`renumber` of a flat array."""
    out = np.full_like(group, first - 1)
    # what is below `first` is no number yet
    number = np.full(group.max() + 1 if len(group) else 0, first - 1, group.dtype)
    fresh = first
    for k in range(len(group)):
        if group[k] >= first:
            if number[group[k]] < first:
                number[group[k]] = fresh
                fresh += 1
            out[k] = number[group[k]]
    return out


def merge_small(room: Ints, graph: FaceGraph, area: Floats, least: float) -> Ints:
    """Give rooms of less than `least` m2 to the neighbour with the longest open boundary, smallest first.

    Args:
        room: int64 (count,), room of each face, -1 for none.
        graph: The faces' neighbourhood.
        area: float64 (count,), free square metres of each face.
        least: Smallest room.

    Returns:
        The new rooms; a small room without an open boundary to another one becomes none.
    """
    room = room.copy()
    while True:
        count = int(room.max(initial=-1)) + 1
        inside = room >= 0
        size = np.bincount(room[inside], area[inside], count)
        small = np.flatnonzero(size < least)
        if not len(small):
            return renumber(room)
        if len(small) > MANY:
            room = renumber(_merge_all(room, graph, size < least))
            continue
        victim = small[np.argmin(size[small])]
        room[room == victim] = _most_open_neighbour(room, graph, int(victim))
        room = renumber(room)


def _merge_all(room: Ints, graph: FaceGraph, small: Mask) -> Ints:
    """Give every small room (count,) at once to the neighbour with the longest open boundary.

    Each round leaves at most half of the small rooms small.
    """
    count = len(small)
    a, b = room[graph.first], room[graph.second]
    between = (a >= 0) & (b >= 0) & (a != b)
    a, b, opening = a[between], b[between], (graph.length - graph.covered)[between]
    pair, inverse = np.unique(np.concatenate((a * count + b, b * count + a)), return_inverse=True)
    opening = sums(inverse.reshape(-1), np.concatenate((opening, opening)), len(pair))
    first, second = pair // count, pair % count
    wanted = small[first] & (opening > 1e-6)
    first, second, opening = first[wanted], second[wanted], opening[wanted]
    best = np.lexsort((second, -opening, first))
    best = best[np.concatenate(([True], np.diff(first[best]) > 0))] if len(best) else best
    whole = components(first[best], second[best], count)
    # what is small and opens to nothing is no room
    lonely = np.bincount(whole, minlength=count)[whole] == 1
    whole[small & lonely] = -1
    return np.append(whole, -1)[room]


def _most_open_neighbour(room: Ints, graph: FaceGraph, victim: int) -> int:
    a, b = room[graph.first], room[graph.second]
    other = np.where(a == victim, b, np.where(b == victim, a, -1))
    usable = (other >= 0) & (other != victim)
    opening = np.bincount(other[usable], (graph.length - graph.covered)[usable])
    return int(opening.argmax()) if opening.max(initial=0.0) > 1e-6 else -1
