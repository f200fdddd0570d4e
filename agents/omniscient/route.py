"""A route on a known floor plan: its stops, the legs between them, and what is seen by when."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from layoutexplore.agents.omniscient.visibility import Bits
from layoutexplore.grids.arrays import Floats, Floats32, Ints, Ints32, Words
from layoutexplore.grids.grid import Cell


@dataclass(eq=False)
class Stop:
    """A place where the robot turns fully.

    Attributes:
        cell: Where it is.
        index: Its number among the cells that may become stops; -1 when it is none of them.
        lattice: float32 (n,), path lengths in metres to the cells that may become stops.
        seen: What a full turn there shows.
    """

    cell: Cell
    index: int
    lattice: Floats32
    seen: Bits


@dataclass(eq=False)
class Leg:
    """The path between two stops: its length in metres, and what the scans on it show."""

    length: float
    seen: Bits


@dataclass(eq=False)
class Route:
    """Stops and the legs between them; stop 0 is the start, and the stop `mark` ends the early part."""

    stops: list[Stop]
    legs: list[Leg]
    mark: int

    def cells(self) -> Ints32:
        """The stops int32 (k, 2), without the start."""
        return np.array([stop.cell for stop in self.stops[1:]], np.int32).reshape(-1, 2)

    def heads(self) -> Words:
        """What is seen up to each stop, it included: uint64 (stops, words)."""
        return _joined(*self._sets(len(self.stops)))

    def tails(self, end: int | None = None) -> Words:
        """What is seen from each stop on, it included, up to the stop `end` (the last one by default)."""
        stops, legs = self._sets(len(self.stops) if end is None else end + 1)
        return _joined(np.ascontiguousarray(stops[::-1]), np.ascontiguousarray(legs[::-1]))[::-1]

    def _sets(self, count: int) -> tuple[Words, Words]:
        """What the first stops uint64 (k, words) and the legs between them uint64 (k - 1, words) show."""
        stops = np.array([stop.seen for stop in self.stops[:count]])
        legs = np.array([leg.seen for leg in self.legs[: count - 1]], np.uint64)
        return stops, legs.reshape(len(stops) - 1, stops.shape[1])


@njit(cache=True, nogil=True)
def _joined(stops: Words, legs: Words) -> Words:
    """What is seen up to each stop uint64 (k, words), of stops (k, words) and legs (k - 1, words)."""
    joined = stops.copy()
    for i in range(1, len(stops)):
        for w in range(stops.shape[1]):
            joined[i, w] |= joined[i - 1, w] | legs[i - 1, w]
    return joined


@njit(cache=True, nogil=True)
def cheapest_gaps(near: Floats32, lengths: Floats, to: Floats, on: Floats) -> tuple[Floats, Ints]:
    """Where each candidate for a stop is best inserted.

    Args:
        near: float32 (stops, n), metres from each stop of the route to each candidate.
        lengths: float64 (stops - 1,) or more, metres of the legs between the stops.
        to: float64 (gaps,), weight of the new leg from stop i to the candidate; gap i lies behind stop i, and
            the last gap may lie behind the last stop.
        on: float64 (gaps,), weight of the leg that is replaced, and of the one from the candidate to the next
            stop.

    Returns:
        float64 (n,) weighted metres that it adds, and int64 (n,) the gap; of equal ones the first.
    """
    count = near.shape[1]
    best = np.full(count, np.inf)
    gaps = np.zeros(count, np.int64)
    for i in range(len(to)):
        inner = i + 1 < near.shape[0]  # behind the last stop no leg is replaced
        for k in range(count):
            added = to[i] * near[i, k]
            if inner:
                added += on[i] * (near[i + 1, k] - lengths[i])
            if added < best[k]:
                best[k] = added
                gaps[k] = i
    return best, gaps
