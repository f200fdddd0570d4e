"""The strategy of Luperto and Amigoni (AAMAS 2021), as published: its utility, its classes, its pipeline.

The partial grid is reconstructed by the IAS-15 pipeline and half-seen rooms are completed by its faces. The
gain of a closed frontier is the predicted unseen area of its room, that of an open one what can be seen from
it; distance and gain weigh alike. Its own baselines are `nearest` and the same utility without rooms,
`cost-utility-0.5`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from layoutexplore.agents.base import register
from layoutexplore.agents.greedy import best_index, utilities
from layoutexplore.agents.room_aware import LayoutOptions, RoomAwareHeuristic
from layoutexplore.frontiers.decision import Choice, Decision
from layoutexplore.frontiers.tour_features import sizeable_frontiers
from layoutexplore.options import option


@dataclass(frozen=True, kw_only=True)
class PredictedUtilityOptions(LayoutOptions):
    """Parameters of `PredictedUtility`."""

    alpha: float = option(0.5, "weight of the distance; the predicted area has the rest", low=0.0, high=1.0)
    predictor: str = option("reconstruct:ias15", "where classes and areas come from")


class PredictedUtility(RoomAwareHeuristic):
    """alpha (dmax - d)/dmax + (1 - alpha) A/Amax, where A is predicted (Luperto and Amigoni, AAMAS 2021)."""

    def choose(self, decision: Decision) -> Choice:
        """The index of the frontier with the highest utility."""
        chosen = sizeable_frontiers(decision, self.options.min_size)
        table, alpha = decision.table, getattr(self.options, "alpha", 0.5)
        gains = np.where(table.closed[chosen] > 0, table.expected_area[chosen], table.visible_area[chosen])
        lengths: NDArray[np.float64] = table.path_length[chosen]
        return int(chosen[best_index(utilities(lengths, gains, alpha), lengths)])


register(
    "aamas-2021",
    "half nearness, half the area that IAS-15 predicts in the frontier's room (as published)",
    PredictedUtility,
    PredictedUtilityOptions(),
)
