"""Disjoint sets as an array of parents, for kernels that join what touches (Tarjan, "A class of algorithms", 1979)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True, nogil=True)
def root_of(parent: NDArray[np.signedinteger[Any]], i: int) -> int:
    """The member that stands for the set of `i`; the way there is halved. `parent` int32 or int64 (n,)."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@njit(cache=True, nogil=True)
def join(parent: NDArray[np.int32], i: int, j: int) -> None:
    """Make one set of those of `i` and `j`."""
    a, b = root_of(parent, i), root_of(parent, j)
    parent[max(a, b)] = min(a, b)


@njit(cache=True, nogil=True)
def number_sets(parent: NDArray[np.int32]) -> NDArray[np.int64]:
    """The set of each member, numbered from 0 by first member, when all were made by `join`."""
    number = np.empty(len(parent), np.int64)
    n = 0
    for k in range(len(parent)):
        root = root_of(parent, k)
        if root == k:  # no member comes before it
            number[k] = n
            n += 1
        else:
            number[k] = number[root]
    return number


@njit(cache=True, nogil=True)
def _components(first: NDArray[np.int64], second: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    parent = np.arange(count).astype(np.int32)
    for k in range(len(first)):
        join(parent, first[k], second[k])
    return number_sets(parent)


def components(first: NDArray[np.int64], second: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Connected components int64 (count,) of an undirected graph, numbered by their first member.

    Args:
        first: int64 (m,), one end of each edge.
        second: int64 (m,), its other end.
        count: Number of members.

    Example:
        >>> components(np.array([3, 1]), np.array([0, 2]), 5).tolist()
        [0, 1, 1, 0, 2]
    """
    return np.asarray(
        _components(np.ascontiguousarray(first, np.int64), np.ascontiguousarray(second, np.int64), count)
    )
