"""Path lengths between places, kept in a table while nothing that they depend on changes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Ints, Mask

NOT_SEARCHED = -1
"""Entry of a length that is not known."""


class KnownLengths:
    """Lengths between the places that were asked for, in units of a search.

    Args:
        most: Places that are kept; where they and new ones are more, only those that are asked for are.

    Attributes:
        cells: int64 (n, 2), the places as (row, col).
        units: int64 (n, n), the lengths between them, or `NOT_SEARCHED`; 0 to themselves.

    Example:
        >>> known = KnownLengths(most=100)
        >>> known.rows(np.array([[0, 0], [0, 8], [0, 0]])).tolist()
        [0, 1, 0]
        >>> known.units.tolist()
        [[0, -1], [-1, 0]]
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self.clear()

    def clear(self) -> None:
        """Know no place any more."""
        self.cells = np.empty((0, 2), np.int64)
        self.units = np.empty((0, 0), np.int64)

    def rows(self, wanted: Ints) -> Ints:
        """The rows int64 (n,) of places int64 (n, 2) in the table, which are added where they are new."""
        places, asked = [tuple(cell) for cell in self.cells.tolist()], [tuple(c) for c in wanted.tolist()]
        those = set(asked)
        if len(those.union(places)) > self._most:
            self.keep(np.array([k for k, place in enumerate(places) if place in those], np.int64))
            places = [tuple(cell) for cell in self.cells.tolist()]
        known = {place: k for k, place in enumerate(places)}
        rows = np.array([known.setdefault(place, len(known)) for place in asked], np.int64)
        old, count = len(places), len(known)
        if count > old:
            units = np.full((count, count), NOT_SEARCHED, np.int64)
            units[:old, :old] = self.units
            np.fill_diagonal(units, 0)
            self.units, self.cells = units, np.array(list(known), np.int64).reshape(-1, 2)
        return rows

    def keep(self, rows: Ints | Mask) -> None:
        """Keep the places of some rows, in their order: int64 (n,), or bool of all."""
        self.cells, self.units = self.cells[rows], self.units[rows][:, rows]

    def forget(self, differ: Mask) -> None:
        """Forget some lengths: bool (n, n)."""
        self.units[differ] = NOT_SEARCHED
        np.fill_diagonal(self.units, 0)


def sources_to_search(units: Ints) -> Iterator[int]:
    """Places from which to search until no length int64 (n, n) is unknown; whoever asks fills in the lengths.

    After the first one the outermost: what remains lies ever closer together, and searches stop ever sooner.

    Example:
        >>> units = np.array([[0, -1], [-1, 0]])
        >>> for source in sources_to_search(units):
        ...     units[source] = units[:, source] = 5
        >>> units.tolist()
        [[5, 5], [5, 0]]
    """
    source = first = int(next_source(units, -1))
    while source >= 0:
        yield source
        source = int(next_source(units, first))


@njit(cache=True, nogil=True)
def next_source(units: Ints, first: int) -> int:
    """The place with the most unknown lengths, of equals the one farthest from `first`; -1 if none is."""
    source, most = -1, 0
    for k in range(len(units)):
        missing = 0
        for length in units[k]:
            missing += length == NOT_SEARCHED
        farther = first >= 0 and most > 0 and missing == most and units[first, k] > units[first, source]
        if missing > most or farther:
            source, most = k, missing
    return source
