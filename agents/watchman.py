"""A short route from which a given share of a known floor plan is seen: a watchman route with a quota.

The route is a list of stops, with a full turn at each and scans on the way. Stops are inserted where they show most new
cells per metre of detour until the quota is met, so what is dear to see is left out. Then stops that the rest makes
needless are dropped, stops are moved to where the detour is shorter and the quota still met, the order is improved by
2-opt and Or-opt, and stretches of the route are taken out and planned anew, keeping what is shorter.
"""

from __future__ import annotations

import itertools
import math
from collections import OrderedDict
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from layoutexplore.agents.local_search import improve_tour
from layoutexplore.agents.sight import Bits, Sight, added_sizes, size
from layoutexplore.decision import Truth
from layoutexplore.grid import Cell
from layoutexplore.planning import descend, geodesic_distances

_LEAST_DETOUR = 0.3
"""Metres; a shorter detour counts as this long."""
_BATCH = 32
_SAVING = 1e-3
"""A change of the route must save more than this many metres."""


@dataclass(frozen=True, kw_only=True)
class RouteConfig:
    """How a route is planned.

    Attributes:
        coverage: Share of the target that must be seen, 0..1.
        lattice: Metres between the cells that may become stops.
        scan_spacing: Metres between scans while walking.
        rounds: How many stretches are planned anew.
        stretch: Greatest share of the stops that a round takes out.
    """

    coverage: float = 0.99
    lattice: float = 0.8
    scan_spacing: float = 0.5
    rounds: int = 12
    stretch: float = 0.3


@dataclass(eq=False)
class _Stop:
    """A stop: its cell, distances from it (all cells; the lattice), and what a full turn there shows."""

    cell: Cell
    distances: NDArray[np.float32]
    lattice: NDArray[np.float32]
    seen: Bits


@dataclass(eq=False)
class _Leg:
    """The way between two stops: metres, and what the scans on it show."""

    length: float
    seen: Bits


@dataclass(eq=False)
class _Route:
    stops: list[_Stop]
    legs: list[_Leg] = field(default_factory=list)

    @property
    def length(self) -> float:
        return sum(leg.length for leg in self.legs)

    def heads(self) -> list[Bits]:
        """What is seen up to each stop, it included."""
        sets = [self.stops[0].seen]
        for leg, stop in zip(self.legs, self.stops[1:], strict=True):
            sets.append(sets[-1] | leg.seen | stop.seen)
        return sets

    def tails(self) -> list[Bits]:
        """What is seen from each stop on, it included."""
        sets = [self.stops[-1].seen]
        for leg, stop in zip(self.legs[::-1], self.stops[-2::-1], strict=True):
            sets.append(sets[-1] | leg.seen | stop.seen)
        return sets[::-1]

    def seen(self) -> Bits:
        """All that is seen."""
        return self.heads()[-1]


class WatchmanPlanner:
    """Plans routes on a known floor plan.

    Args:
        truth: The floor plan, what is to be seen and from where, and the sensor.
        config: How to plan.
    """

    def __init__(self, truth: Truth, config: RouteConfig | None = None) -> None:
        self.config = config or RouteConfig()
        self.sight = Sight(truth, self.config.scan_spacing)
        self.resolution = truth.raster.resolution
        self.traversable = np.ascontiguousarray(truth.reachable)
        self.cells = _lattice(self.traversable, max(1, round(self.config.lattice / self.resolution)))
        self.views = self.sight.turning(self.cells)
        # The sample of the target is a third of its cells: a little more than the quota makes up for that.
        self.quota = min(self.sight.count, math.ceil((self.config.coverage + 3e-4) * self.sight.count))
        self._legs: OrderedDict[tuple[Cell, Cell], _Leg] = OrderedDict()

    def plan(self, start: Cell) -> NDArray[np.int32]:
        """The stops int32 (k, 2) of a short route from `start`, which is not one of them."""
        rng = np.random.default_rng(0)
        route = _Route([self._stop(start, self.sight.turning(np.array([start], np.int32))[0])])
        self._complete(route)
        self._polish(route)
        print("first", route.length)
        for _ in range(self.config.rounds):
            changed = self._ruined(route, rng)
            self._complete(changed)
            if changed.length < route.length * 1.05:
                self._polish(changed)
            if changed.length < route.length - _SAVING and size(changed.seen()) >= min(self.quota, size(route.seen())):
                route = changed
                print(_, route.length, len(route.stops))
        self._polish(route, fine=True)
        print("fine", route.length)
        return np.array([stop.cell for stop in route.stops[1:]], np.int32).reshape(-1, 2)

    # ---- parts of a route

    def _stop(self, cell: Cell, seen: Bits) -> _Stop:
        distances = geodesic_distances(self.traversable, cell, self.resolution)
        return _Stop(cell, distances, distances[self.cells[:, 0], self.cells[:, 1]], seen)

    def _leg(self, start: _Stop, end: _Stop) -> _Leg:
        key = (start.cell, end.cell)
        if key not in self._legs:
            path = descend(start.distances, self.traversable, end.cell)
            self._legs[key] = _Leg(float(start.distances[end.cell]), self.sight.walking(path))
            if len(self._legs) > 4000:
                self._legs.popitem(last=False)
        return self._legs[key]

    def _linked(self, stops: list[_Stop]) -> _Route:
        return _Route(stops, [self._leg(a, b) for a, b in itertools.pairwise(stops)])

    # ---- construction

    def _complete(self, route: _Route) -> None:
        """Insert stops, the most new cells per metre of detour first, until the quota is met or nothing new is in reach."""
        seen = route.seen()
        bounds = added_sizes(self.views, np.arange(len(self.cells)), seen)
        while True:
            needed = self.quota - size(seen)
            if needed <= 0:
                # A leg that was replaced may have shown what nothing else shows.
                seen = route.seen()
                needed = self.quota - size(seen)
                if needed <= 0:
                    return
                bounds = added_sizes(self.views, np.arange(len(self.cells)), seen)
            detours, gaps = self._detours(route)
            best = self._best_candidate(bounds, np.maximum(detours, _LEAST_DETOUR), seen, needed)
            if bounds[best] <= 0:
                return
            stop = self._stop(Cell(*map(int, self.cells[best])), self.views[best])
            seen = seen | self._insert(route, int(gaps[best]), stop)

    def _best_candidate(self, bounds: NDArray[np.int64], detours: NDArray[np.float64], seen: Bits, needed: int) -> int:
        """The candidate that adds most cells per metre; what one adds only shrinks, so old counts are upper bounds."""
        values = np.minimum(bounds, needed) / detours
        fresh = np.zeros(len(values), np.bool_)
        while True:
            top = np.argpartition(-values, min(_BATCH, len(values)) - 1)[:_BATCH]
            best = int(top[np.lexsort((top, -values[top]))[0]])
            if fresh[best]:
                return best
            stale = top[~fresh[top]]
            bounds[stale] = added_sizes(self.views, stale, seen)
            values[stale] = np.minimum(bounds[stale], needed) / detours[stale]
            fresh[stale] = True

    def _detours(self, route: _Route) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Metres float64 (n,) that a stop in each lattice cell adds, and the leg int64 (n,) where it is best inserted."""
        near = np.array([stop.lattice for stop in route.stops], np.float64)
        extra = near.copy()
        extra[:-1] += near[1:] - np.array([leg.length for leg in route.legs])[:, None]
        gaps = extra.argmin(axis=0)
        return extra[gaps, np.arange(extra.shape[1])], gaps

    def _insert(self, route: _Route, gap: int, stop: _Stop) -> Bits:
        """Put a stop into a gap; what it and the ways to and from it show."""
        route.stops.insert(gap + 1, stop)
        route.legs[gap : gap + 1] = [self._leg(a, b) for a, b in itertools.pairwise(route.stops[gap : gap + 3])]
        return np.bitwise_or.reduce([stop.seen, *(leg.seen for leg in route.legs[gap : gap + 2])], axis=0)

    # ---- improvement

    def _polish(self, route: _Route, *, fine: bool = False) -> None:
        """Drop, move and reorder stops until nothing gets shorter."""
        while True:
            before = route.length
            self._reorder(route)
            self._drop(route)
            self._shift(route, fine=fine)
            if route.length > before - 0.1:
                return

    def _reorder(self, route: _Route) -> None:
        """Improve the order of the stops, if what is seen on the way still meets the quota."""
        if len(route.stops) < 3:
            return
        matrix = np.array([[a.distances[b.cell] for b in route.stops] for a in route.stops], np.float64)
        order = improve_tour(matrix, np.arange(1, len(route.stops)))
        changed = self._linked([route.stops[0], *(route.stops[i] for i in order)])
        self._complete(changed)
        if changed.length < route.length - _SAVING:
            route.stops, route.legs = changed.stops, changed.legs

    def _drop(self, route: _Route) -> None:
        """Leave out stops, the longest detour first, as long as the quota is met without them."""
        quota = min(self.quota, size(route.seen()))
        i = 0
        while i >= 0 and len(route.stops) > 1:
            i = self._needless(route, quota)
            if i > 0:
                stops = route.stops
                route.legs[i - 1 : i + 1] = [self._leg(stops[i - 1], stops[i + 1])] if i + 1 < len(stops) else []
                del stops[i]

    def _needless(self, route: _Route, quota: int) -> int:
        """The stop with the longest detour among those without which the quota is met; -1 when there is none."""
        stops = route.stops
        heads, tails = route.heads(), route.tails()
        savings = np.array([self._saving(route, i) for i in range(1, len(stops))])
        for i in np.argsort(-savings, kind="stable") + 1:
            seen = heads[i - 1]
            if i + 1 < len(stops):
                seen = seen | self._leg(stops[i - 1], stops[i + 1]).seen | tails[i + 1]
            if size(seen) >= quota:
                return int(i)
        return -1

    def _saving(self, route: _Route, i: int) -> float:
        if i + 1 == len(route.stops):
            return route.legs[i - 1].length
        across = float(route.stops[i - 1].distances[route.stops[i + 1].cell])
        return route.legs[i - 1].length + route.legs[i].length - across

    def _shift(self, route: _Route, *, fine: bool) -> None:
        """Move every stop to the cell with the shortest detour from which the quota is still met."""
        quota = min(self.quota, size(route.seen()))
        tails = route.tails()
        head = route.stops[0].seen
        for i in range(1, len(route.stops)):
            others = head | tails[i + 1] if i + 1 < len(route.stops) else head
            needed = quota - size(others)
            for lattice in (True, False)[: 1 + fine]:
                self._shift_one(route, i, others, needed, lattice=lattice)
            head = head | route.legs[i - 1].seen | route.stops[i].seen

    def _shift_one(self, route: _Route, i: int, others: Bits, needed: int, *, lattice: bool) -> None:
        before, stop = route.stops[i - 1], route.stops[i]
        after = route.stops[i + 1] if i + 1 < len(route.stops) else None
        now = route.legs[i - 1].length + (route.legs[i].length if after else 0.0)
        cells = self.cells if lattice else self._around(stop.cell)
        lengths = before.distances[cells[:, 0], cells[:, 1]].astype(np.float64)
        if after:
            lengths += after.distances[cells[:, 0], cells[:, 1]]
        shorter = np.flatnonzero(lengths < now - _SAVING)
        views = self.views if lattice else self.sight.turning(cells[shorter])
        rows = shorter if lattice else np.arange(len(shorter))
        enough = np.flatnonzero(added_sizes(views, rows, others) >= needed)
        if len(enough):
            best = enough[np.argmin(lengths[shorter[enough]])]
            route.stops[i] = self._stop(Cell(*map(int, cells[shorter[best]])), views[rows[best]])
            route.legs[i - 1] = self._leg(before, route.stops[i])
            if after:
                route.legs[i] = self._leg(route.stops[i], after)

    def _around(self, cell: Cell) -> NDArray[np.int32]:
        """Traversable cells int32 (n, 2) within a lattice step."""
        step = max(1, round(self.config.lattice / self.resolution))
        row, col = max(0, cell.row - step), max(0, cell.col - step)
        window = self.traversable[row : cell.row + step + 1, col : cell.col + step + 1]
        cells: NDArray[np.int32] = (np.argwhere(window) + np.array([row, col])).astype(np.int32)
        return cells

    def _ruined(self, route: _Route, rng: np.random.Generator) -> _Route:
        """The route without a random stretch or without the stops around a random one."""
        count = len(route.stops) - 1
        if count < 2:
            return self._linked(route.stops[:1])
        few = int(rng.integers(1, max(2, math.ceil(self.config.stretch * count)) + 1))
        if rng.random() < 0.5:
            first = int(rng.integers(1, count + 1))
            gone = set(range(first, first + few))
        else:
            middle = route.stops[int(rng.integers(1, count + 1))]
            away = np.array([middle.distances[stop.cell] for stop in route.stops[1:]])
            gone = {int(i) + 1 for i in np.argsort(away, kind="stable")[:few]}
        return self._linked([stop for i, stop in enumerate(route.stops) if i not in gone])


def _lattice(traversable: NDArray[np.bool_], step: int) -> NDArray[np.int32]:
    """int32 (n, 2): one traversable cell, the one nearest the middle, of every step x step block that has any."""
    cells = np.argwhere(traversable)
    blocks = cells // step
    off = np.abs(cells - blocks * step - (step - 1) / 2).max(axis=1)
    order = np.lexsort((off, blocks[:, 1], blocks[:, 0]))
    blocks = blocks[order]
    first = np.ones(len(order), np.bool_)
    first[1:] = (blocks[1:] != blocks[:-1]).any(axis=1)
    return cells[order[first]].astype(np.int32)
