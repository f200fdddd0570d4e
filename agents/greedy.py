"""Agents that score every frontier by itself and go to the best: a name, a formula, and where it comes from.

The gain of a frontier is A, the unknown area that rays from its viewpoint would cross; its cost is the path
length d. To *finish* an exploration the total gain is fixed, so agents that chase gain can lose to the
nearest frontier. What the defaults were measured at stands in `agents/heuristics.md`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np

from layoutexplore.agents.base import Heuristic, register
from layoutexplore.errors import shortened
from layoutexplore.frontiers.decision import Choice, Decision
from layoutexplore.frontiers.table import FrontierTable
from layoutexplore.frontiers.tour_features import sizeable_frontiers
from layoutexplore.grids.arrays import Floats, Ints
from layoutexplore.options import Options, option

Scores = Floats
"""float64 (k,): one for each frontier that may be chosen; the greatest is the best."""

_TIE = 1e-9
"""Scores that differ by less than this share of the largest one are equal."""


@dataclass(frozen=True, kw_only=True)
class GreedyOptions(Options):
    """What every greedy agent can be told."""

    min_size: float = option(0.4, "metres; smaller frontiers wait until no other is left", low=0.0)


GreedyT = TypeVar("GreedyT", bound=GreedyOptions)


@dataclass(frozen=True, kw_only=True)
class NearestOptions(GreedyOptions):
    """Parameters of `Nearest`."""

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


class Candidates(NamedTuple):
    """The frontiers that may be chosen at a decision.

    Attributes:
        decision: The decision.
        numbers: int64 (k,), which of its frontiers they are.
        table: What they are like, a column float64 (k,) for each property.
    """

    decision: Decision
    numbers: Ints
    table: FrontierTable

    @staticmethod
    def of(decision: Decision, numbers: Ints) -> Candidates:
        """Those of a decision with these numbers int64 (k,)."""
        return Candidates(decision, numbers, FrontierTable(*(column[numbers] for column in decision.table)))


class Greedy(Heuristic[GreedyT]):
    """Goes to the candidate with the greatest score; of equal ones to the nearest."""

    def choose(self, decision: Decision) -> Choice:
        """The index of the best frontier."""
        among = Candidates.of(decision, self.candidates(decision))
        return int(among.numbers[best_index(self.scores(among), among.table.path_length)])

    def candidates(self, decision: Decision) -> Ints:
        """Numbers int64 (k,) of the frontiers that may be chosen: the sizeable ones."""
        return sizeable_frontiers(decision, self.options.min_size)

    def scores(self, among: Candidates) -> Scores:
        """Minus the path length: the nearest is the best."""
        return -among.table.path_length


def best_index(scores: Scores, path_lengths: Floats) -> int:
    """The index of the greatest score; of equal ones the nearest, of equally near ones the first.

    Args:
        scores: float64 (k,); those within a share of 1e-9 of the largest finite magnitude of the best are
            equal to it, and one that is -inf is the best only where all are.
        path_lengths: float64 (k,), in metres.

    Raises:
        ValueError: A score is NaN or +inf.

    Example:
        >>> best_index(np.array([1.0, 3.0, 3.0 + 1e-12]), np.array([5.0, 4.0, 6.0]))
        1
    """
    best = float(scores.max())
    if not best < np.inf:
        raise ValueError(f"frontiers are compared by scores that are numbers, got {shortened(scores)}")
    largest = float(np.abs(scores[scores > -np.inf]).max(initial=0.0))
    tied = np.flatnonzero(scores >= best - _TIE * largest)
    return int(tied[np.argmin(path_lengths[tied])])


class Random(Heuristic[Options]):
    """Any frontier with the same probability."""

    remembers = True

    def __init__(self, name: str, options: Options) -> None:
        super().__init__(name, options)
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Begin a new run with the random stream of this seed."""
        super().reset(seed)
        self._rng = np.random.default_rng(seed)

    def choose(self, decision: Decision) -> Choice:
        """A random index."""
        return int(self._rng.integers(len(decision.frontiers)))


class Nearest(Greedy[NearestOptions]):
    """The nearest frontier (Yamauchi 1997)."""

    def scores(self, among: Candidates) -> Scores:
        """Minus the distance in metres."""
        straight = self.options.distance == "straight"
        return -(among.table.straight_distance if straight else among.table.path_length)


class CostUtility(Greedy[CostUtilityOptions]):
    """alpha (dmax - d)/dmax + (1 - alpha) A/Amax, maxima over the candidates (Luperto et al. 2021)."""

    def scores(self, among: Candidates) -> Scores:
        """Between 0 and 1."""
        return utilities(among.table.path_length, among.table.visible_area, self.options.alpha)


class GainOverDistance(Greedy[GreedyOptions]):
    """A/d."""

    def scores(self, among: Candidates) -> Scores:
        """In square metres per metre; a frontier underfoot is one cell away."""
        return among.table.visible_area / np.maximum(among.table.path_length, among.decision.grid.resolution)


class GainExp(Greedy[GainExpOptions]):
    """A exp(-lambda d) (Gonzalez-Banos and Latombe 2002)."""

    def scores(self, among: Candidates) -> Scores:
        """In square metres, up to a factor that all share."""
        return faded(among.table.visible_area, among.table.path_length, self.options.rate)


class DistanceAdvantage(Greedy[DistanceAdvantageOptions]):
    """Near the robot and far from the other frontiers (after Ericson, Pedro and Jensfelt 2025).

    A frontier that is far from all others costs a detour later, so it is visited while it is near.
    """

    def scores(self, among: Candidates) -> Scores:
        """The weighted mean path length from the other frontiers less that from the robot, in metres."""
        lengths, others = among.table.path_length, len(among.numbers) - 1
        if not others:
            return -lengths
        between = among.decision.path_lengths(among.numbers)[1:, 1:].astype(np.float64)
        remoteness: Scores = between.sum(axis=0) / others
        return self.options.weight * remoteness - lengths


def faded(gains: Floats, lengths: Floats, rate: float) -> Scores:
    """Gains times exp(-rate d); the nearest one is not discounted, so that none underflows."""
    discounts: Floats = np.exp(-rate * (lengths - lengths.min()))
    return gains * discounts


def utilities(lengths: Floats, gains: Floats, alpha: float) -> Scores:
    """Weighted nearness and gain of k frontiers, float64 (k,) in 0..1, each a share of the greatest.

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
