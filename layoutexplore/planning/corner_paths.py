"""Path lengths between places on a grid that changes, by its corners, kept where no change can matter.

A shortest path that is no longer one has lost an edge, and one that is new has gained an edge. Where the ways
from two places to the nearest changed edge are together longer than the length between them, before the
change and after it, that length has not changed.
"""

from __future__ import annotations

import numpy as np

from layoutexplore.errors import checks_making
from layoutexplore.grids.arrays import Bytes, Ints, Ints32
from layoutexplore.planning.canonical_search import FAR
from layoutexplore.planning.corner_graph import CornerGraph, outdated
from layoutexplore.planning.corner_search import Links, find_links, lengths_at, shorten
from layoutexplore.planning.known_lengths import NOT_SEARCHED, KnownLengths, sources_to_search

_MOST_PLACES = 512
"""Places that are kept; beyond it only those that are asked for are."""


@checks_making
class CornerPaths:
    """Shortest path lengths on a grid that changes, nowhere traversable at first.

    Args:
        shape: (rows, cols) of the grid.

    Attributes:
        searches: Number of searches for `between` so far.

    Example:
        >>> paths = CornerPaths((3, 9))
        >>> changed = paths.update(np.ones((3, 9), np.uint8), 0, 0)
        >>> paths.between(np.array([[0, 0], [0, 8]])).tolist()
        [[0, 45928], [45928, 0]]
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self.graph = CornerGraph(shape)
        self._known = KnownLengths(_MOST_PLACES)
        self._links = find_links(self.graph.ground, self._known.cells)
        self.searches = 0

    @property
    def world(self) -> Bytes:
        """uint8 (rows + 2, cols + 2), 1 where a robot can go."""
        return self.graph.ground.world

    def update(self, window: Bytes, row: int, col: int) -> Ints32:
        """Take over a part of the grid: a window uint8 (n, m), 1 where a robot can go, from (row, col) on.

        Returns:
            int32 (n, 2), in the padded grid: the cells that have changed, and those beside them.
        """
        change = self.graph.update(window, row + 1, col + 1, compare=len(self._known.cells) > 0)
        if change.old is not None and change.new is not None:
            self._forget(change.sums, change.old, change.new)
        return change.touched

    def lengths_from(self, source: tuple[int, int], places: Ints | Ints32) -> Ints:
        """Lengths int64 (n,) in units of the search from a cell to places (n, 2), `FAR` where there is none.

        All of them are traversable.
        """
        start = find_links(self.graph.ground, np.array([source]))
        return self._search(start, 0, find_links(self.graph.ground, np.asarray(places, np.int64)))

    def between(self, places: Ints | Ints32) -> Ints:
        """Lengths int64 (n, n) in units of the search between places (n, 2), `FAR` where there is no way.

        All of them are traversable.
        """
        wanted = np.asarray(places, np.int64)
        before = self._known.cells
        rows = self._known.rows(wanted)
        if self._known.cells is not before:
            self._links = find_links(self.graph.ground, self._known.cells)
        units = self._known.units[np.ix_(rows, rows)]
        if (units == NOT_SEARCHED).any():
            self._fill(rows, units)
            self._known.units[np.ix_(rows, rows)] = units
        return units

    def _search(self, links: Links, k: int, targets: Links) -> Ints:
        """Lengths int64 (n,) from a place to others."""
        part = slice(links.first[k], links.first[k + 1])
        lengths = lengths_at(targets, self.graph.distances_from(links.corner[part], links.length[part]))
        shorten(self.world, targets, links.cell[k, 0], links.cell[k, 1], lengths)
        return np.minimum(lengths, FAR)

    def _fill(self, rows: Ints, units: Ints) -> None:
        """Search for the unknown entries of units int64 (n, n) between places by their rows."""
        targets = _chosen(self._links, rows)
        for source in sources_to_search(units):
            missing = np.flatnonzero(units[source] == NOT_SEARCHED)
            found = self._search(targets, source, targets)[missing]
            units[source, missing] = units[missing, source] = found
            self.searches += 1

    def _forget(self, sums: Ints32, old: Ints, new: Ints) -> None:
        """Forget the places that see a change, and the lengths that may differ; see `GraphChange`."""
        known = self._known
        sees = np.zeros(len(known.cells), np.bool_)
        sees[outdated(self._links.cell, self._links.seen, sums)] = True
        if sees.any():
            known.keep(~sees)
            self._links = _chosen(self._links, np.flatnonzero(~sees))
        for distance in (old, new):
            near = lengths_at(self._links, distance)
            known.forget(near[:, None] + near[None, :] <= known.units)


def _chosen(links: Links, rows: Ints) -> Links:
    """The links of some places."""
    counts = np.diff(links.first)[rows]
    first = np.concatenate([[0], np.cumsum(counts)])
    entries = np.repeat(links.first[rows] - first[:-1], counts) + np.arange(first[-1])
    return Links(links.cell[rows], links.seen[rows], first, links.corner[entries], links.length[entries])
