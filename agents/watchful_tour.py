"""A latency tour that is planned anew every half metre, after a look all around.

Where `layout-tour` walks to a frontier until that is gone, this robot makes a few steps, looks all around and
plans its tour anew with what it has seen. A lidar that looks ahead sees so into the rooms that are passed,
and with any the robot does not walk on to what no longer begins its tour. Where turning costs, it decides
only where it arrives.

In its tour a closed frontier weighs no more than what is left behind it: rays that cross walls which nobody
has seen yet promise more. So small remains come later, and the length of the tour has to count for more, or
too many of them would be left to the end.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from layoutexplore.agents.base import register
from layoutexplore.agents.room_aware import LookingTour, RoomAwareTourOptions
from layoutexplore.agents.tour import plan_latency_tour
from layoutexplore.frontiers.decision import Choice, Decision
from layoutexplore.frontiers.tour_features import ready_frontiers, tour_weights, waiting
from layoutexplore.grids.arrays import Floats, Ints
from layoutexplore.options import option
from layoutexplore.simulation.looking_around import LookingAround


@dataclass(frozen=True, kw_only=True)
class ReplannedTourOptions(RoomAwareTourOptions):
    """Parameters of tours that are planned anew after every few steps."""

    patience: float = option(
        2.5, "weight of the tour's length against the mean way to a square metre", low=0.0
    )
    doubted: float = option(
        3.0,
        "m2 to be expected of a closed frontier, as its class may be wrong, from which on it does not wait",
        low=0.0,
    )


@dataclass(frozen=True, kw_only=True)
class WatchfulTourOptions(ReplannedTourOptions):
    """Parameters of `WatchfulTour`."""

    step: float = option(0.5, "metres after which the robot looks around and plans anew", low=0.2)


LAST_PATIENCE, LAST_DOUBT = 0.5, 0.1
"""Weight of the tour's length where all frontiers wait, and the share that what is in view counts then.

What is left behind each is next to nothing but where a class is wrong; that is not to be found last.
"""

ReplannedT = TypeVar("ReplannedT", bound=ReplannedTourOptions)


class ReplannedTour(LookingTour[ReplannedT]):
    """Steps along a latency tour over the frontiers that need not wait, planned anew after every step.

    Args:
        name: What it is called in results.
        options: Its parameters.
        step: Metres after which the robot looks around and plans anew; 0 for where it arrives.
    """

    def __init__(self, name: str, options: ReplannedT, step: float) -> None:
        super().__init__(name, options, LookingAround(step, with_any_lidar=True))

    def plans_anew(self, decision: Decision) -> bool:
        """Always: with any lidar the robot does not walk on to what no longer begins its tour."""
        return True

    def plan(self, decision: Decision) -> Choice:
        """The index of the tour's first frontier."""
        return int(plan_watchful_tour(decision, self.options)[0])


class WatchfulTour(ReplannedTour[WatchfulTourOptions]):
    """The tour that is planned anew after every step."""

    def __init__(self, name: str, options: WatchfulTourOptions) -> None:
        super().__init__(name, options, options.step)


def plan_watchful_tour(decision: Decision, options: ReplannedTourOptions) -> Ints:
    """An open tour from the robot over the frontiers that need not wait.

    Args:
        decision: With a frontier or more.
        options: How the tour weighs things.

    Returns:
        int64 (k,): their indices in the order of the visit.
    """
    ready = ready_frontiers(decision, options.min_size, options.area, options.doubted)
    if len(ready) < 2:
        return ready
    areas, patience = promised_areas(decision, ready), options.patience
    if waiting(decision, options.area, options.doubted)[ready].all():
        areas = (1.0 - LAST_DOUBT) * areas + LAST_DOUBT * tour_weights(decision, ready)
        patience = min(patience, LAST_PATIENCE)
    return plan_latency_tour(decision, ready, patience, areas)


def promised_areas(decision: Decision, chosen: Ints) -> Floats:
    """Square metres float64 (k,) that each of some frontiers int64 (k,) is worth to a tour.

    The unknown area in view, and behind a closed frontier no more than is expected there.
    """
    in_view, table = tour_weights(decision, chosen), decision.table
    left = np.minimum(in_view, table.expected_area[chosen])
    areas: Floats = np.where(table.closed[chosen] > 0.0, left, in_view)
    return areas


register(
    "watchful-tour",
    "a latency tour, planned anew every half metre after a look around; closed ones with little left wait",
    WatchfulTour,
    WatchfulTourOptions(),
)
