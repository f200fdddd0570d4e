"""The strategy of Luperto, Fochetta and Amigoni (AAMAS 2021): its utility, its classes, its pipeline.

The partial grid is reconstructed by the IAS-15 pipeline at every decision and half-seen rooms are completed
by its faces. The gain of a closed frontier is the predicted unseen area of its room, that of an open one what
can be seen from it; distance and gain weigh alike. Its own baselines are `nearest` and the same utility
without rooms, `cost-utility-0.5`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from layoutexplore.agents.base import register
from layoutexplore.agents.greedy import Candidates, Scores, utilities
from layoutexplore.agents.room_aware import LayoutOptions, RoomAwareHeuristic
from layoutexplore.options import option


@dataclass(frozen=True, kw_only=True)
class PredictedUtilityOptions(LayoutOptions):
    """Parameters of `PredictedUtility`."""

    alpha: float = option(0.5, "weight of the distance; the predicted area has the rest", low=0.0, high=1.0)
    predictor: str = option(
        "reconstruct:ias15;growth=0", "where classes and areas come from, as published anew at every decision"
    )


class PredictedUtility(RoomAwareHeuristic[PredictedUtilityOptions]):
    """alpha (dmax - d)/dmax + (1 - alpha) A/Amax, where A is predicted."""

    def scores(self, among: Candidates) -> Scores:
        """Between 0 and 1."""
        table = among.table
        gains = np.where(table.closed > 0, table.expected_area, table.visible_area)
        return utilities(table.path_length, gains, self.options.alpha)


register(
    "aamas-2021",
    "half nearness, half the area that IAS-15 predicts in the frontier's room (as published)",
    PredictedUtility,
    PredictedUtilityOptions(),
)
