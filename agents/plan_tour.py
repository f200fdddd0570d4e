"""A tour over known and foreseen space: viewpoints from which unseen rooms are seen, planned anew on the way.

A route is planned through what is known and what is foreseen, with stops from which the foreseen rooms are
seen and stops at the frontiers behind which nothing is foreseen. The robot walks to its first stop as far as
the way is known, or until it has seen what was to be seen from there, looks, and plans anew. What is not as
foreseen counts no longer as soon as it was looked at.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from layoutexplore.agents.base import register
from layoutexplore.agents.foreseen_floor import ForeseenFloor
from layoutexplore.agents.omniscient.route_planner import (
    NOTHING_PLANNED,
    PlannedRoute,
    Quota,
    RouteConfig,
    RoutePlanner,
)
from layoutexplore.agents.watchful_tour import ReplannedTour, ReplannedTourOptions
from layoutexplore.frontiers.decision import Choice, Decision, Walk
from layoutexplore.frontiers.foresight import Foresight
from layoutexplore.grids.arrays import Ints32
from layoutexplore.grids.grid import Cell
from layoutexplore.metrics.exploration import FULLY_SEEN, NEARLY_SEEN
from layoutexplore.options import option
from layoutexplore.simulation.looking_around import LOOK_EVERY

NEAR_WAY = 2.0
"""Metres: a frontier at most so far from where a path leaves what is known is in its way."""

PATIENCE, FAR = 3, 6.0
"""Stops for which the robot has set out and seen nothing of what is left, after which the next one is given
up if it has walked so many metres more than the way to the farthest of them."""

TO_AND_FRO = 3
"""The same where there were fewer stops: ways as long as the longest."""

MANY, LEAST_STEP = 12, 0.2
"""Decisions in which the robot hardly walks: less than so many metres each."""

ATTEMPTS = 3
"""Plans at a decision, each without the stops of the last one that the robot cannot set out for."""

FINISHES = (FULLY_SEEN, 0.994, 0.997, 1.0)
"""Shares of what is known and foreseen that a plan ends at: the next one where one is met already."""

ENOUGH, MARGIN = 0.0003, 0.0012
"""Shares of the floor beyond those that a run is measured by: a plan that shows the first more is kept, a new
one shows the second more besides while much is left to see.

Scans on the way show a little less than was planned, and the way back for a tenth of a per cent is long.
"""

CERTAIN_ROUNDS, CERTAIN_FIRST_ROUNDS = 6, 60
"""Stretches that are planned anew at a decision, and at the first one, where what is foreseen is certain."""

MUCH = 0.3
"""Share of the floor: where so much is left to see, all of `MARGIN` is planned for."""


@dataclass(frozen=True, kw_only=True)
class PlanTourOptions(ReplannedTourOptions):
    """Parameters of `PlanTour`."""

    sure: float = option(
        0.0,
        "confidence from which foresight is relied on, beyond what its predictor asks for",
        low=0.0,
        high=1.0,
    )
    early: float = option(0.3, "what a metre before 95 % costs more than one after it", low=0.0)
    early_sure: float = option(0.3, "the same where what is foreseen is certain", low=0.0)
    rounds: int = option(
        3,
        "stretches of the route that are planned anew at a decision; at least 6 where foresight is certain",
        low=0,
    )
    first_rounds: int = option(
        10, "the same at the first decision with foresight; at least 60 where it is certain", low=0
    )
    look_every: float = option(0.5, LOOK_EVERY, low=0.0)
    lattice: float = option(0.8, "metres between places where the route may stop", low=0.2)


class PlanTour(ReplannedTour[PlanTourOptions]):
    """The first stop of a route over known and foreseen space; that of `watchful-tour` without foresight."""

    remembers = True

    def __init__(self, name: str, options: PlanTourOptions) -> None:
        super().__init__(name, options, options.look_every)
        self.reset(0)

    def forget_cells(self) -> None:
        """Begin anew: nothing is foreseen yet."""
        super().forget_cells()
        self._floor: ForeseenFloor | None = None
        self._plan, self._plans = NOTHING_PLANNED, 0
        self._arriving: Cell | None = None
        self._left, self._idle, self._idle_from, self._farthest = -1, 0, 0.0, 0.0
        self._aims: set[Cell] = set()

    def plan(self, decision: Decision) -> Choice:
        """A path to the first stop, or the frontier that it stands for or that is in the way."""
        foresight = self._relied_on(decision)
        choice = None if foresight is None else self._follow(decision, foresight)
        return super().plan(decision) if choice is None else choice

    def _relied_on(self, decision: Decision) -> Foresight | None:
        """What is foreseen, where the agent is sure enough of it."""
        foresight = decision.foresight
        return None if foresight is None or foresight.confidence < self.options.sure else foresight

    def _follow(self, decision: Decision, foresight: Foresight) -> Choice | None:
        """The way along the route; None where all is seen that is foreseen, or it cannot be gone to."""
        is_first = self._floor is None
        self._floor = floor = self._floor or ForeseenFloor(self.options.lattice, self.options.doubted)
        floor.update(decision, foresight)
        here = decision.grid.nearest_cell(decision.pose.x, decision.pose.y)
        self._learn(floor, here, decision.distance)
        config = self._config(is_first=is_first, is_certain=foresight.confidence >= 1.0)
        for _ in range(ATTEMPTS):
            self._plans += 1
            planner = RoutePlanner(floor.places, config)
            for share in FINISHES:
                quotas = _quotas(floor, share)
                self._plan = planner.replan(here, floor.seen, self._ahead(here), quotas, self._plans)
                if len(self._plan.stops):
                    break
            else:
                return None
            stop = Cell(*self._plan.stops[0].tolist())
            path = floor.places.path(here, stop)
            length = float(np.hypot(*np.diff(path, axis=0).T).sum()) * decision.grid.resolution
            self._farthest = max(self._farthest, length)
            self._aims.add(stop)
            choice = self._towards(decision, floor, path, stop)
            if choice is not None:
                return choice
            floor.give_up(floor.places.at(stop).seen)
        return None

    def _config(self, *, is_first: bool, is_certain: bool) -> RouteConfig:
        """How to plan: the end of a doubtful plan is hardly walked as it is planned, its beginning counts."""
        rounds = self.options.first_rounds if is_first else self.options.rounds
        if not is_certain:
            return RouteConfig(early_weight=self.options.early, rounds=rounds)
        rounds = max(rounds, CERTAIN_FIRST_ROUNDS if is_first else CERTAIN_ROUNDS)
        return RouteConfig(early_weight=self.options.early_sure, rounds=rounds)

    def _ahead(self, here: Cell) -> PlannedRoute:
        """The last plan without the stop that has been reached."""
        stops, mark = self._plan
        if len(stops) and tuple(stops[0]) == here:
            return PlannedRoute(stops[1:], max(mark - 1, 0))
        return self._plan

    def _learn(self, floor: ForeseenFloor, here: Cell, metres: float) -> None:
        """What a stop was to show and did not show is not there; the robot has walked so many metres."""
        if self._arriving == here:
            floor.give_up(floor.places.at(here).seen)
        self._arriving = None
        if floor.left != self._left:
            self._left = floor.left
            self._begin_again(metres)
        else:
            self._idle += 1
        walked = metres - self._idle_from
        # A long way to one stop through known rooms is no mistake; to and fro between two of them is.
        ways = 1 if len(self._aims) >= PATIENCE else TO_AND_FRO
        is_astray = walked >= FAR + ways * self._farthest
        is_stuck = self._idle >= MANY and walked < LEAST_STEP * self._idle
        if (is_astray or is_stuck) and len(self._plan.stops):
            floor.give_up(floor.places.at(Cell(*self._plan.stops[0].tolist())).seen)
            self._begin_again(metres)

    def _begin_again(self, metres: float) -> None:
        """From now on it counts for what the robot sets out and how far it walks."""
        self._idle, self._idle_from, self._farthest = 0, metres, 0.0
        self._aims.clear()

    def _towards(self, decision: Decision, floor: ForeseenFloor, path: Ints32, stop: Cell) -> Choice | None:
        """The way to a stop as far as it is known, or the frontier to go to; None when there is neither."""
        frontier = floor.frontier_of(floor.places.at(stop).seen)
        if frontier is not None:
            return frontier
        if len(path) < 2:
            return None
        known = decision.traversable[path[:, 0], path[:, 1]]
        known[0] = True
        count = len(path) if known.all() else int(np.argmin(known))
        if count < 2:
            return _frontier_near(decision, path[1])
        self._arriving = stop if count == len(path) else None
        sights = floor.left_in(floor.places.at(stop).seen)
        return Walk(path[:count], sights) if len(sights) else path[:count]


def _quotas(floor: ForeseenFloor, share: float) -> list[Quota]:
    """How much is to be seen early, and in all by a plan that ends at a share."""
    shares = min(NEARLY_SEEN, share), share
    spare = MARGIN * min(1.0, floor.left_share / MUCH)
    least = floor.quotas(*(min(q + ENOUGH, 1.0) for q in shares))
    wanted = floor.quotas(*(min(q + ENOUGH + spare, 1.0) for q in shares))
    return [Quota(*both) for both in zip(wanted, least, strict=True)]


def _frontier_near(decision: Decision, cell: Ints32) -> int | None:
    """The frontier that has the cell nearest to a cell (2,); None when that is far."""
    clusters = decision.clusters
    away = np.hypot(*(clusters.cells - cell).T)
    nearest = int(np.argmin(away))
    if away[nearest] * decision.grid.resolution > NEAR_WAY:
        return None
    return int(np.searchsorted(clusters.offsets, nearest, side="right")) - 1


register(
    "plan-tour",
    "a route over known and foreseen space; watchful-tour where nothing is foreseen",
    PlanTour,
    PlanTourOptions(),
)
