"""Strategies that use the layout: closed frontiers with little left wait.

Knowing that a frontier is only the rest of an almost finished room pays when it saves going there now: such
frontiers wait until no other is left. The threshold is in square metres: a share of the room would end an
exploration early where rooms are large. Going to closed or to open frontiers first are the negative controls.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

from layoutexplore.agents.base import register, settle_predictor
from layoutexplore.agents.greedy import Candidates, Greedy, GreedyOptions, Scores, faded
from layoutexplore.agents.tour import plan_latency_tour
from layoutexplore.frontiers.decision import STOP, Choice, Decision
from layoutexplore.frontiers.table import Frontier
from layoutexplore.frontiers.tour_features import BEGUN, SURE, area_left, ready_frontiers
from layoutexplore.grids.arrays import Ints, Mask
from layoutexplore.grids.grid import Pose
from layoutexplore.options import check_kind, option
from layoutexplore.simulation.looking_around import LOOK_EVERY, LookingAround


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

    def __post_init__(self) -> None:
        """What means the same predictor has one name."""
        super().__post_init__()
        settle_predictor(self)


@dataclass(frozen=True, kw_only=True)
class LayoutGainOptions(LayoutOptions):
    """Parameters of `LayoutGain`."""

    rate: float = option(0.2, "lambda in 1/m: how fast far gains fade", low=0.0)


@dataclass(frozen=True, kw_only=True)
class RoomAwareTourOptions(LayoutOptions):
    """Parameters of tours that use the layout."""

    patience: float = option(
        1.0, "weight of the tour's length against the mean way to a square metre", low=0.0
    )


@dataclass(frozen=True, kw_only=True)
class LayoutTourOptions(RoomAwareTourOptions):
    """Parameters of `LayoutTour`."""

    look_every: float = option(0.0, LOOK_EVERY, low=0.0)


LayoutT = TypeVar("LayoutT", bound=LayoutOptions)
RoomAwareTourT = TypeVar("RoomAwareTourT", bound=RoomAwareTourOptions)


class RoomAwareHeuristic(Greedy[LayoutT]):
    """An agent whose decisions a predictor completes; it may stop early where nothing is left to find."""

    @property
    def predictor(self) -> str:
        """The predictor that the simulation has to run for this agent."""
        return self.options.predictor

    def act(self, decision: Decision) -> Choice:
        """The frontier to go to, or `STOP` when there is none or surely less than `stop_area` behind each."""
        check_kind("decision", decision, Decision)
        if all(self._is_done(frontier) for frontier in decision.frontiers) and self._has_begun(decision):
            return STOP
        return super().act(decision)

    def _has_begun(self, decision: Decision) -> bool:
        return not decision.frontiers or decision.grid.free_area >= self.options.stop_known

    def _is_done(self, frontier: Frontier) -> bool:
        sure = frontier.confidence is None or frontier.confidence >= self.options.stop_sure
        return sure and area_left(frontier) < self.options.stop_area


class LayoutNearest(RoomAwareHeuristic[LayoutOptions]):
    """The nearest frontier that need not wait."""

    def candidates(self, decision: Decision) -> Ints:
        """Numbers int64 (k,) of the sizeable frontiers that do not wait."""
        return ready_frontiers(decision, self.options.min_size, self.options.area)


class LookingTour(RoomAwareHeuristic[RoomAwareTourT]):
    """A tour on which the robot may look all around on its way.

    Args:
        name: What it is called in results.
        options: Its parameters.
        looking: What cuts its way into pieces.
    """

    def __init__(self, name: str, options: RoomAwareTourT, looking: LookingAround) -> None:
        super().__init__(name, options)
        self._looking, self._frame = looking, ((0, 0), 0.0, Pose(0.0, 0.0))
        self.remembers = self.remembers or looking.every > 0

    def reset(self, seed: int) -> None:
        """Begin a new run: the robot is on its way to nothing."""
        super().reset(seed)
        self.forget_cells()

    def forget_cells(self) -> None:
        """Forget what is known by its cells: they are those of another grid, or a new run begins."""
        self._looking.forget()

    def choose(self, decision: Decision) -> Choice:
        """Where to go, or the first steps there where the robot looks around then."""
        grid = decision.grid
        frame = grid.shape, grid.resolution, grid.origin
        if frame != self._frame:  # the map of a robot of one's own grows
            self.forget_cells()
            self._frame = frame
        return self._looking.choose(decision, self.plan, anew=self.plans_anew(decision))

    def plans_anew(self, decision: Decision) -> bool:
        """Whether what was seen on the way changes where to go; without news the robot goes on."""
        return False

    def plan(self, decision: Decision) -> Choice:
        """The index of the first frontier of a latency tour over those that need not wait."""
        ready = ready_frontiers(decision, self.options.min_size, self.options.area)
        return int(plan_latency_tour(decision, ready, self.options.patience)[0])


class LayoutTour(LookingTour[LayoutTourOptions]):
    """The first frontier of a latency tour over those that need not wait."""

    def __init__(self, name: str, options: LayoutTourOptions) -> None:
        super().__init__(name, options, LookingAround(options.look_every))


class LayoutGain(RoomAwareHeuristic[LayoutGainOptions]):
    """A exp(-lambda d) (Gonzalez-Banos and Latombe 2002), where A is predicted."""

    def scores(self, among: Candidates) -> Scores:
        """In square metres, up to a factor that all share."""
        return faded(among.table.expected_area, among.table.path_length, self.options.rate)


class ClosedFirst(RoomAwareHeuristic[LayoutOptions]):
    """The nearest closed frontier; an open one only when no closed one is left."""

    def candidates(self, decision: Decision) -> Ints:
        """Numbers int64 (k,) of the sizeable frontiers of the class that goes first."""
        sizeable = super().candidates(decision)
        first = sizeable[self.goes_first(decision.table.closed[sizeable] > 0.0)]
        return first if len(first) else sizeable

    def goes_first(self, closed: Mask) -> Mask:
        """Which frontiers go first, bool (k,), of those that are closed or not, bool (k,)."""
        return closed


class OpenFirst(ClosedFirst):
    """The nearest open frontier; a closed one only when no open one is left."""

    def goes_first(self, closed: Mask) -> Mask:
        """Those that are not closed."""
        return ~closed


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
