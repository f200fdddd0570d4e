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
from layoutexplore.planning.tours import LEAST_GAIN, LONGEST_STRETCH, move_stretch, open_tour, reverse_stretch

_NEAR = 0.5
"""Metres added to a way in the greedy start, so that the nearest place does not win by its nearness alone."""
UNCONNECTED = 1e6
"""Metres between places that are not connected."""


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
    matrix, shares = _prepared(distances, weights, len(shorter))
    if not (np.isfinite(patience) and patience >= 0):
        raise ConfigError(f"patience must be a finite number of 0 or more, got {shortened(patience)}")
    if len(shorter) < 2:
        return shorter
    short = np.concatenate([[0], shorter])
    greedy = _greedy(matrix, shares)
    cost, greedy_cost = _improve(matrix, shares, patience, short), _improve(matrix, shares, patience, greedy)
    return (short if cost <= greedy_cost else greedy)[1:]


def _prepared(
    distances: NDArray[np.floating], weights: NDArray[np.floating], count: int
) -> tuple[Floats, Floats]:
    """Finite distances, and the share of the weight of place 0, which has none, and of all others."""
    shares = np.asarray(weights, np.float64)
    if shares.shape != (count,) or not np.isfinite(shares).all() or (shares < 0).any():
        raise ConfigError(
            f"a tour over {count} places needs as many finite weights of 0 or more, got shape {shares.shape}"
        )
    total = shares.sum()
    shares = np.concatenate([[0.0], shares / total if total > 0 else np.full(count, 1.0 / max(count, 1))])
    return np.minimum(np.asarray(distances, np.float64), UNCONNECTED), shares


def latency_cost(
    distances: NDArray[np.floating],
    weights: NDArray[np.floating],
    order: NDArray[np.integer],
    patience: float = 1.0,
) -> float:
    """The cost of a tour from place 0 over places int (n,) in this order, as `latency_tour` counts it."""
    matrix, shares = _prepared(distances, weights, len(distances) - 1)
    tour = np.concatenate([[0], order]).astype(np.int64)
    times = np.concatenate([[0.0], np.cumsum(matrix[tour[:-1], tour[1:]])])
    return float(shares[tour] @ times + patience * times[-1])


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
                # Of places without weight the nearest comes first.
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
        cheaper = _two_opt(distances, patience, tour, sums)
        if not cheaper and not _or_opt(distances, patience, tour, sums, buffer):
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
def _two_opt(distances: Floats, patience: float, tour: Ints, sums: Floats) -> bool:
    """Reverse the first stretch tour[i..j] whose reversal makes the tour cheaper; whether there was one."""
    count = len(tour)
    times, weights, latencies = sums[0], sums[1], sums[2]
    total = weights[count - 1] + patience
    for i in range(1, count - 1):
        ways_in, ways_out = distances[tour[i - 1]], distances[tour[i]]
        begun, time, weight_before, latency_before = times[i - 1], times[i], weights[i - 1], latencies[i - 1]
        for j in range(i + 1, count):
            # Walked backwards the stretch has latency W T - L, and starts when its last place is reached.
            start = begun + ways_in[tour[j]]
            end = start + times[j] - time
            late = end - times[j]
            if j + 1 < count:
                late = end + ways_out[tour[j + 1]] - times[j + 1]
            growth = (weights[j] - weight_before) * (end + time) - 2.0 * (latencies[j] - latency_before)
            if growth + late * (total - weights[j]) < -LEAST_GAIN:
                reverse_stretch(tour, i, j)
                return True
    return False


@njit(cache=True, nogil=True)
def _or_opt(distances: Floats, patience: float, tour: Ints, sums: Floats, buffer: Ints) -> bool:
    """Move the first stretch of up to three places that makes the tour cheaper; whether there was one."""
    for size in range(1, LONGEST_STRETCH + 1):
        for i in range(1, len(tour) - size + 1):
            k, backwards = _better_place(distances, patience, tour, sums, i, i + size - 1)
            if k >= 0:
                move_stretch(tour, buffer, i, size, k, backwards)
                return True
    return False


@njit(cache=True, nogil=True)
def _better_place(
    distances: Floats, patience: float, tour: Ints, sums: Floats, i: int, last: int
) -> tuple[int, bool]:
    """The first k for which tour[i..last] is better visited after tour[k], and if backwards; or -1."""
    count = len(tour)
    times, weights, latencies = sums[0], sums[1], sums[2]
    to_first, to_last = distances[tour[i]], distances[tour[last]]
    weight, duration = weights[last] - weights[i - 1], times[last] - times[i]
    # The latency within the stretch less what it was, walked forwards and backwards.
    ahead = -weight * times[i]
    back = weight * (duration + times[i]) - 2.0 * (latencies[last] - latencies[i - 1])
    # Once the stretch is gone all behind it is reached so much later (below zero: earlier), or the tour ends.
    total = weights[count - 1] + patience
    shift = times[i - 1] - times[last]
    if last + 1 < count:
        shift = times[i - 1] + distances[tour[i - 1], tour[last + 1]] - times[last + 1]
    closed = shift * (total - weights[last])
    for k in range(i - 1):
        here, then, duration_less = tour[k], tour[k + 1], duration - times[k + 1]
        pushed = total - weights[last] + weights[i - 1] - weights[k]
        start = times[k] + to_first[here]
        if ahead + closed + weight * start + pushed * (start + duration_less + to_last[then]) < -LEAST_GAIN:
            return k, False
        start = times[k] + to_last[here]
        if back + closed + weight * start + pushed * (start + duration_less + to_first[then]) < -LEAST_GAIN:
            return k, True
    for k in range(last + 1, count):
        here, pushed, between = tour[k], total - weights[k], shift * (weights[k] - weights[last])
        way_ahead, way_back, left = 0.0, 0.0, times[k]
        if k + 1 < count:
            way_ahead, way_back, left = to_last[tour[k + 1]], to_first[tour[k + 1]], times[k + 1]
        start = times[k] + shift + to_first[here]
        if ahead + between + weight * start + pushed * (start + duration + way_ahead - left) < -LEAST_GAIN:
            return k, False
        start = times[k] + shift + to_last[here]
        if back + between + weight * start + pushed * (start + duration + way_back - left) < -LEAST_GAIN:
            return k, True
    return -1, False
