"""Paired comparisons over buildings: interquartile mean, cluster bootstrap, probability of improvement.

Runs in one building resemble each other, on all its floors, so the building, not the run or the floor, is
what is resampled: every draw takes as many buildings as there are, with replacement, and all runs in each one
drawn. A draw is then nothing but integer weights on the runs, which makes ten thousand draws a few array
operations.

References:
    Agarwal et al. 2021, "Deep Reinforcement Learning at the Edge of the Statistical Precipice" (interquartile
    mean, probability of improvement); Field and Welsh 2007, "Bootstrapping clustered data".
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from layoutexplore.errors import ConfigError, cause, checks_arguments, shortened

DRAWS = 10_000
"""Bootstrap draws."""

CONFIDENCE = 0.95
"""Coverage of the intervals."""

_BLOCK = 2_000_000  # weights held at a time, in numbers

Floats = NDArray[np.float64]
WeightedStatistic = Callable[[Floats, Floats], Floats]
"""(values (n,), weights (m, n)) -> (m,): the statistic of the values under each row of weights."""


@dataclass(frozen=True)
class Interval:
    """An estimate with its confidence interval; the ends are NaN where there are fewer than two clusters.

    Example:
        >>> f"{Interval(0.861, 0.82, 0.9):.2f}, {Interval(0.9, math.nan, math.nan):.2f}"
        '0.86 (0.82-0.90), 0.90'
    """

    estimate: float
    low: float
    high: float

    def __format__(self, spec: str) -> str:
        """Each number by the format of one; the estimate alone where there is no interval."""
        ends = f" ({self.low:{spec}}-{self.high:{spec}})" if math.isfinite(self.low) else ""
        return f"{self.estimate:{spec}}{ends}"

    def map(self, function: Callable[[float], float]) -> Interval:
        """The interval under a rising function, such as `math.exp`."""
        return Interval(function(self.estimate), function(self.low), function(self.high))

    @property
    def ends(self) -> tuple[float, float]:
        """Where a whisker begins and ends: at the estimate itself where there is no interval."""
        low, high = (end if math.isfinite(end) else self.estimate for end in (self.low, self.high))
        return low, high

    def as_columns(self, name: str) -> dict[str, float]:
        """The estimate under a name, its ends under NAME_low and NAME_high."""
        return {name: self.estimate, f"{name}_low": self.low, f"{name}_high": self.high}


NO_INTERVAL = Interval(math.nan, math.nan, math.nan)
"""That of no value."""


@checks_arguments
def interquartile_mean(values: ArrayLike) -> float:
    """Mean of the middle half of the values; the values at the quartiles count by the part that lies inside.

    Example:
        >>> interquartile_mean([1, 2, 3, 100])
        2.5
        >>> interquartile_mean([1.0, 4.0])
        2.5
    """
    sample = _sample(values)
    return float(weighted_interquartile_mean(sample, np.ones((1, len(sample))))[0])


@checks_arguments
def weighted_interquartile_mean(values: Floats, weights: Floats) -> Floats:
    """Interquartile mean under each row of weights.

    Args:
        values: float64 (n,).
        weights: float64 (m, n), not negative, no row all zero. A weight of 2 is the value twice.

    Returns:
        float64 (m,).

    Raises:
        ConfigError: No values, or weights of another shape.
    """
    values, weights = _weighted(values, weights)
    order = np.argsort(values, kind="stable")
    upper = np.take(weights, order, axis=1)
    np.cumsum(upper, axis=1, out=upper)
    low, high = 0.25 * upper[:, -1:], 0.75 * upper[:, -1:]
    np.clip(upper, low, high, out=upper)
    inside = np.empty_like(upper)
    np.subtract(upper[:, :1], low, out=inside[:, :1])
    np.subtract(upper[:, 1:], upper[:, :-1], out=inside[:, 1:])
    return np.asarray(inside @ values[order] / (high - low)[:, 0])


@checks_arguments
def weighted_mean(values: Floats, weights: Floats) -> Floats:
    """Mean under each row of weights, float64 (m,); arguments as of `weighted_interquartile_mean`."""
    values, weights = _weighted(values, weights)
    return np.asarray(weights @ values / weights.sum(axis=1))


@checks_arguments
def cluster_bootstrap(
    values: ArrayLike,
    clusters: Collection[Any],
    statistic: WeightedStatistic = weighted_interquartile_mean,
    *,
    draws: int = DRAWS,
    confidence: float = CONFIDENCE,
    seed: int = 0,
) -> Interval:
    """A statistic of the values with a percentile interval from resampling whole clusters.

    Args:
        values: float (n,), one a run.
        clusters: (n,), anything that tells clusters apart: the buildings' names.
        statistic: What is estimated.
        draws: Number of bootstrap draws, at least 1.
        confidence: Of the interval, above 0 and below 1.
        seed: Of the draws, 0 or more.

    Raises:
        ConfigError: No values, values and clusters of different length, no draws, a seed below 0, or a
            confidence that is not above 0 and below 1.

    Example:
        >>> cluster_bootstrap([0.0, 0.0, 1.0, 1.0], ["a", "a", "b", "b"], seed=1)
        Interval(estimate=0.5, low=0.0, high=1.0)
    """
    if not (isinstance(draws, (int, np.integer)) and draws >= 1):
        raise ConfigError(f"draws must be a whole number of at least 1, got {shortened(draws)}")
    if not (isinstance(confidence, (int, float, np.floating)) and 0 < confidence < 1):
        raise ConfigError(f"confidence must be above 0 and below 1 (0.95), got {shortened(confidence)}")
    if not (isinstance(seed, (int, np.integer)) and seed >= 0):
        raise ConfigError(f"seed must be a whole number, 0 or more, got {shortened(seed)}")
    sample, names, member = _clustered(values, clusters)
    estimate = float(statistic(sample, np.ones((1, len(sample))))[0])
    if len(names) < 2:
        return Interval(estimate, float("nan"), float("nan"))
    counts = _drawn(len(names), draws, seed)
    # Looking a quartile up takes as many looks at all clusters as the number of values has digits, base 2.
    by_cluster = len(names) * len(sample).bit_length() < len(sample)
    by_cluster = by_cluster and len(names) * len(sample) <= _BLOCK
    by_cluster = by_cluster and statistic is weighted_interquartile_mean

    def of_draws(counts: Floats) -> Floats:
        if by_cluster:
            return _interquartile_means_of_clusters(sample, member, counts)
        return statistic(sample, np.take(counts, member, axis=1))

    block = max(1, _BLOCK // (len(names) if by_cluster else len(sample)))
    drawn = np.concatenate([of_draws(counts[k : k + block]) for k in range(0, draws, block)])
    tail = (1 - confidence) / 2
    low, high = np.quantile(drawn, [tail, 1 - tail])
    return Interval(estimate, float(low), float(high))


def _interquartile_means_of_clusters(sample: Floats, member: NDArray[np.intp], counts: Floats) -> Floats:
    """Interquartile means float64 (m,) where all values of a cluster have the same weight.

    What lies below a value is then a sum over clusters, so that the quartiles of a draw are found without a
    weight for each value.

    Args:
        sample: float64 (n,), the values.
        member: int (n,), the cluster of each.
        counts: float64 (m, k), the weight of each cluster.
    """
    order = np.argsort(sample, kind="stable")
    ordered = sample[order]
    of_cluster = member[order][:, None] == np.arange(counts.shape[1])
    # (n, k): how many values of a cluster there are up to each one, and their sum.
    number, total = (
        np.cumsum(of_cluster, axis=0, dtype=np.float64),
        np.cumsum(of_cluster * ordered[:, None], axis=0),
    )
    whole = counts @ number[-1]

    def below(quantile: Floats) -> Floats:
        """Sum of the values up to a weight of this much."""
        first, last = np.zeros(len(counts), np.intp), np.full(len(counts), len(ordered) - 1)
        while np.any(first < last):  # the first value up to which there is as much
            middle = (first + last) // 2
            enough = np.einsum("ij,ij->i", counts, number[middle]) >= quantile
            first, last = np.where(enough, first, middle + 1), np.where(enough, middle, last)
        weight, value = (np.einsum("ij,ij->i", counts, table[first]) for table in (number, total))
        return np.asarray(value - (weight - quantile) * ordered[first])

    return np.asarray((below(0.75 * whole) - below(0.25 * whole)) / (0.5 * whole))


@functools.lru_cache(maxsize=8)
def _drawn(clusters: int, draws: int, seed: int) -> Floats:
    """How often each cluster is drawn in each draw, float64 (draws, clusters), not to be written to."""
    counts = np.random.default_rng(seed).multinomial(clusters, np.full(clusters, 1 / clusters), size=draws)
    weights = counts.astype(np.float64)
    weights.flags.writeable = False
    return weights


@checks_arguments
def cluster_means(values: ArrayLike, clusters: Collection[Any]) -> tuple[Floats, NDArray[np.generic]]:
    """Mean of the values of each cluster, float64 (k,), and the clusters' names, sorted.

    Raises:
        ConfigError: No values, or values and clusters of different length.

    Example:
        >>> cluster_means([1.0, 3.0, 5.0], ["b", "b", "a"])[0].tolist()
        [5.0, 2.0]
    """
    sample, names, member = _clustered(values, clusters)
    return np.bincount(member, weights=sample) / np.bincount(member), names


@checks_arguments
def log_ratios(values: ArrayLike, baseline: ArrayLike) -> Floats:
    """ln(value / baseline) of pairs, float64 (n,): below 0 where the value is smaller.

    Raises:
        ConfigError: Different lengths, or a number that is not above 0.
    """
    a, b = np.asarray(values, np.float64), np.asarray(baseline, np.float64)
    if a.shape != b.shape:
        raise ConfigError(f"pairs need as many values as baselines, got {a.shape} and {b.shape}")
    if not (np.all(a > 0) and np.all(b > 0)):
        raise ConfigError("ratios need numbers above 0")
    return np.log(a) - np.log(b)


@checks_arguments
def improvements(differences: ArrayLike) -> Floats:
    """1 where a paired difference is below 0 (better), 0.5 where it is 0, else 0.

    Its mean is the probability of improvement: the chance of beating the baseline on a cell drawn at random.

    Example:
        >>> improvements([-0.1, 0.0, 0.2]).tolist()
        [1.0, 0.5, 0.0]
    """
    sample = np.asarray(differences, np.float64)
    return np.asarray((sample < 0) + 0.5 * (sample == 0), np.float64)


def _clustered(
    values: ArrayLike, clusters: Collection[Any]
) -> tuple[Floats, NDArray[np.generic], NDArray[np.intp]]:
    """The values, the clusters' names, sorted, and the number of each value's cluster."""
    sample = _sample(values)
    try:
        names, member = np.unique(np.asarray(clusters), return_inverse=True)
    except (TypeError, ValueError) as error:  # what has no order, rows of different lengths
        raise ConfigError(f"clusters are names or numbers, one a value: {cause(error)}") from error
    if member.shape != sample.shape:
        raise ConfigError(f"{len(sample)} values need as many clusters, got {shortened(clusters)}")
    return sample, names, member


def _weighted(values: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """Values float64 (n,) and their weights float64 (m, n); raises `ConfigError` where they do not fit."""
    sample, rows = _sample(values), np.asarray(weights, np.float64)
    if rows.ndim != 2 or rows.shape[1] != len(sample):
        raise ConfigError(f"{len(sample)} values need weights (m, {len(sample)}), got shape {rows.shape}")
    return sample, rows


def _sample(values: ArrayLike) -> Floats:
    sample = np.asarray(values, np.float64)
    if sample.ndim != 1 or len(sample) == 0 or not np.all(np.isfinite(sample)):
        raise ConfigError("statistics need a non-empty list of finite numbers")
    return sample
