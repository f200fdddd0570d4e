"""Short open tours: from a fixed start over all places, ending anywhere.

Greedy construction (always the nearest place not visited yet), then 2-opt (reverse a stretch, its tail
included: the end is free) and Or-opt (move a stretch of up to three places elsewhere, either way round) until
neither shortens the tour. Everything is deterministic: the first improving move in a fixed order is made.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError
from layoutexplore.grids.arrays import Floats, Ints

LEAST_GAIN = 1e-6
"""A move must save more than this many metres, so that rounding cannot make the search run in circles."""

LONGEST_STRETCH = 3
"""So many places Or-opt moves at most."""


def open_tour(distances: NDArray[np.floating]) -> Ints:
    """The order in which to visit all places, starting at place 0.

    Args:
        distances: float (n + 1, n + 1), symmetric, in metres; pairs that are not connected may be inf.

    Returns:
        int64 (n,): a permutation of 1..n.

    Raises:
        ConfigError: The matrix is not square or has no place 0.

    Example:
        >>> position = np.array([0.0, 7.0, -1.0, 3.0])
        >>> open_tour(abs(position[:, None] - position)).tolist()
        [2, 3, 1]
    """
    matrix = _checked(distances)
    tour = construct(matrix)
    improve(matrix, tour)
    return tour[1:]


def improve_tour(distances: NDArray[np.floating], order: NDArray[np.integer]) -> Ints:
    """A tour at least as short as a given one, by 2-opt and Or-opt.

    Args:
        distances: float (n + 1, n + 1), as for `open_tour`.
        order: int (n,), a permutation of 1..n.

    Returns:
        int64 (n,): a permutation of 1..n.
    """
    matrix = _checked(distances)
    if sorted(order) != list(range(1, len(matrix))):
        raise ConfigError(
            f"a tour over {len(matrix) - 1} places must be a permutation of 1..{len(matrix) - 1}"
        )
    tour = np.concatenate([[0], order]).astype(np.int64)
    improve(matrix, tour)
    return tour[1:]


def tour_length(distances: NDArray[np.floating], order: NDArray[np.integer]) -> float:
    """Length in metres of the tour from place 0 through the places in this order."""
    tour = np.concatenate([[0], order]).astype(np.int64)
    return float(np.asarray(distances, np.float64)[tour[:-1], tour[1:]].sum())


def _checked(distances: NDArray[np.floating]) -> Floats:
    """The matrix as contiguous float64; unconnected pairs become longer than any tour over connected ones."""
    matrix = np.array(distances, np.float64, order="C")
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or len(matrix) == 0:
        raise ConfigError(f"a tour needs a square matrix of distances, got shape {matrix.shape}")
    finite = np.isfinite(matrix)
    if not finite.all():
        matrix[~finite] = 1.0 + 2.0 * matrix[finite].sum()
    return matrix


@njit(cache=True, nogil=True)
def construct(distances: Floats) -> Ints:
    """The tour int64 (n + 1,) from place 0 always on to the nearest place left, of equals the first.

    The matrix float64 (n + 1, n + 1) is finite.
    """
    count = len(distances)
    tour = np.zeros(count, np.int64)
    left = np.ones(count, np.bool_)
    left[0] = False
    here = 0
    for k in range(1, count):
        best = -1
        for place in range(1, count):
            if left[place] and (best < 0 or distances[here, place] < distances[here, best]):
                best = place
        tour[k] = best
        left[best] = False
        here = best
    return tour


@njit(cache=True, nogil=True)
def improve(distances: Floats, tour: Ints) -> None:
    """Apply 2-opt and Or-opt to a tour int64 (n + 1,) in place until neither finds a shorter one."""
    buffer = np.empty_like(tour)
    while _two_opt(distances, tour) or _or_opt(distances, tour, buffer):
        pass


@njit(cache=True, nogil=True)
def _two_opt(distances: Floats, tour: Ints) -> bool:
    """One pass that reverses every segment tour[i..j] whose reversal saves metres; whether there was one."""
    count = len(tour)
    improved = False
    for i in range(1, count - 1):
        for j in range(i + 1, count):
            before = distances[tour[i - 1], tour[i]]
            after = distances[tour[i - 1], tour[j]]
            # The tour is open: behind its last place no leg is replaced.
            if j + 1 < count:
                before += distances[tour[j], tour[j + 1]]
                after += distances[tour[i], tour[j + 1]]
            if after < before - LEAST_GAIN:
                reverse_stretch(tour, i, j)
                improved = True
    return improved


@njit(cache=True, nogil=True)
def reverse_stretch(tour: Ints, first: int, last: int) -> None:
    """Turn tour[first], ..., tour[last] around."""
    # Slices would do, but numba's text about those that do not fit takes seconds to compile.
    while first < last:
        tour[first], tour[last] = tour[last], tour[first]
        first += 1
        last -= 1


@njit(cache=True, nogil=True)
def _or_opt(distances: Floats, tour: Ints, buffer: Ints) -> bool:
    """Move the first stretch of up to three places whose move saves metres; whether there was one."""
    count = len(tour)
    for size in range(1, LONGEST_STRETCH + 1):
        for i in range(1, count - size + 1):
            first, last = tour[i], tour[i + size - 1]
            saved = distances[tour[i - 1], first]
            if i + size < count:
                saved += distances[last, tour[i + size]] - distances[tour[i - 1], tour[i + size]]
            for k in range(count):
                if i - 1 <= k < i + size:
                    continue
                # Between tour[k] and its successor, or behind the last place.
                forward, backward = distances[tour[k], first], distances[tour[k], last]
                if k + 1 < count:
                    after = tour[k + 1]
                    forward += distances[last, after] - distances[tour[k], after]
                    backward += distances[first, after] - distances[tour[k], after]
                if min(forward, backward) < saved - LEAST_GAIN:
                    move_stretch(tour, buffer, i, size, k, backward < forward)
                    return True
    return False


@njit(cache=True, nogil=True)
def move_stretch(tour: Ints, buffer: Ints, start: int, size: int, behind: int, backwards: bool) -> None:
    """Take tour[start : start + size] out and put it in behind position `behind`, which lies outside it."""
    n = 0
    for k in range(len(tour)):
        if not start <= k < start + size:
            buffer[n] = tour[k]
            n += 1
        if k == behind:
            for m in range(size):
                buffer[n] = tour[start + size - 1 - m] if backwards else tour[start + m]
                n += 1
    for k in range(n):
        tour[k] = buffer[k]
