"""Strategies that use the layout: closed frontiers with little left wait.

Knowing that a frontier is only the rest of an almost finished room pays when it saves going there now: such frontiers wait
until no other is left (the threshold is in square metres: a relative one can end an exploration at 40 % coverage).
Going to closed or to open frontiers first are the negative controls: both cost metres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from layoutexplore.agents.base import Heuristic, option, register
from layoutexplore.agents.greedy import GreedyOptions, best_index, sizeable
from layoutexplore.agents.tour import plan_tour
from layoutexplore.decision import Choice, Decision


@dataclass(frozen=True, kw_only=True)
class LayoutOptions(GreedyOptions):
    """Parameters of the strategies that use the layout."""

    area: float = option(1.0, "square metres; closed frontiers with less left in their room wait", low=0.0)
    predictor: str = option("oracle", "where classes and areas come from")


class _LayoutHeuristic(Heuristic[LayoutOptions]):
    """A heuristic whose decisions are completed by a predictor."""

    @property
    def predictor(self) -> str:
        """The predictor that the simulation has to run for this agent."""
        return self.options.predictor


def ready(decision: Decision, options: LayoutOptions) -> NDArray[np.int64]:
    """int64 (k,): indices of the sizeable frontiers that need not wait; of all sizeable ones when all would wait."""
    chosen = sizeable(decision, options.min_size)
    goes = np.array([not _is_leftover(decision, int(i), options.area) for i in chosen])
    return chosen[goes] if goes.any() else chosen


def _is_leftover(decision: Decision, index: int, area: float) -> bool:
    frontier = decision.frontiers[index]
    return bool(frontier.is_closed) and (frontier.expected_area or 0.0) < area


class LayoutNearest(_LayoutHeuristic):
    """The nearest frontier that need not wait."""

    def choose(self, decision: Decision) -> Choice:
        """The index of the nearest frontier that does not wait."""
        chosen = ready(decision, self.options)
        lengths = np.array([decision.frontiers[i].path_length for i in chosen])
        return int(chosen[best_index(-lengths, lengths)])


class LayoutTour(_LayoutHeuristic):
    """The first frontier of a short tour over those that need not wait."""

    def choose(self, decision: Decision) -> Choice:
        """The index of the tour's first frontier."""
        return int(plan_tour(decision, ready(decision, self.options))[0])


register("layout-nearest", "the nearest frontier; closed ones with little left wait", LayoutNearest, LayoutOptions())
register("layout-tour", "a short tour over frontiers; closed ones with little left wait", LayoutTour, LayoutOptions())
