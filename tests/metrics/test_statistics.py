"""Statistics against hand-computed cases and slow obvious versions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.errors import ConfigError
from layoutexplore.metrics.statistics import (
    Interval,
    cluster_bootstrap,
    cluster_means,
    improvements,
    interquartile_mean,
    log_ratios,
    weighted_interquartile_mean,
    weighted_mean,
)

numbers = st.floats(-50, 50, allow_nan=False)


def slow_interquartile_mean(values: list[float]) -> float:
    """Every value four times, so that the quartiles fall between values."""
    repeated = sorted(value for value in values for _ in range(4))
    quarter = len(repeated) // 4
    return float(np.mean(repeated[quarter : 3 * quarter]))


@given(st.lists(numbers, min_size=1, max_size=30))
def test_interquartile_mean_is_the_mean_of_the_middle_half(values: list[float]) -> None:
    assert interquartile_mean(values) == pytest.approx(slow_interquartile_mean(values), abs=1e-9)


@given(st.lists(st.tuples(numbers, st.integers(0, 4)), min_size=1, max_size=15))
def test_a_weight_is_a_repetition(pairs: list[tuple[float, int]]) -> None:
    values = [value for value, count in pairs for _ in range(count)]
    if not values:
        return
    array = np.array(pairs, np.float64)
    result = weighted_interquartile_mean(array[:, 0], array[None, :, 1])
    assert result[0] == pytest.approx(interquartile_mean(values), abs=1e-9)
    assert weighted_mean(array[:, 0], array[None, :, 1])[0] == pytest.approx(np.mean(values), abs=1e-9)


def test_outliers_do_not_move_the_interquartile_mean() -> None:
    assert interquartile_mean([-1e9, 1, 2, 3, 4, 5, 6, 1e9]) == pytest.approx(3.5)


@given(st.integers(0, 100), st.sampled_from([12, 90]))
@settings(max_examples=20, deadline=None)
def test_bootstrap_is_the_obvious_loop(seed: int, runs: int) -> None:
    rng = np.random.default_rng(seed)
    clusters = rng.integers(0, 4, runs)
    values = rng.normal(size=runs).round(1)
    names = np.unique(clusters)
    if len(names) < 2:
        return
    counts = np.random.default_rng(seed).multinomial(
        len(names), np.full(len(names), 1 / len(names)), size=200
    )
    slow = [
        interquartile_mean(
            np.concatenate([np.tile(values[clusters == n], c) for n, c in zip(names, row, strict=True)])
        )
        for row in counts
    ]
    interval = cluster_bootstrap(values, clusters, draws=200, seed=seed)
    assert interval.estimate == pytest.approx(interquartile_mean(values))
    assert (interval.low, interval.high) == pytest.approx(tuple(np.quantile(slow, [0.025, 0.975])))


def test_bootstrap_resamples_plans_not_runs() -> None:
    """A hundred copies of a run on the same plan say no more than one."""
    once = cluster_bootstrap([0.0, 1.0, 2.0], ["a", "b", "c"])
    often = cluster_bootstrap(np.repeat([0.0, 1.0, 2.0], 100), np.repeat(["a", "b", "c"], 100))
    assert once == Interval(*(pytest.approx(v) for v in (often.estimate, often.low, often.high)))


def test_bootstrap_covers_the_truth_about_as_often_as_it_says() -> None:
    rng = np.random.default_rng(7)
    hits = 0
    for trial in range(200):
        values = np.repeat(rng.normal(0, 1, 25), 3) + rng.normal(0, 0.3, 75)
        interval = cluster_bootstrap(values, np.repeat(np.arange(25), 3), draws=300, seed=trial)
        hits += interval.low <= 0 <= interval.high
    assert 0.88 <= hits / 200 <= 0.99


@pytest.mark.parametrize("count", [5, 10])
def test_bootstrap_of_many_runs_is_cut_into_blocks(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    values, clusters = np.arange(40.0), np.arange(40) % count
    whole = cluster_bootstrap(values, clusters, draws=100)
    monkeypatch.setattr("layoutexplore.metrics.statistics._BLOCK", 400)
    pieces = cluster_bootstrap(values, clusters, draws=100)
    assert (pieces.low, pieces.high) == pytest.approx((whole.low, whole.high))


def test_one_plan_has_no_interval() -> None:
    interval = cluster_bootstrap([1.0, 2.0], ["a", "a"])
    assert interval.estimate == 1.5
    assert math.isnan(interval.low) and math.isnan(interval.high)


def test_cluster_means() -> None:
    means, names = cluster_means([1, 2, 6], ["x", "x", "y"])
    assert means.tolist() == [1.5, 6.0]
    assert names.tolist() == ["x", "y"]


def test_log_ratios_are_paired() -> None:
    assert log_ratios([50, 200], [100, 100]) == pytest.approx([-math.log(2), math.log(2)])
    with pytest.raises(ConfigError, match="above 0"):
        log_ratios([0.0], [1.0])
    with pytest.raises(ConfigError, match="as many"):
        log_ratios([1.0, 2.0], [1.0])


def test_probability_of_improvement_counts_ties_half() -> None:
    assert improvements([-1, -2, 0, 3]).mean() == 0.625


@pytest.mark.parametrize("bad", [[], [math.nan], [[1.0]]])
def test_bad_samples(bad: list[float]) -> None:
    with pytest.raises(ConfigError, match="finite"):
        interquartile_mean(bad)


def test_values_without_clusters() -> None:
    with pytest.raises(ConfigError, match="as many clusters"):
        cluster_bootstrap([1.0, 2.0], ["a"])


def test_a_fault_of_a_statistic_of_ones_own_stays_one() -> None:
    """Names of clusters were blamed for it: "clusters must be ArrayLike"."""

    def own(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
        raise KeyError("mine")

    for clusters in (["a", "b"], ("a", "b"), np.array(["a", "b"])):
        with pytest.raises(KeyError, match="mine"):
            cluster_bootstrap([1.0, 2.0], clusters, own)


@pytest.mark.parametrize("statistic", [weighted_mean, weighted_interquartile_mean])
def test_weights_fit_the_values(statistic) -> None:
    for values, weights in (
        ([], np.ones((1, 0))),
        ([1.0], np.ones(1)),
        ([1.0, 2.0], np.ones((1, 3))),
        (3.0, 2.0),
    ):
        with pytest.raises(ConfigError):
            statistic(np.asarray(values), np.asarray(weights))


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"draws": 0}, "draws must be a whole number of at least 1, got 0"),
        ({"draws": 2.5}, "draws must be a whole number of at least 1, got 2.5"),
        ({"seed": -1}, "seed must be a whole number, 0 or more, got -1"),
        ({"confidence": 95}, "confidence must be above 0 and below 1 (0.95), got 95"),
        ({"confidence": math.nan}, "confidence must be above 0 and below 1 (0.95), got nan"),
    ],
)
def test_draws_and_confidence_are_checked(wrong: dict[str, float], said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        cluster_bootstrap([1.0, 2.0], ["a", "b"], **wrong)
    assert str(caught.value) == said
