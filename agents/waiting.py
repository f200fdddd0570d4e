"""Nearest frontier, but frontiers behind which little can be hidden wait until only such are left.

The nearest frontier is mostly a shadow behind a door jamb or a pillar: looking into each before moving on
costs metres. Without a layout the unknown area visible from the frontier says which ones can wait.
"""

from __future__ import annotations

from dataclasses import dataclass

from layoutexplore.agents.base import register
from layoutexplore.agents.greedy import Greedy, GreedyOptions
from layoutexplore.frontiers.decision import Decision
from layoutexplore.grids.arrays import Ints
from layoutexplore.options import option


@dataclass(frozen=True, kw_only=True)
class WaitingOptions(GreedyOptions):
    """Parameters of `Waiting`."""

    area: float = option(3.0, "square metres; frontiers with a smaller visible unknown area wait", low=0.0)


class Waiting(Greedy[WaitingOptions]):
    """The nearest frontier with at least `area` square metres in sight; of all when there is none."""

    def candidates(self, decision: Decision) -> Ints:
        """Numbers int64 (k,) of the sizeable frontiers that do not wait."""
        sizeable = super().candidates(decision)
        ready = sizeable[decision.table.visible_area[sizeable] >= self.options.area]
        return ready if len(ready) else sizeable


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
