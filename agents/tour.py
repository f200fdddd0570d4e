"""A tour over all frontiers, planned anew at every decision; the robot goes to the first one of it.

A short tour finishes well and starts badly. A latency tour also wants to come early to where much is to be
seen.
"""

from __future__ import annotations

from dataclasses import dataclass

from layoutexplore.agents.base import Heuristic, register
from layoutexplore.agents.greedy import GreedyOptions
from layoutexplore.frontiers.decision import Choice, Decision
from layoutexplore.frontiers.tour_features import sizeable_frontiers, tour_weights
from layoutexplore.grids.arrays import Floats, Ints
from layoutexplore.options import option
from layoutexplore.planning.latency_tours import latency_tour
from layoutexplore.planning.tours import open_tour


@dataclass(frozen=True, kw_only=True)
class TourOptions(GreedyOptions):
    """Parameters of `Tour`."""

    min_size: float = option(1.0, "metres; smaller frontiers wait until no other is left", low=0.0)


class Tour(Heuristic[TourOptions]):
    """The first frontier of a short open tour from the robot over all sizeable frontiers."""

    def choose(self, decision: Decision) -> Choice:
        """The index of the tour's first frontier."""
        return int(plan_tour(decision, sizeable_frontiers(decision, self.options.min_size))[0])


@dataclass(frozen=True, kw_only=True)
class LatencyTourOptions(TourOptions):
    """Parameters of `LatencyTour`."""

    patience: float = option(
        1.0, "weight of the tour's length against the mean way to a square metre", low=0.0
    )


class LatencyTour(Heuristic[LatencyTourOptions]):
    """The first frontier of an open tour that is short and comes early to where much is to be seen."""

    def choose(self, decision: Decision) -> Choice:
        """The index of the tour's first frontier."""
        chosen = sizeable_frontiers(decision, self.options.min_size)
        return int(plan_latency_tour(decision, chosen, self.options.patience)[0])


def plan_tour(decision: Decision, chosen: Ints) -> Ints:
    """A short open tour from the robot over the viewpoints of some frontiers.

    Args:
        decision: The decision.
        chosen: int64 (k,), indices of the frontiers to visit.

    Returns:
        int64 (k,): the same indices in the order of the visit.
    """
    if len(chosen) < 2:
        return chosen
    order = open_tour(decision.path_lengths(chosen))
    return chosen[order - 1]


def plan_latency_tour(
    decision: Decision, chosen: Ints, patience: float, weights: Floats | None = None
) -> Ints:
    """An open tour from the robot over some viewpoints, weighed by the unknown area in view from there.

    Args:
        decision: The decision.
        chosen: int64 (k,), indices of the frontiers to visit.
        patience: Weight of the tour's length; see `layoutexplore.planning.latency_tours`.
        weights: float64 (k,), other weights of the frontiers.

    Returns:
        int64 (k,): the same indices in the order of the visit.
    """
    if len(chosen) < 2:
        return chosen
    weights = tour_weights(decision, chosen) if weights is None else weights
    return chosen[latency_tour(decision.path_lengths(chosen), weights, patience) - 1]


register("tour", "the first frontier of a short tour over all of 1.0 m and more", Tour, TourOptions())
register(
    "tour-0.4",
    "the first frontier of a short tour over all of 0.4 m and more",
    Tour,
    TourOptions(min_size=0.4),
)
register(
    "latency-tour",
    "the first frontier of a tour that is short and comes early to large ones",
    LatencyTour,
    LatencyTourOptions(),
)
