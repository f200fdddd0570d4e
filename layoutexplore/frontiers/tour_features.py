"""Which frontiers a tour is planned over, and what each costs on top of it.

A tour visits the sizeable frontiers that need not wait: a closed one with hardly anything left in its room is
taken when no other is left. The tour agents go where it begins; policies are shown each frontier's place in
it and what going there first would add. A `TourConfig` says how the tour weighs things; a policy may have
learnt one of its own.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from layoutexplore.errors import checks_arguments
from layoutexplore.frontiers.classes import LITTLE_LEFT
from layoutexplore.frontiers.decision import Decision
from layoutexplore.frontiers.table import Frontier
from layoutexplore.grids.arrays import Floats, Ints, Mask
from layoutexplore.options import Rule, check
from layoutexplore.planning.latency_tours import UNCONNECTED, latency_tour

TOUR_SIZE = 1.0
"""Metres; smaller frontiers wait until no other is left, where no layout tells what is behind them."""

LAYOUT_TOUR_SIZE = 0.4
"""The same where a layout tells: it leaves out what is small and near a finished room's wall."""

MOST_AREA = 30.0
"""Square metres; more than this in view counts as this much: walls not seen yet will stand in the way."""

SAME_GOAL = 2.0
"""Metres; a frontier that is nearer to the middle of the one last gone to is what is left of it."""

SURE = 0.7
"""Probability of being right from which a class is relied on where nobody looks again: to stop."""

BEGUN = 60.0
"""Square metres of known floor from which a building can be finished: before, hardly a room is left."""


def greatest(parameter: str) -> float:
    """The greatest value that a parameter of a tour may have: with more, weights are no numbers any more."""
    return 10.0 if parameter.endswith("exponent") else 1e6


@dataclass(frozen=True, kw_only=True)
class TourConfig:
    """How a tour weighs path lengths and areas; by default as the agents `layout-tour` and `latency-tour` do.

    A frontier's weight is min(area in view, most_area) ** area_exponent * (1 + expected area) **
    expected_exponent.

    Attributes:
        patience: Weight of the tour's length against the mean path length to a unit of weight.
        most_area: Square metres; more than this in view counts as this much.
        area_exponent: Of the area in view.
        expected_exponent: Of 1 + the expected area in square metres, where a predictor tells one.
        first_leg: By which share the path to the first stop counts more than those between stops: it is
            followed as planned, the others may be planned anew.
        hold: Metres by which the path to what is left of the last goal counts as shorter.
        little_left: Square metres; closed frontiers with less left in their room wait.

    Raises:
        ConfigError: A value is no number from 0 to a million, an exponent none from 0 to 10.
    """

    patience: float = 1.0
    most_area: float = MOST_AREA
    area_exponent: float = 1.0
    expected_exponent: float = 0.0
    first_leg: float = 0.0
    hold: float = 0.0
    little_left: float = LITTLE_LEFT

    def __post_init__(self) -> None:
        check(
            self, "tour.", **{f.name: Rule(low=0.0, high=greatest(f.name)) for f in dataclasses.fields(self)}
        )


PLAIN_TOUR = TourConfig()


class TourFeatures(NamedTuple):
    """What a tour tells of each frontier of a decision.

    Attributes:
        rank: float64 (n,): 1 / its position in the tour, counted from 1; 0 when it is not in the tour.
        detour: float64 (n,): metres by which the tour grows when this frontier is visited first.
    """

    rank: Floats
    detour: Floats


def area_left(frontier: Frontier) -> float:
    """Expected area behind a frontier in square metres; behind an open one there is no end to it."""
    return (frontier.expected_area or 0.0) if frontier.is_closed else np.inf


def sizeable_frontiers(decision: Decision, min_size: float = TOUR_SIZE) -> Ints:
    """Indices int64 (k,) of the frontiers of at least that size in metres; of all when there is none."""
    sizes = decision.table.size
    large = np.flatnonzero(sizes >= min_size - 1e-6)
    return large if len(large) else np.arange(len(sizes))


@checks_arguments
def ready_frontiers(
    decision: Decision, min_size: float = TOUR_SIZE, area: float = LITTLE_LEFT, doubted: float = np.inf
) -> Ints:
    """Indices int64 (k,) of the sizeable frontiers that need not wait; of all sizeable ones when all would.

    Args:
        decision: The decision.
        min_size: Metres; smaller frontiers count only when all are smaller.
        area: Square metres; closed frontiers with less left wait.
        doubted: Square metres; those do not of which as much is to be expected, as their class may be wrong.
    """
    chosen = sizeable_frontiers(decision, min_size)
    goes = ~waiting(decision, area, doubted)[chosen]
    return chosen[goes] if goes.any() else chosen


@checks_arguments
def waiting(decision: Decision, area: float = LITTLE_LEFT, doubted: float = np.inf) -> Mask:
    """Bool (n,): which frontiers can wait; arguments as of `ready_frontiers`."""
    table = decision.table
    little = (table.expected_area < area) & (area_in_doubt(decision) < doubted)
    waits: Mask = (table.closed > 0.0) & little
    return waits


@checks_arguments
def area_in_doubt(decision: Decision) -> Floats:
    """Square metres float64 (n,) behind closed frontiers in the mean: what is in view where they are open."""
    table = decision.table
    in_view = np.minimum(table.visible_area, MOST_AREA)
    sure = np.where(table.confidence > 0.0, table.confidence, 1.0)
    areas: Floats = sure * table.expected_area + (1.0 - sure) * in_view
    return areas


def tour_weights(decision: Decision, chosen: Ints, config: TourConfig = PLAIN_TOUR) -> Floats:
    """What reaching each of some frontiers int64 (k,) is worth to a latency tour: float64 (k,)."""
    visible = np.minimum(decision.table.visible_area[chosen], config.most_area)
    expected = decision.table.expected_area[chosen]
    weights: Floats = visible**config.area_exponent * (1.0 + expected) ** config.expected_exponent
    return weights


def tour_features(decision: Decision, config: TourConfig = PLAIN_TOUR) -> TourFeatures:
    """Rank in the latency tour over the frontiers that need not wait, and detour, of every frontier.

    Visiting frontier i first costs d(robot, i) + d(i, first) - d(robot, first), less what is saved where it
    is taken out of the tour. One matrix of distances between the frontiers of the tour serves it and their
    detours; those of the others need only the distances from its first stop.
    """
    count = len(decision.frontiers)
    if count == 0:
        return TourFeatures(np.zeros(0), np.zeros(0))
    judged = decision.table.closed[0] != 0.0
    ready = ready_frontiers(decision, LAYOUT_TOUR_SIZE if judged else TOUR_SIZE, config.little_left)
    distances = np.minimum(decision.path_lengths(ready).astype(np.float64), UNCONNECTED)
    order = latency_tour(
        _as_weighed(distances, decision, ready, config),
        tour_weights(decision, ready, config),
        config.patience,
    )
    first = int(order[0])
    extra = distances[0] + distances[first] - distances[0, first]
    extra[first] = 0.0
    # What is saved where a stop behind the first is taken out; at the end of the tour nothing is bridged.
    before, here, after = order[:-1], order[1:], order[2:]
    extra[here] -= distances[before, here]
    extra[here[:-1]] += distances[before[:-1], after] - distances[here[:-1], after]
    rank, detour = np.zeros(count), np.zeros(count)
    rank[ready[order - 1]] = 1.0 / np.arange(1, len(order) + 1)
    detour[ready] = np.maximum(extra[1:], 0.0)
    others = np.delete(np.arange(count), ready)
    if len(others):
        there = decision.path_lengths_from(int(ready[first - 1]), others).astype(np.float64)
        detour[others] = np.maximum(
            decision.table.path_length[others] + np.minimum(there, UNCONNECTED) - distances[0, first], 0.0
        )
    return TourFeatures(rank, detour)


def _as_weighed(distances: Floats, decision: Decision, chosen: Ints, config: TourConfig) -> Floats:
    """The path lengths float64 (k + 1, k + 1), those from the robot (index 0) as configured."""
    lengths = distances[0] * (1.0 + config.first_leg)
    if config.hold and decision.goal is not None:
        (x, y), table = decision.goal, decision.table
        lengths[1:] -= config.hold * (np.hypot(table.x[chosen] - x, table.y[chosen] - y) < SAME_GOAL)
    weighed = distances.copy()
    weighed[0] = weighed[:, 0] = np.maximum(lengths, 0.0)
    return weighed
