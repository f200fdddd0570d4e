"""A route on a known floor plan: its stops, the legs between them, and what is seen by when."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from layoutexplore.agents.sight import Bits
from layoutexplore.grid import Cell


@dataclass(eq=False)
class Stop:
    """A place where the robot turns fully.

    Attributes:
        cell: Where it is.
        distances: float32 (rows, cols), path lengths from it in metres.
        lattice: float32 (n,), those to the cells that may become stops.
        seen: What a full turn there shows.
    """

    cell: Cell
    distances: NDArray[np.float32]
    lattice: NDArray[np.float32]
    seen: Bits


@dataclass(eq=False)
class Leg:
    """The way between two stops: metres, and what the scans on it show."""

    length: float
    seen: Bits


@dataclass(eq=False)
class Route:
    """Stops and the legs between them; stop 0 is the start, and the stop `mark` ends the early part."""

    stops: list[Stop]
    legs: list[Leg]
    mark: int

    def heads(self) -> list[Bits]:
        """What is seen up to each stop, it included."""
        sets = [self.stops[0].seen]
        for leg, stop in zip(self.legs, self.stops[1:], strict=True):
            sets.append(sets[-1] | leg.seen | stop.seen)
        return sets

    def tails(self, end: int | None = None) -> list[Bits]:
        """What is seen from each stop on, it included, up to the stop `end` (the last one by default)."""
        last = len(self.stops) - 1 if end is None else end
        sets = [self.stops[last].seen]
        for i in range(last - 1, -1, -1):
            sets.append(sets[-1] | self.legs[i].seen | self.stops[i].seen)
        return sets[::-1]
