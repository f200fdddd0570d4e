"""What is left to see, of places and of the ways between them: all that counts while a route is planned.

Towards the end of a run that is little: most places show nothing new, and most words of the sets are full.
"""

from __future__ import annotations

import numpy as np

from layoutexplore.agents.omniscient.places import Places
from layoutexplore.agents.omniscient.route import Leg, Stop
from layoutexplore.agents.omniscient.visibility import Bits, added_sizes
from layoutexplore.errors import checks_making
from layoutexplore.grids.arrays import Floats32, Ints32, Words
from layoutexplore.grids.grid import Cell


@checks_making
class LeftToSee:
    """The places of a floor from which something is left to see, and what that is.

    Args:
        places: All places.
        seen: What has been seen, as a set of theirs.
        stops: int32 (k, 2), cells that are to be kept though nothing is left to see from there.

    Attributes:
        views: uint64 (n, words), what each place that is kept shows and is left to see.
        gains: int64 (n,), how many cells that are.
        cells: int32 (n, 2), the places that are kept.
    """

    def __init__(self, places: Places, seen: Bits, stops: Ints32) -> None:
        self._places = places
        gains = added_sizes(places.views, np.arange(len(places.views)), seen)
        kept = gains > 0
        numbers = [places.number(Cell(*cell)) for cell in stops.tolist()]
        kept[[number for number in numbers if number >= 0]] = True
        self._kept = np.flatnonzero(kept)
        self._words = np.flatnonzero(~seen)
        self._left = ~seen[self._words]
        self._number = np.full(len(places.cells), -1, np.int64)
        self._number[self._kept] = np.arange(len(self._kept))
        self.views: Words = places.views[np.ix_(self._kept, self._words)] & self._left
        self.gains, self.cells = gains[self._kept], places.cells[self._kept]
        self._stops: dict[Cell, Stop] = {}
        self._legs: dict[tuple[Cell, Cell], Leg] = {}

    def of(self, seen: Words) -> Words:
        """What of sets uint64 (..., all words) is left to see: uint64 (..., words)."""
        left: Words = seen[..., self._words] & self._left
        return left

    def at(self, cell: Cell) -> Stop:
        """A stop in any cell, with what is left to see there, kept."""
        if cell not in self._stops:
            self._stops[cell] = self.showing(cell)
        return self._stops[cell]

    def showing(self, cell: Cell, seen: Bits | None = None) -> Stop:
        """A stop in any cell with what is seen there; a full turn where that is not given."""
        stop = self._places.at(cell, seen)
        index = int(self._number[stop.index]) if stop.index >= 0 else -1
        return Stop(cell, index, stop.lattice[self._kept], self.of(stop.seen))

    def stop(self, index: int) -> Stop:
        """The stop in a place that is kept."""
        return self.at(Cell(*self.cells[index].tolist()))

    def leg(self, start: Stop, end: Stop) -> Leg:
        """The way between two stops."""
        key = (start.cell, end.cell)
        if key not in self._legs:
            self._legs[key] = Leg(self.apart(start, end), self.of(self._places.way(*key)))
        return self._legs[key]

    def apart(self, a: Stop, b: Stop) -> float:
        """Path length between two stops in metres."""
        if b.index >= 0:
            return float(a.lattice[b.index])
        return float(b.lattice[a.index]) if a.index >= 0 else float(self._places.field(a.cell)[b.cell])

    def matrix(self, stops: list[Stop]) -> Floats32:
        """Path lengths float32 (k, k) in metres between stops."""
        indices = np.array([stop.index for stop in stops])
        lengths: Floats32 = np.array([stop.lattice for stop in stops])[:, indices]
        for i in np.flatnonzero(indices < 0).tolist():
            lengths[:, i] = [self.apart(stop, stops[i]) for stop in stops]
        return lengths
