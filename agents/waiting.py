"""Nearest frontier, but frontiers behind which little can be hidden wait until only such are left.

The nearest frontier is mostly a shadow behind a door jamb or a pillar: looking into each before moving on
costs metres. Without a layout the unknown area visible from the frontier says which ones can wait.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from layoutexplore.agents.base import Heuristic, register
from layoutexplore.agents.greedy import GreedyOptions, best_index, visible_areas
from layoutexplore.frontiers.decision import Choice, Decision
from layoutexplore.frontiers.tour_features import sizeable_frontiers
from layoutexplore.options import option


@dataclass(frozen=True, kw_only=True)
class WaitingOptions(GreedyOptions):
    """Parameters of `Waiting`. 8 m2 is best at 90-95 % coverage and a loss at 99 %; 3 m2 is in between."""

    area: float = option(3.0, "square metres; frontiers with a smaller visible unknown area wait", low=0.0)


class Waiting(Heuristic[WaitingOptions]):
    """The nearest frontier with at least `area` square metres of visible unknown; the nearest of all when there is none."""

    def choose(self, decision: Decision) -> Choice:
        """The index of the nearest frontier that does not wait."""
        chosen = sizeable_frontiers(decision, self.options.min_size)
        ready = chosen[visible_areas(decision, chosen) >= self.options.area]
        chosen = ready if len(ready) else chosen
        lengths = np.array([decision.frontiers[i].path_length for i in chosen], np.float64)
        return int(chosen[best_index(-lengths, lengths)])


register(
    "wait", "the nearest frontier; those with little unknown area in sight wait", Waiting, WaitingOptions()
)
register(
    "wait-3",
    "the nearest frontier; those with less than 3 m2 in sight wait",
    Waiting,
    WaitingOptions(area=3.0),
)
register(
    "wait-8",
    "the nearest frontier; those with less than 8 m2 in sight wait",
    Waiting,
    WaitingOptions(area=8.0),
)
