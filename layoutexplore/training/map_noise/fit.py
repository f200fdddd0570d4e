"""Fitting the noise of simulated maps to real ones without truth, and a classifier of the two as the check.

Rejection: maps are simulated with noise from wide ranges, and those whose statistics are among the nearest to
any real map's stay; the ranges that most of them were drawn from are the fitted ones. How well the maps that
come of it pass for real says the area under the ROC curve of a forest that tells them apart by the same
statistics, on buildings it was not trained on: 1 is a map that betrays itself, 0.5 one that does not.

References:
    Beaumont et al. 2002, "Approximate Bayesian Computation in Population Genetics", section "Rejection".
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from layoutexplore.errors import ConfigError, LayoutExploreError
from layoutexplore.grids.arrays import Floats
from layoutexplore.maps.library import cached_plan
from layoutexplore.training.folds import Progress, silent
from layoutexplore.training.map_noise.simulate import MapNoise, MapNoiseConfig, NoisyMap, simulate_map
from layoutexplore.training.map_noise.statistics import MapStatistics, describe_grid, statistics_table

LARGEST = 4000.0
"""Plans with a larger box are left out [m2]: real maps of that size are rare."""

KEPT_QUANTILES = (0.1, 0.9)
"""A fitted range reaches from one of these quantiles of what was kept to the other."""

FEWEST = 10
"""Maps on either side below which nothing is fitted or told apart."""


@dataclass(frozen=True, eq=False)
class SimulatedMaps:
    """Maps with what they were made of.

    Attributes:
        maps: The maps.
        buildings: The building of each.
    """

    maps: tuple[NoisyMap, ...]
    buildings: tuple[str, ...]

    def statistics(self) -> Floats:
        """float64 (maps, statistics)."""
        return statistics_table([describe_grid(one.cells, one.resolution) for one in self.maps])

    def noise(self) -> Floats:
        """float64 (maps, numbers of `MapNoise`)."""
        return np.array([one.noise for one in self.maps], np.float64).reshape(-1, len(MapNoise._fields))


def simulate_maps(
    plans: Sequence[str], config: MapNoiseConfig, count: int, *, seed: int = 0, progress: Progress = silent
) -> SimulatedMaps:
    """Maps of floor plans in turn; those where no robot fits or that are too large are left out.

    Args:
        plans: What `load_plan` knows.
        config: Ranges of the noise.
        count: Maps to try.
        seed: Of the noise.
        progress: Told of the maps made.
    """
    maps, buildings = [], []
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        try:
            plan = cached_plan(plans[k % len(plans)])
            made = simulate_map(plan, MapNoise.draw(config, rng), rng, largest=LARGEST)
            if made is not None:
                describe_grid(made.cells, made.resolution)
        except LayoutExploreError:
            made = None
        if made is not None:
            maps.append(made)
            buildings.append(plan.building)
        progress("maps simulated", k + 1, count)
    return SimulatedMaps(tuple(maps), tuple(buildings))


def standardised(table: Floats, real: Floats) -> Floats:
    """Statistics in units of their spread over the real maps, counts and lengths by their logarithm."""
    logs, real_logs = np.log1p(table), np.log1p(real)
    spread = np.maximum(real_logs.std(axis=0), 1e-6)
    return np.asarray((logs - real_logs.mean(axis=0)) / spread)


def fit_noise(real: Floats, simulated: SimulatedMaps, config: MapNoiseConfig, keep: float) -> MapNoiseConfig:
    """The ranges of noise that the maps nearest to real ones were made with.

    Args:
        real: float64 (n, statistics) of real maps.
        simulated: Maps made with `config`.
        config: Wide ranges.
        keep: Each real map keeps the simulated ones nearest to it, a tenth of this share of all, 0..1.

    Raises:
        ConfigError: Too few maps.
    """
    check_counts(len(real), len(simulated.maps))
    ours, theirs = standardised(simulated.statistics(), real), standardised(real, real)
    # each real map calls the simulated ones nearest to it, so that the kept ones cover all kinds
    distance = np.sqrt(((ours[:, None] - theirs[None]) ** 2).sum(axis=2))
    each = max(round(keep * len(ours) / 10), 1)
    called = np.bincount(np.argsort(distance, axis=0)[:each].ravel(), minlength=len(ours)).astype(np.float64)
    noise = simulated.noise()
    ranges = {}
    for k, name in enumerate(MapNoise._fields):
        order = np.argsort(noise[:, k])
        share = np.cumsum(called[order]) / called.sum()
        low, high = (float(noise[order[np.searchsorted(share, q)], k]) for q in KEPT_QUANTILES)
        ranges[name] = (round(low, 4), round(high, 4))
    return dataclasses.replace(config, **ranges)


def told_apart(real: Floats, real_groups: Sequence[str], simulated: SimulatedMaps) -> float:
    """Area under the ROC curve of a forest that tells real from simulated maps, cross-validated by building.

    NaN where all maps of either kind are of one building: held out, the forest would not know that kind.

    Args:
        real: float64 (n, statistics) of real maps.
        real_groups: The building of each, as far as it is known.
        simulated: Simulated maps.

    Raises:
        ConfigError: Too few maps.
    """
    from sklearn.ensemble import RandomForestClassifier
    from sklearn.metrics import roc_auc_score
    from sklearn.model_selection import StratifiedGroupKFold, cross_val_predict

    check_counts(len(real), len(simulated.maps))
    if min(len({*real_groups}), len({*simulated.buildings})) < 2:
        return float("nan")
    table = standardised(np.vstack([real, simulated.statistics()]), real)
    truth = np.arange(len(table)) < len(real)
    groups = [*(f"real {name}" for name in real_groups), *(f"plan {name}" for name in simulated.buildings)]
    forest = RandomForestClassifier(
        60, max_depth=5, min_samples_leaf=3, class_weight="balanced", random_state=0
    )
    folds = StratifiedGroupKFold(min(5, len({*groups})), shuffle=True, random_state=0)
    odds = cross_val_predict(forest, table, truth, groups=groups, cv=folds, method="predict_proba")[:, 1]
    return float(roc_auc_score(truth, odds))


def check_counts(real: int, simulated: int) -> None:
    """Raise `ConfigError` where there are too few maps to fit noise to, or to tell two kinds apart."""
    if min(real, simulated) < FEWEST:
        more = "" if simulated >= FEWEST else "; --count N tries more, of --plans where a robot fits in"
        raise ConfigError(
            f"at least {FEWEST} maps of each kind are needed: {real} real, {simulated} simulated{more}"
        )


def covered(real: Floats, simulated: Floats) -> dict[str, float]:
    """Share of the real maps whose statistic lies between the 5 % and 95 % quantiles of simulated ones."""
    names = [f.name for f in dataclasses.fields(MapStatistics)]
    low, high = np.quantile(simulated, [0.05, 0.95], axis=0)
    return dict(zip(names, ((real >= low) & (real <= high)).mean(axis=0).tolist(), strict=True))
