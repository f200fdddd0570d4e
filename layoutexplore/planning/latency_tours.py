"""Open tours that are short and come early to where much is to be gained.

A short tour finishes well and starts badly, a greedy choice the other way round. Between them lies the
travelling repairman (minimum latency) problem: with t_i the metres walked until place i is reached and w_i
its share of the weight, minimise

    sum_i w_i t_i + patience * (length of the tour).

With much patience this is the shortest tour; with none, the mean way to a unit of weight. Two tours to start
from, a short one and a greedy one, are improved by 2-opt and Or-opt; prefix sums over a tour give the cost of
every move in constant time (a stretch of duration T, weight W and latency L has latency W T - L when it is
walked backwards).
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError, shortened
from layoutexplore.grids.arrays import Floats, Ints
from layoutexplore.planning.tours import move_stretch, open_tour

_GAIN = 1e-6
"""A move must save more than this, so that rounding cannot make the search run in circles."""
_LONGEST_STRETCH = 3
_NEAR = 0.5
"""Metres added to a way in the greedy start, so that the nearest place does not win by its nearness alone."""
_UNCONNECTED = 1e6


def latency_tour(
    distances: NDArray[np.floating], weights: NDArray[np.floating], patience: float = 1.0
) -> Ints:
    """The order in which to visit all places, starting at place 0.

    Args:
        distances: float (n + 1, n + 1), symmetric, in metres; pairs that are not connected may be inf.
        weights: float (n,), what each of the places 1..n is worth, 0 or more; equal when all are 0.
        patience: Weight of the tour's length against the mean latency.

    Returns:
        int64 (n,): a permutation of 1..n.

    Raises:
        ConfigError: The matrix is not square, the weights do not fit, or a number makes no sense.

    Example:
        >>> position = np.array([0.0, 7.0, -1.0, 3.0])
        >>> distances = abs(position[:, None] - position)
        >>> latency_tour(distances, np.array([1.0, 1.0, 1.0])).tolist()
        [2, 3, 1]
        >>> latency_tour(distances, np.array([9.0, 0.1, 1.0]), patience=0.1).tolist()
        [3, 1, 2]
    """
    shorter = open_tour(distances)
    count = len(shorter)
    shares = np.asarray(weights, np.float64)
    if shares.shape != (count,) or not np.isfinite(shares).all() or (shares < 0).any():
        raise ConfigError(
            f"a tour over {count} places needs as many finite weights of 0 or more, got shape {shares.shape}"
        )
    if not (np.isfinite(patience) and patience >= 0):
        raise ConfigError(f"patience must be a finite number of 0 or more, got {shortened(patience)}")
    if count < 2:
        return shorter
    total = shares.sum()
    shares = np.concatenate([[0.0], shares / total if total > 0 else np.full(count, 1.0 / count)])
    matrix = np.minimum(np.asarray(distances, np.float64), _UNCONNECTED)
    short = np.concatenate([[0], shorter])
    greedy = _greedy(matrix, shares)
    cost, greedy_cost = _improve(matrix, shares, patience, short), _improve(matrix, shares, patience, greedy)
    return (short if cost <= greedy_cost else greedy)[1:]


def latency_cost(
    distances: NDArray[np.floating],
    weights: NDArray[np.floating],
    order: NDArray[np.integer],
    patience: float = 1.0,
) -> float:
    """The cost of a tour from place 0 over places int (n,) in this order; see `latency_tour`."""
    tour = np.concatenate([[0], order]).astype(np.int64)
    times = np.cumsum(np.asarray(distances, np.float64)[tour[:-1], tour[1:]])
    shares = np.asarray(weights, np.float64)[tour[1:] - 1]
    return float((shares / shares.sum()) @ times + patience * times[-1])


@njit(cache=True, nogil=True)
def _greedy(distances: Floats, shares: Floats) -> Ints:
    """int64 (n + 1,): from place 0 always on to where the most weight waits per metre."""
    count = len(distances)
    tour = np.zeros(count, np.int64)
    left = np.ones(count, np.bool_)
    left[0] = False
    here = 0
    for k in range(1, count):
        best, rate = -1, -1.0
        for place in range(1, count):
            if left[place]:
                value = (shares[place] + 1e-6) / (distances[here, place] + _NEAR)
                if value > rate:
                    best, rate = place, value
        tour[k] = best
        left[best] = False
        here = best
    return tour


@njit(cache=True, nogil=True)
def _improve(distances: Floats, shares: Floats, patience: float, tour: Ints) -> float:
    """Apply 2-opt and Or-opt in place until neither finds a cheaper tour; its cost."""
    sums = np.zeros((3, len(tour)))
    buffer = np.empty_like(tour)
    cost = _sum_up(distances, shares, patience, tour, sums)
    while True:
        cheaper = _two_opt(distances, patience, tour, sums, cost)
        if not cheaper:
            cheaper = _or_opt(distances, patience, tour, sums, cost, buffer)
        if not cheaper:
            return cost
        cost = _sum_up(distances, shares, patience, tour, sums)


@njit(cache=True, nogil=True)
def _sum_up(distances: Floats, shares: Floats, patience: float, tour: Ints, sums: Floats) -> float:
    """Fill the rows of sums: arrival times, and weights and latencies up to each place; the tour's cost."""
    for k in range(1, len(tour)):
        sums[0, k] = sums[0, k - 1] + distances[tour[k - 1], tour[k]]
        sums[1, k] = sums[1, k - 1] + shares[tour[k]]
        sums[2, k] = sums[2, k - 1] + shares[tour[k]] * sums[0, k]
    cost: float = sums[2, -1] + patience * sums[0, -1]
    return cost


@njit(cache=True, nogil=True)
def _append(
    distances: Floats,
    tour: Ints,
    sums: Floats,
    end: tuple[int, float, float],
    first: int,
    last: int,
    backwards: bool,
) -> tuple[int, float, float]:
    """A path (last place, metres, latency) that goes on over tour[first..last]; that may be empty."""
    if first > last:
        return end
    entry, leave = (tour[last], tour[first]) if backwards else (tour[first], tour[last])
    weight = sums[1, last] - sums[1, first - 1]
    duration = sums[0, last] - sums[0, first]
    latency = sums[2, last] - sums[2, first - 1] - weight * sums[0, first]
    if backwards:
        latency = weight * duration - latency
    start = end[1] + distances[end[0], entry]
    return leave, start + duration, end[2] + latency + weight * start


@njit(cache=True, nogil=True)
def _two_opt(distances: Floats, patience: float, tour: Ints, sums: Floats, cost: float) -> bool:
    """Reverse the first stretch whose reversal makes the tour cheaper; whether there was one."""
    count = len(tour)
    for i in range(1, count - 1):
        begun = (tour[i - 1], sums[0, i - 1], sums[2, i - 1])
        for j in range(i + 1, count):
            end = _append(distances, tour, sums, begun, i, j, True)
            end = _append(distances, tour, sums, end, j + 1, count - 1, False)
            if end[2] + patience * end[1] < cost - _GAIN:
                tour[i : j + 1] = tour[i : j + 1][::-1].copy()
                return True
    return False


@njit(cache=True, nogil=True)
def _or_opt(distances: Floats, patience: float, tour: Ints, sums: Floats, cost: float, buffer: Ints) -> bool:
    """Move the first stretch of up to three places that makes the tour cheaper; whether there was one."""
    count = len(tour)
    for size in range(1, _LONGEST_STRETCH + 1):
        for i in range(1, count - size + 1):
            last = i + size - 1
            for k in range(count):
                if i - 1 <= k <= last:
                    continue
                # The stretch goes between tour[k] and what follows it: what lies between moves up or down.
                for backwards in (False, True):
                    if k < i:
                        end = _append(
                            distances, tour, sums, (tour[k], sums[0, k], sums[2, k]), i, last, backwards
                        )
                        end = _append(distances, tour, sums, end, k + 1, i - 1, False)
                        end = _append(distances, tour, sums, end, last + 1, count - 1, False)
                    else:
                        end = (tour[i - 1], sums[0, i - 1], sums[2, i - 1])
                        end = _append(distances, tour, sums, end, last + 1, k, False)
                        end = _append(distances, tour, sums, end, i, last, backwards)
                        end = _append(distances, tour, sums, end, k + 1, count - 1, False)
                    if end[2] + patience * end[1] < cost - _GAIN:
                        move_stretch(tour, buffer, i, size, k, backwards)
                        return True
    return False
