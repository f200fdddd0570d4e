"""Places where a route may stop: what is seen from each, how far they are apart, what the ways show.

What costs time is kept: the same places come and go while a route is planned, and from one plan to the next.
"""

from __future__ import annotations

import dataclasses
from collections import OrderedDict
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from layoutexplore.agents.omniscient.route import Stop
from layoutexplore.agents.omniscient.visibility import Bits, FloorInView, Visibility
from layoutexplore.errors import checks_making
from layoutexplore.grids.arrays import Floats32, Ints, Ints32, Mask, Words
from layoutexplore.grids.grid import Cell, in_cells
from layoutexplore.grids.morphology import with_neighbours
from layoutexplore.planning.canonical_search import Workspace
from layoutexplore.planning.shortest_paths import (
    flat_indices,
    geodesic_distances,
    lengths_in_metres,
    shortest_path,
)

_KEPT_WAYS, _KEPT_STOPS, _KEPT_FIELDS = 4000, 1000, 16
_RECENT_WAYS = 500
"""Ways that are looked through for those that stand when the floor has changed, the last used first."""


class _Way(NamedTuple):
    """A path int32 (k, 2) between two places, and what the scans on it show."""

    path: Ints32
    seen: Bits


@checks_making
class Places:
    """A lattice of places on a floor.

    Args:
        scene: The floor, what is to be seen and from where, and the sensor.
        visibility: What is seen of it.
        lattice: Metres between places.

    Attributes:
        visibility: As given.
        resolution: Side of a cell in metres.
        traversable: bool (rows, cols), the cells that the robot's centre can reach.
        cells: int32 (n, 2), the places as (row, col).
        views: uint64 (n, words), what a full turn in each shows.
    """

    def __init__(self, scene: FloorInView, visibility: Visibility, lattice: float) -> None:
        self.visibility, self.resolution = visibility, scene.resolution
        self._step = in_cells(lattice, scene.resolution)
        self.traversable = np.ascontiguousarray(scene.reachable)
        self._opaque = scene.occupied
        self.cells = _lattice(self.traversable, self._step)
        self.views = visibility.turning(self.cells)
        self._ways: OrderedDict[tuple[Cell, Cell], _Way] = OrderedDict()
        self._search = Workspace(self.traversable.shape)
        self._forget()

    def adapt(self, scene: FloorInView) -> None:
        """Go on with a floor that differs from the last one: only what the changes can touch is done anew."""
        changed = scene.occupied != self._opaque
        moved = not np.array_equal(scene.reachable, self.traversable)
        if not (changed.any() or moved):
            self.visibility.target = self.visibility.set_of(scene.target)
            return
        near = self.visibility.near(changed & ~_shifted(self._opaque, scene.occupied))
        self.visibility.adapt(scene)
        self._opaque, self.traversable = scene.occupied, np.ascontiguousarray(scene.reachable)
        cells = _lattice(self.traversable, self._step) if moved else self.cells
        old = np.full(len(cells), -1, np.int64) if moved else np.arange(len(cells))
        if moved:
            numbers = self._numbers
            old[:] = [numbers.get(cell, -1) for cell in map(tuple, cells.tolist())]
        views, stale = _carried(self.views, old, near)
        self.cells, self.views = cells, views
        views[stale] = self.visibility.turning(cells[stale])
        recent = list(self._ways.items())[-_RECENT_WAYS:]
        self._ways = OrderedDict((key, way) for key, way in recent if self._stands(way, near))
        self._forget()

    def _forget(self) -> None:
        self._search.load(self.traversable)
        self._flat = flat_indices(self.cells.astype(np.int64), self._search)
        self._numbers = {cell: i for i, cell in enumerate(map(tuple, self.cells.tolist()))}
        self._fields: OrderedDict[Cell, Floats32] = OrderedDict()
        self._stops: OrderedDict[int, Stop] = OrderedDict()

    def at(self, cell: Cell, seen: Bits | None = None) -> Stop:
        """A stop in any cell, with what is seen there; a full turn where that is not given."""
        if seen is None:
            index = self.number(cell)
            if index >= 0:
                return self.stop(index)
            seen = self.visibility.turning(np.array([cell], np.int32))[0]
        return Stop(cell, -1, self._lengths(cell), seen)

    def stop(self, index: int) -> Stop:
        """The stop in a place of the lattice, kept: the same ones come and go."""
        if index not in self._stops:
            stop = self.at(Cell(*map(int, self.cells[index])), self.views[index])
            _keep(self._stops, index, dataclasses.replace(stop, index=index), _KEPT_STOPS)
        return self._stops[index]

    def _lengths(self, cell: Cell) -> Floats32:
        """Path lengths float32 (n,) in metres from a cell to the places; inf where there is no path."""
        source = int(flat_indices(np.array([cell], np.int64), self._search)[0])
        return lengths_in_metres(self._search.lengths_to(source, self._flat), self.resolution)

    def field(self, cell: Cell) -> Floats32:
        """Path lengths float32 (rows, cols) from a cell in metres; large, so only the last few are kept."""
        if cell not in self._fields:
            lengths = geodesic_distances(self.traversable, cell, self.resolution)
            _keep(self._fields, cell, lengths, _KEPT_FIELDS)
        return self._fields[cell]

    def _stands(self, way: _Way, near: Bits) -> bool:
        """Whether a way can still be gone, and nothing that is seen from it lies near what changed."""
        clear = self.traversable[way.path[:, 0], way.path[:, 1]].all()
        return bool(clear) and not (way.seen & near).any()

    def number(self, cell: Cell) -> int:
        """The number of a place in the lattice; -1 for other cells."""
        return self._numbers.get(tuple(cell), -1)

    def path(self, start: Cell, end: Cell) -> Ints32:
        """The shortest path int32 (k, 2) between two cells, both included."""
        return shortest_path(self._search, start, end, self.resolution)

    def way(self, start: Cell, end: Cell) -> Bits:
        """What the scans on the way between two cells show, kept while it can be gone."""
        key = (start, end)
        if key not in self._ways:
            path = self.path(start, end)
            _keep(self._ways, key, _Way(path, self.visibility.walking(path)), _KEPT_WAYS)
        self._ways.move_to_end(key)
        return self._ways[key].seen


def _keep(store: OrderedDict[Any, Any], key: Any, value: Any, most: int) -> None:
    """Put a value into a store that forgets its oldest one when there are too many."""
    store[key] = value
    if len(store) > most:
        store.popitem(last=False)


def _shifted(before: Mask, after: Mask) -> Mask:
    """Bool (rows, cols): cells that changed only because the face of a wall moved by a cell.

    What is seen past such a face is the same but for a strip of a cell: a view need not be made anew for it.

    Args:
        before: bool (rows, cols), solid cells.
        after: The same, later.
    """
    was_solid, is_solid, was_free = map(with_neighbours, (before, after, ~before))
    return np.where(after, was_solid, was_free & is_solid)


@njit(cache=True, nogil=True)
def _lattice(traversable: Mask, step: int) -> Ints32:
    """int32 (n, 2): of every step x step block with traversable cells the one nearest the middle.

    Of equally near ones the first in raster order.
    """
    rows, cols = traversable.shape
    across = (cols + step - 1) // step
    best = np.full(((rows + step - 1) // step) * across, np.inf)
    cells = np.empty((len(best), 2), np.int32)
    middle = (step - 1) / 2
    for r in range(rows):
        for c in range(cols):
            if traversable[r, c]:
                block = (r // step) * across + c // step
                # The greater offset counts: blocks are squares.
                off = max(abs(r % step - middle), abs(c % step - middle))
                if off < best[block]:
                    best[block] = off
                    cells[block] = (r, c)
    return cells[np.isfinite(best)]


@njit(cache=True, nogil=True)
def _carried(views: Words, old: Ints, near: Words) -> tuple[Words, Ints]:
    """Views in a new order, and which of them have to be made anew.

    Args:
        views: uint64 (n, words), those there are.
        old: int64 (m,), the row of each new view among them, -1 for none.
        near: uint64 (words,), the sampled cells near what has changed.
    """
    carried = np.zeros((len(old), views.shape[1]), np.uint64)
    stale = np.zeros(len(old), np.bool_)
    for i in range(len(old)):
        if old[i] < 0:
            stale[i] = True
            continue
        for w in range(views.shape[1]):
            carried[i, w] = views[old[i], w]
            # Nothing that is seen from a place lies near what changed: the place keeps its view.
            stale[i] |= (carried[i, w] & near[w]) != 0
    return carried, np.flatnonzero(stale)
