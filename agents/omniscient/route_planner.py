"""A short route from which given shares of a known floor plan are seen: a watchman route with quotas.

The route is a list of stops, with a full turn at each and scans on the way. Its first part, up to the *mark*,
meets an early quota; the whole meets the final one. A metre before the mark counts more, since it delays
both. Stops are inserted where they show most new cells per metre of detour until a quota is met, so what is
dear to see is left out. Then stops that the rest makes needless are dropped, stops are moved to where the
detour is shorter and the quotas are still met, the order is improved by 2-opt and Or-opt, and stretches are
taken out and planned anew, keeping what costs less.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from layoutexplore.agents.omniscient.left_to_see import LeftToSee
from layoutexplore.agents.omniscient.places import Places
from layoutexplore.agents.omniscient.route import Route, Stop, cheapest_gaps
from layoutexplore.agents.omniscient.visibility import (
    Bits,
    FloorInView,
    Visibility,
    added_sizes,
    cheapest_enough,
    size,
    size_of_union,
)
from layoutexplore.errors import checks_making
from layoutexplore.frontiers.decision import Truth
from layoutexplore.grids.arrays import Floats, Floats32, Ints, Ints32, Words
from layoutexplore.grids.grid import Cell, in_cells
from layoutexplore.metrics.exploration import FULLY_SEEN, NEARLY_SEEN
from layoutexplore.planning.tours import improve_tour

_SAVING = 1e-3
"""A change of the route must save more than this many (weighted) metres."""
_LEAST_DETOUR = 0.3
"""Metres; a shorter detour counts as this long."""
_SAMPLING_MARGIN = 3e-4
"""What is planned for beyond a quota, because coverage is counted on a sample of the target."""
_SHOWN_IN_PASSING = 0.5
"""Share of what a stop and the ways to it alone show, which the way past it is not expected to exceed."""
_BATCH = 32
"""Candidates of which it is counted at once what they add."""
_STOPS_PLANNED_ANEW = 2400
"""Rounds times stops of the route, at most: with many stops a round is dear."""


@dataclass(frozen=True, kw_only=True)
class RouteConfig:
    """How a route is planned.

    Attributes:
        coverage: Share of the target that the whole route must see, 0..1.
        early_coverage: Share that the part up to the mark must see, 0..1; at most `coverage`.
        early_weight: What a metre before the mark costs more than one after it.
        lattice: Metres between the cells that may become stops.
        scan_spacing: Metres between scans while walking.
        rounds: How many stretches are planned anew; fewer where many stops make a round dear.
        stretch: Greatest share of the stops that a round takes out.
        noise: Standard deviation of the logarithm of a factor on each place's detours in a round, for
            variety.
    """

    coverage: float = FULLY_SEEN
    early_coverage: float = NEARLY_SEEN
    early_weight: float = 1.5
    lattice: float = 0.8
    scan_spacing: float = 0.5
    rounds: int = 30
    stretch: float = 0.3
    noise: float = 0.2


class PlannedRoute(NamedTuple):
    """The stops of a route that lie ahead, int32 (k, 2), and how many of them end its early part."""

    stops: Ints32
    mark: int


NOTHING_PLANNED = PlannedRoute(np.empty((0, 2), np.int32), 0)
"""Where no plan was made yet."""


class Quota(NamedTuple):
    """How much a route is to show: what is planned for, and what is enough of a plan that there is.

    A robot on its way sees a little less than was planned; a way back for that would be long.
    """

    wanted: int
    least: int


@checks_making
class RoutePlanner:
    """Plans routes on a known floor plan.

    Args:
        places: Where it may stop.
        config: How to plan.
    """

    def __init__(self, places: Places, config: RouteConfig | None = None) -> None:
        self.config = config or RouteConfig()
        self.places = places
        self._weight = 1.0 + self.config.early_weight

    @classmethod
    def of(cls, truth: Truth, config: RouteConfig | None = None) -> RoutePlanner:
        """The planner for a true floor plan."""
        config, scene = config or RouteConfig(), FloorInView.of(truth)
        return cls(Places(scene, Visibility(scene, config.scan_spacing), config.lattice), config)

    def plan(self, start: Cell) -> Ints32:
        """The stops int32 (k, 2) of a short route from `start`, which is not one of them."""
        visibility = self.places.visibility
        shares = (min(self.config.early_coverage, self.config.coverage), self.config.coverage)
        quotas = [math.ceil((q + _SAMPLING_MARGIN) * visibility.count) for q in shares]
        seen = self.places.at(start).seen
        route = self._begun(start, seen, NOTHING_PLANNED)
        quotas = [min(q, visibility.count) - size(seen) for q in quotas]
        route = self._improved(route, quotas, self.config.rounds, np.random.default_rng(0))
        self._polish(route, fine=True)
        return route.cells()

    def replan(
        self, start: Cell, seen: Bits, plan: PlannedRoute, quotas: list[Quota], seed: int
    ) -> PlannedRoute:
        """A plan for a robot on its way.

        Args:
            start: Where the robot is.
            seen: What has been seen so far, and what need not be seen.
            plan: The last plan, of which stops may be missing or needless now.
            quotas: How much of all that can be seen must be seen early, and in all.
            seed: Of the stretches that are planned anew.
        """
        route, count = self._begun(start, seen, plan), size(seen)
        counts = [n + count for n in self._counts(route)]
        # A plan is not to show less than it does; one that shows too little is to show all that is wanted.
        wanted = [q.wanted if n < q.least else min(q.wanted, n) for q, n in zip(quotas, counts, strict=True)]
        rng = np.random.default_rng(seed)
        route = self._improved(route, [n - count for n in wanted], self.config.rounds, rng)
        return PlannedRoute(route.cells(), route.mark)

    def _begun(self, start: Cell, seen: Bits, plan: PlannedRoute) -> Route:
        """A route along a plan by one who has seen so much: from now on only what is left to see counts."""
        stops = plan.stops[self.places.traversable[plan.stops[:, 0], plan.stops[:, 1]]]
        self._left = left = LeftToSee(self.places, seen, stops)
        ahead = [left.at(Cell(*cell)) for cell in stops.tolist()]
        return self._linked([left.showing(start, seen), *ahead], min(plan.mark, len(ahead)))

    def _improved(self, route: Route, quotas: list[int], rounds: int, rng: np.random.Generator) -> Route:
        """A route that meets the quotas and is no longer, from one that may do neither."""
        self._quotas = quotas
        self._complete(route)
        # What no stop shows cannot be asked for.
        self._quotas = [min(q, n) for q, n in zip(self._quotas, self._counts(route), strict=True)]
        self._polish(route)
        for _ in range(min(rounds, _STOPS_PLANNED_ANEW // len(route.stops))):
            changed = self._ruined(route, rng)
            noise = rng.standard_normal(len(self._left.cells))
            self._complete(changed, np.exp(self.config.noise * noise))
            if self._cost(changed) < 1.05 * self._cost(route):
                self._polish(changed)
            if self._is_better(changed, route):
                route = changed
        return route

    def _linked(self, stops: list[Stop], mark: int) -> Route:
        return Route(stops, [self._left.leg(a, b) for a, b in itertools.pairwise(stops)], mark)

    # The measure of a route.

    def _cost(self, route: Route) -> float:
        """Its length in metres, those up to the mark weighted."""
        lengths = [leg.length for leg in route.legs]
        return self._weight * sum(lengths[: route.mark]) + sum(lengths[route.mark :])

    def _counts(self, route: Route) -> tuple[int, int]:
        """How many cells are seen up to the mark and in all."""
        heads = route.heads()
        return size(heads[route.mark]), size(heads[-1])

    def _is_better(self, changed: Route, route: Route) -> bool:
        enough = all(n >= q for n, q in zip(self._counts(changed), self._quotas, strict=True))
        return enough and self._cost(changed) < self._cost(route) - _SAVING

    # Construction.

    def _complete(self, route: Route, factors: Floats | float = 1.0) -> None:
        """Insert stops until both quotas are met or nothing adds; detours count times the factors."""
        for early in (True, False):
            while self._complete_part(route, factors, early=early):
                pass

    def _complete_part(self, route: Route, factors: Floats | float, *, early: bool) -> bool:
        """Insert stops until one quota seems met (what replaced legs showed counts); whether any was."""
        seen = route.heads()[route.mark if early else -1]
        quota = self._quotas[0 if early else 1]
        if size(seen) >= quota or not len(self._left.cells):
            return False
        bounds = added_sizes(self._left.views, np.arange(len(self._left.views)), seen)
        inserted = False
        while (needed := quota - size(seen)) > 0:
            detours, gaps = self._detours(route, early=early)
            best = self._best_candidate(bounds, np.maximum(detours, _LEAST_DETOUR) * factors, seen, needed)
            if bounds[best] <= 0:
                break
            gap = int(gaps[best])
            route.mark += early or gap < route.mark
            seen = seen | self._insert(route, gap, self._left.stop(best))
            inserted = True
        return inserted

    def _best_candidate(self, bounds: Ints, detours: Floats, seen: Bits, needed: int) -> int:
        """The candidate that adds most cells per metre; what one adds only shrinks: old counts are bounds."""
        values = np.minimum(bounds, needed) / detours
        fresh = np.zeros(len(values), np.bool_)
        while True:
            top = np.argpartition(-values, min(_BATCH, len(values)) - 1)[:_BATCH]
            best = int(top[np.lexsort((top, -values[top]))[0]])
            if fresh[best]:
                return best
            stale = top[~fresh[top]]
            bounds[stale] = added_sizes(self._left.views, stale, seen)
            values[stale] = np.minimum(bounds[stale], needed) / detours[stale]
            fresh[stale] = True

    def _detours(self, route: Route, *, early: bool) -> tuple[Floats, Ints]:
        """Weighted metres float64 (n,) that a stop in each lattice cell adds, and its best gap int64 (n,).

        Gap i lies behind stop i. An early stop comes before the mark or becomes the new mark.
        """
        gaps = route.mark + 1 if early else len(route.stops)
        near = np.array([stop.lattice for stop in route.stops[: gaps + 1]])
        lengths = np.array([leg.length for leg in route.legs[:gaps]])
        to = np.where(np.arange(gaps) < route.mark + early, self._weight, 1.0)
        on = np.where(np.arange(gaps) < route.mark, self._weight, 1.0)
        return cheapest_gaps(near, lengths, to, on)

    def _insert(self, route: Route, gap: int, stop: Stop) -> Bits:
        """Put a stop into a gap; what it and the ways to and from it show."""
        route.stops.insert(gap + 1, stop)
        legs = [self._left.leg(a, b) for a, b in itertools.pairwise(route.stops[gap : gap + 3])]
        route.legs[gap : gap + 1] = legs
        # Beyond the mark nothing is seen early.
        counted = legs[:1] if gap + 1 == route.mark else legs
        seen: Bits = np.bitwise_or.reduce([stop.seen, *(leg.seen for leg in counted)], axis=0)
        return seen

    # Improvement.

    def _polish(self, route: Route, *, fine: bool = False) -> None:
        """Reorder, drop and move stops until that saves next to nothing."""
        while True:
            before = self._cost(route)
            self._reorder(route)
            self._drop(route)
            self._shift(route, fine=fine)
            if self._cost(route) > before - 0.1:
                return

    def _reorder(self, route: Route) -> None:
        """Improve the order on each side of the mark, if that pays with what the quotas then need."""
        head = self._shortened(route.stops[: route.mark + 1])
        tail = self._shortened([head[-1], *route.stops[route.mark + 1 :]])
        changed = self._linked(head + tail[1:], route.mark)
        self._complete(changed)
        if self._is_better(changed, route):
            route.stops, route.legs, route.mark = changed.stops, changed.legs, changed.mark

    def _shortened(self, stops: list[Stop]) -> list[Stop]:
        """The same stops from the same first one, in a short order."""
        if len(stops) < 3:
            return stops
        matrix = self._left.matrix(stops)
        return [stops[0], *(stops[i] for i in improve_tour(matrix, np.arange(1, len(stops))))]

    def _drop(self, route: Route) -> None:
        """Leave out stops, the most costly detour first, as long as the quotas are met without them."""
        while len(route.stops) > 1 and (i := self._needless(route)) > 0:
            stops = route.stops
            route.legs[i - 1 : i + 1] = (
                [self._left.leg(stops[i - 1], stops[i + 1])] if i + 1 < len(stops) else []
            )
            route.mark -= i <= route.mark
            del stops[i]

    def _needless(self, route: Route) -> int:
        """The stop of the most costly detour without which the quotas are met; -1 when there is none."""
        stops, mark = route.stops, route.mark
        heads, early_tails, tails = route.heads(), route.tails(mark), route.tails()
        savings = np.array([self._saving(route, i) for i in range(1, len(stops))])
        whole = size(heads[-1])
        for i in np.argsort(-savings, kind="stable") + 1:
            if savings[i - 1] < 0:
                break
            before, is_last = heads[i - 1], i + 1 == len(stops)
            tail = before if is_last else tails[i + 1]
            rest = size_of_union(before, before, tail)
            if self._quotas[1] - rest > _SHOWN_IN_PASSING * (whole - rest):
                continue
            leg = before if is_last else self._left.leg(stops[i - 1], stops[i + 1]).seen
            if size_of_union(before, leg, tail) < self._quotas[1]:
                continue
            early = size_of_union(before, leg, early_tails[i + 1]) if i < mark else size(before)
            if i > mark or early >= self._quotas[0]:
                return int(i)
        return -1

    def _saving(self, route: Route, i: int) -> float:
        """Weighted metres saved by leaving out stop i."""
        to = self._weight if i <= route.mark else 1.0
        saved = to * route.legs[i - 1].length
        if i + 1 < len(route.stops):
            on = self._weight if i < route.mark else 1.0
            saved += on * (route.legs[i].length - self._left.apart(route.stops[i - 1], route.stops[i + 1]))
        return saved

    def _shift(self, route: Route, *, fine: bool) -> None:
        """Move every stop to the cell with the least costly detour from which the quotas are still met."""
        early_tails, tails = route.tails(route.mark), route.tails()
        head = route.stops[0].seen
        for i in range(1, len(route.stops)):
            total = head | tails[i + 1] if i + 1 < len(route.stops) else head
            early = head | early_tails[i + 1] if i < route.mark else head
            limits = [(total, self._quotas[1] - size(total))]
            if i <= route.mark:
                limits.append((early, self._quotas[0] - size(early)))
            ends = [route.stops[i - 1], *route.stops[i + 1 : i + 2]]
            near = [stop.lattice for stop in ends]
            row = self._cheapest(route, i, near, self._left.views, limits)
            if row >= 0:
                self._replace(route, i, self._left.stop(row))
            if fine:
                self._shift_finely(route, i, ends, limits)
            head = head | route.legs[i - 1].seen | route.stops[i].seen

    def _shift_finely(self, route: Route, i: int, ends: list[Stop], limits: list[tuple[Bits, int]]) -> None:
        """Move stop i between its neighbours `ends` to the best traversable cell within a lattice step."""
        step = in_cells(self.config.lattice, self.places.resolution)
        row, col = (max(0, at - step) for at in route.stops[i].cell)
        window = self.places.traversable[row : row + 2 * step + 1, col : col + 2 * step + 1]
        cells = (np.argwhere(window) + np.array([row, col])).astype(np.int32)
        near = [self.places.field(stop.cell)[cells[:, 0], cells[:, 1]] for stop in ends]
        views = self.places.visibility.turning(cells)
        row = self._cheapest(route, i, near, self._left.of(views), limits)
        if row >= 0:
            self._replace(route, i, self._left.showing(Cell(*cells[row].tolist()), views[row]))

    def _cheapest(
        self, route: Route, i: int, near: list[Floats32], views: Words, limits: list[tuple[Bits, int]]
    ) -> int:
        """The candidate that costs least in the place of stop i and shows enough; -1 where none costs less.

        `near` holds metres float32 (n,) to each candidate from the stop before and, if there is one, the stop
        after; `views` uint64 (n, words) is what they show.
        """
        weights = np.array([self._weight if at <= route.mark else 1.0 for at in (i, i + 1)])[: len(near)]
        legs = np.array([leg.length for leg in route.legs[i - 1 : i + 1]])
        return cheapest_enough(views, np.array(near), weights, float(weights @ legs) - _SAVING, limits)

    def _replace(self, route: Route, i: int, stop: Stop) -> None:
        """Put another stop in the place of stop i."""
        route.stops[i] = stop
        legs = [self._left.leg(a, b) for a, b in itertools.pairwise(route.stops[i - 1 : i + 2])]
        route.legs[i - 1 : i + 1] = legs

    def _ruined(self, route: Route, rng: np.random.Generator) -> Route:
        """The route without a random stretch, or without the stops around a random one."""
        count = len(route.stops) - 1
        if count < 2:
            return self._linked(route.stops[:1], 0)
        few = int(rng.integers(1, max(2, math.ceil(self.config.stretch * count)) + 1))
        middle = int(rng.integers(1, count + 1))
        if rng.random() < 0.5:
            gone = set(range(middle, middle + few))
        else:
            away = np.array([self._left.apart(route.stops[middle], stop) for stop in route.stops[1:]])
            gone = {int(i) + 1 for i in np.argsort(away, kind="stable")[:few]}
        kept = [i for i in range(count + 1) if i not in gone]
        return self._linked([route.stops[i] for i in kept], sum(i <= route.mark for i in kept) - 1)
