"""Agents that score every frontier by itself and go to the best.

The gain of a frontier is A, the unknown area that rays from its viewpoint would cross; its cost is the path
length d. To *finish* an exploration the total gain is fixed, so agents that chase gain can lose to the
nearest frontier.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from layoutexplore.agents.base import Heuristic, OptionsT, register
from layoutexplore.frontiers.decision import Choice, Decision
from layoutexplore.frontiers.tour_features import sizeable_frontiers
from layoutexplore.options import Options, option

_TIE = 1e-9
"""Scores that differ by less than this share of the largest one are equal."""


@dataclass(frozen=True, kw_only=True)
class GreedyOptions(Options):
    """What every greedy agent can be told."""

    min_size: float = option(0.4, "metres; smaller frontiers wait until no other is left", low=0.0)


@dataclass(frozen=True, kw_only=True)
class NearestOptions(GreedyOptions):
    """Parameters of `Nearest`. Frontiers of 1 m and more first: 7 % shorter than with 0.4 m at 95 % coverage."""

    min_size: float = option(1.0, "metres; smaller frontiers wait until no other is left", low=0.0)
    distance: str = option("path", "path or straight: which distance counts", choices=("path", "straight"))


@dataclass(frozen=True, kw_only=True)
class CostUtilityOptions(GreedyOptions):
    """Parameters of `CostUtility`."""

    alpha: float = option(0.5, "weight of the distance; the gain has the rest", low=0.0, high=1.0)


@dataclass(frozen=True, kw_only=True)
class GainExpOptions(GreedyOptions):
    """Parameters of `GainExp`."""

    rate: float = option(0.2, "lambda in 1/m: how fast far gains fade", low=0.0)


@dataclass(frozen=True, kw_only=True)
class DistanceAdvantageOptions(GreedyOptions):
    """Parameters of `DistanceAdvantage`."""

    min_size: float = option(1.0, "metres; smaller frontiers wait until no other is left", low=0.0)
    weight: float = option(0.5, "how much remoteness from the other frontiers counts", low=0.0)


def best_index(scores: NDArray[np.float64], path_lengths: NDArray[np.float64]) -> int:
    """The index of the greatest score; of equal ones the nearest, of equally near ones the first.

    Args:
        scores: float64 (k,); those within a share of 1e-9 of the largest magnitude of the best are equal to
            it.
        path_lengths: float64 (k,), in metres.

    Example:
        >>> best_index(np.array([1.0, 3.0, 3.0 + 1e-12]), np.array([5.0, 4.0, 6.0]))
        1
    """
    tied = np.flatnonzero(scores >= scores.max() - _TIE * np.abs(scores).max())
    return int(tied[np.argmin(path_lengths[tied])])


class Greedy(Heuristic[OptionsT]):
    """Goes to the sizeable frontier with the highest score."""

    def choose(self, decision: Decision) -> Choice:
        """The index of the best frontier."""
        chosen = sizeable_frontiers(decision, getattr(self.options, "min_size", 0.0))
        lengths = np.array([decision.frontiers[i].path_length for i in chosen], np.float64)
        return int(chosen[best_index(self.scores(decision, chosen, lengths), lengths)])

    def scores(
        self, decision: Decision, chosen: NDArray[np.int64], lengths: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Scores float64 (k,) of the chosen frontiers int64 (k,) whose paths have these lengths in metres."""
        raise NotImplementedError


class Random(Heuristic[Options]):
    """Any frontier with the same probability."""

    def __init__(self, name: str, options: Options) -> None:
        super().__init__(name, options)
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Begin a new run with the random stream of this seed."""
        self._rng = np.random.default_rng(seed)

    def choose(self, decision: Decision) -> Choice:
        """A random index."""
        return int(self._rng.integers(len(decision.frontiers)))


class Nearest(Greedy[NearestOptions]):
    """The nearest frontier (Yamauchi 1997)."""

    def scores(
        self, decision: Decision, chosen: NDArray[np.int64], lengths: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Minus the distance in metres."""
        if self.options.distance == "path":
            return -lengths
        return -np.array([decision.frontiers[i].straight_distance for i in chosen], np.float64)


class CostUtility(Greedy[CostUtilityOptions]):
    """alpha (dmax - d)/dmax + (1 - alpha) A/Amax, with the maxima over the candidates (Luperto et al. 2021)."""

    def scores(
        self, decision: Decision, chosen: NDArray[np.int64], lengths: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Between 0 and 1."""
        return utilities(lengths, visible_areas(decision, chosen), self.options.alpha)


class GainOverDistance(Greedy[GreedyOptions]):
    """A/d."""

    def scores(
        self, decision: Decision, chosen: NDArray[np.int64], lengths: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """In square metres per metre; a frontier underfoot is one cell away."""
        return visible_areas(decision, chosen) / np.maximum(lengths, decision.grid.resolution)


class GainExp(Greedy[GainExpOptions]):
    """A exp(-lambda d) (Gonzalez-Banos and Latombe 2002)."""

    def scores(
        self, decision: Decision, chosen: NDArray[np.int64], lengths: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """In square metres, up to a factor that all share: the nearest one is not discounted, so that none underflows."""
        discounts: NDArray[np.float64] = np.exp(-self.options.rate * (lengths - lengths.min()))
        return visible_areas(decision, chosen) * discounts


class DistanceAdvantage(Greedy[DistanceAdvantageOptions]):
    """Near the robot and far from the other frontiers (after Ericson, Pedro and Jensfelt 2025).

    A frontier that is far from all others costs a detour later, so it is visited while it is near.
    """

    def scores(
        self, decision: Decision, chosen: NDArray[np.int64], lengths: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """The weighted mean path length from the other frontiers less the path length from the robot, in metres."""
        if len(chosen) == 1:
            return -lengths
        between = decision.path_lengths(chosen)[1:, 1:].astype(np.float64)
        remoteness: NDArray[np.float64] = between.sum(axis=0) / (len(chosen) - 1)
        return self.options.weight * remoteness - lengths


def visible_areas(decision: Decision, chosen: NDArray[np.int64]) -> NDArray[np.float64]:
    """Visible unknown areas float64 (k,) of the chosen frontiers, in square metres."""
    return np.array([decision.frontiers[i].visible_area for i in chosen], np.float64)


def utilities(lengths: NDArray[np.float64], gains: NDArray[np.float64], alpha: float) -> NDArray[np.float64]:
    """Weighted nearness and gain of k frontiers, float64 (k,) in 0..1, each relative to the greatest among them.

    Args:
        lengths: float64 (k,), path lengths in metres.
        gains: float64 (k,), areas in square metres.
        alpha: Weight of nearness, 0..1.
    """
    nearness = 1.0 - lengths / max(float(lengths.max()), 1e-9)
    share = gains / max(float(gains.max()), 1e-9)
    return np.asarray(alpha * nearness + (1.0 - alpha) * share)


register("random", "any frontier, all equally likely", Random, Options())
register("nearest", "the nearest frontier by path; those of 1.0 m and more first", Nearest, NearestOptions())
register(
    "nearest-0.4",
    "the nearest frontier by path; those of 0.4 m and more first",
    Nearest,
    NearestOptions(min_size=0.4),
)
register(
    "nearest-straight",
    "the nearest frontier by straight line (MapEx's baseline)",
    Nearest,
    NearestOptions(min_size=0.4, distance="straight"),
)
register("cost-utility", "alpha x nearness + (1 - alpha) x visible area", CostUtility, CostUtilityOptions())
register(
    "cost-utility-0.5",
    "half nearness, half visible area (as published)",
    CostUtility,
    CostUtilityOptions(alpha=0.5),
)
register(
    "cost-utility-0.9", "mostly nearness, a tenth visible area", CostUtility, CostUtilityOptions(alpha=0.9)
)
register("gain-over-distance", "visible area / path length", GainOverDistance, GreedyOptions())
register("gain-exp", "visible area x exp(-0.2 x path length)", GainExp, GainExpOptions())
register(
    "distance-advantage",
    "near the robot and far from the other frontiers",
    DistanceAdvantage,
    DistanceAdvantageOptions(),
)
