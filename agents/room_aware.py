"""Strategies that use the layout: closed frontiers with little left wait.

Knowing that a frontier is only the rest of an almost finished room pays when it saves going there now: such
frontiers wait until no other is left (the threshold is in square metres: a relative one can end an
exploration at 40 % coverage). Going to closed or to open frontiers first are the negative controls: both cost
metres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from layoutexplore.agents.base import Heuristic, register
from layoutexplore.agents.greedy import GreedyOptions, best_index
from layoutexplore.agents.tour import plan_latency_tour
from layoutexplore.frontiers.decision import STOP, Choice, Decision, Frontier
from layoutexplore.frontiers.tour_features import BEGUN, SURE, area_left, ready_frontiers, sizeable_frontiers
from layoutexplore.options import option


@dataclass(frozen=True, kw_only=True)
class LayoutOptions(GreedyOptions):
    """Parameters of the strategies that use the layout."""

    area: float = option(1.0, "square metres; closed frontiers with less left in their room wait", low=0.0)
    stop_area: float = option(
        0.0, "square metres; stop when every frontier has less left behind it (0: never)", low=0.0
    )
    stop_sure: float = option(
        SURE, "probability; and when so sure that every frontier is closed", low=0.0, high=1.0
    )
    stop_known: float = option(BEGUN, "square metres; and when so much floor is known", low=0.0)
    predictor: str = option("layout", "where classes and areas come from")


@dataclass(frozen=True, kw_only=True)
class LayoutGainOptions(LayoutOptions):
    """Parameters of `LayoutGain`."""

    rate: float = option(0.2, "lambda in 1/m: how fast far gains fade", low=0.0)


@dataclass(frozen=True, kw_only=True)
class LayoutTourOptions(LayoutOptions):
    """Parameters of `LayoutTour`."""

    patience: float = option(
        1.0, "weight of the tour's length against the mean way to a square metre", low=0.0
    )


class RoomAwareHeuristic(Heuristic[LayoutOptions]):
    """A heuristic whose decisions are completed by a predictor, and that stops early where nothing is left to find."""

    @property
    def predictor(self) -> str:
        """The predictor that the simulation has to run for this agent."""
        return self.options.predictor

    def act(self, decision: Decision) -> Choice:
        """The frontier to go to, or `STOP` when there is none or surely less than `stop_area` behind each."""
        if all(self._is_done(frontier) for frontier in decision.frontiers) and self._has_begun(decision):
            return STOP
        return super().act(decision)

    def _has_begun(self, decision: Decision) -> bool:
        return not decision.frontiers or decision.grid.free_area >= self.options.stop_known

    def _is_done(self, frontier: Frontier) -> bool:
        sure = frontier.confidence is None or frontier.confidence >= self.options.stop_sure
        return sure and area_left(frontier) < self.options.stop_area


def nearest_of(decision: Decision, chosen: NDArray[np.int64]) -> int:
    """The nearest of some frontiers int64 (k,), by path length."""
    lengths = np.array([decision.frontiers[i].path_length for i in chosen])
    return int(chosen[best_index(-lengths, lengths)])


class LayoutNearest(RoomAwareHeuristic):
    """The nearest frontier that need not wait."""

    def choose(self, decision: Decision) -> Choice:
        """The index of the nearest frontier that does not wait."""
        return nearest_of(decision, ready_frontiers(decision, self.options.min_size, self.options.area))


class LayoutTour(RoomAwareHeuristic):
    """The first frontier of a latency tour over those that need not wait."""

    def choose(self, decision: Decision) -> Choice:
        """The index of the tour's first frontier."""
        chosen = ready_frontiers(decision, self.options.min_size, self.options.area)
        patience = getattr(self.options, "patience", 1.0)
        return int(plan_latency_tour(decision, chosen, patience)[0])


class LayoutGain(RoomAwareHeuristic):
    """Expected area against path length: A exp(-lambda d) (Luperto and Amigoni, AAMAS 2021)."""

    def choose(self, decision: Decision) -> Choice:
        """The index of the frontier with the highest score."""
        chosen = sizeable_frontiers(decision, self.options.min_size)
        areas = np.array([decision.frontiers[i].expected_area or 0.0 for i in chosen])
        lengths = np.array([decision.frontiers[i].path_length for i in chosen])
        rate = getattr(self.options, "rate", 0.0)
        return int(chosen[best_index(areas * np.exp(-rate * (lengths - lengths.min())), lengths)])


class ClosedFirst(RoomAwareHeuristic):
    """The nearest closed frontier; an open one only when no closed one is left."""

    def choose(self, decision: Decision) -> Choice:
        """The index of the nearest frontier of the class that goes first."""
        return _nearest_of_class(decision, self.options, closed=True)


class OpenFirst(RoomAwareHeuristic):
    """The nearest open frontier; a closed one only when no open one is left."""

    def choose(self, decision: Decision) -> Choice:
        """The index of the nearest frontier of the class that goes first."""
        return _nearest_of_class(decision, self.options, closed=False)


def _nearest_of_class(decision: Decision, options: LayoutOptions, *, closed: bool) -> int:
    chosen = sizeable_frontiers(decision, options.min_size)
    first = chosen[[bool(decision.frontiers[i].is_closed) == closed for i in chosen]]
    return nearest_of(decision, first if len(first) else chosen)


register(
    "layout-nearest",
    "the nearest frontier; closed ones with little left wait",
    LayoutNearest,
    LayoutOptions(),
)
register(
    "layout-nearest-4",
    "the same; closed ones with less than 4 m2 left wait",
    LayoutNearest,
    LayoutOptions(area=4.0),
)
register(
    "layout-tour",
    "a latency tour over frontiers; closed ones with little left wait",
    LayoutTour,
    LayoutTourOptions(),
)
register("layout-gain", "expected area x exp(-0.2 x path length)", LayoutGain, LayoutGainOptions())
register(
    "closed-first",
    "the nearest closed frontier, then open ones (a negative control)",
    ClosedFirst,
    LayoutOptions(),
)
register(
    "open-first",
    "the nearest open frontier, then closed ones (a negative control)",
    OpenFirst,
    LayoutOptions(),
)
