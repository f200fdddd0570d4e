"""Shortest path lengths between places on a map that changes little from one time to the next.

Lengths are kept where the change cannot matter. A path that touches a changed cell, or squeezes past one,
leads from its one end to there and on to its other end; where even the straight ways together are longer than
the kept length, neither the old nor the new map has a path of that length through the change, so the length
stays exact. What is unknown then is searched from as few places as a greedy choice finds.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.arrays import Bytes, Floats32, Ints, Mask
from layoutexplore.grids.morphology import check_mask
from layoutexplore.planning.canonical_search import DIAGONAL, FAR, STRAIGHT
from layoutexplore.planning.known_lengths import NOT_SEARCHED, KnownLengths
from layoutexplore.planning.shortest_paths import check_cells, lengths_in_metres, search_unknown

_MOST_CHANGES = 20_000
"""Changed cells from which everything is forgotten: looking at them all would take longer than searching."""
_MOST_PLACES = 256
"""Places that are kept in store; beyond it only those that are asked for are kept."""


class DistanceCache:
    """Path lengths between the places that are asked for, kept from call to call.

    Example:
        >>> cache = DistanceCache()
        >>> open_floor = np.ones((3, 9), bool)
        >>> cache.lengths(open_floor, np.array([[0, 0], [0, 8]]), 1.0)[0].tolist()
        [0.0, 8.0]
    """

    def __init__(self) -> None:
        self._mask = np.zeros((0, 0), np.bool_)
        self._known = KnownLengths(_MOST_PLACES)
        self.searches = 0

    def lengths(self, traversable: Mask, cells: NDArray[np.integer], resolution: float) -> Floats32:
        """The same as `layoutexplore.planning.shortest_paths.distance_matrix`: float32 (n, n) in metres."""
        world = check_mask(traversable)
        wanted = check_cells(cells, world.shape)
        self._adapt(world)
        rows = self._known.rows(wanted)
        units = self._known.units[np.ix_(rows, rows)]
        if (units == NOT_SEARCHED).any():
            self.searches += search_unknown(world, wanted, units)
            self._known.units[np.ix_(rows, rows)] = units
        return lengths_in_metres(units, resolution)

    def _adapt(self, world: Mask) -> None:
        """Forget the lengths that may differ on this map, and remember it."""
        if world.shape != self._mask.shape:
            self._known.clear()
            self._mask = world.copy()
            return
        changes = _take_over(world.ravel().view(np.uint8), self._mask.ravel().view(np.uint8))
        if len(changes) == 0:
            return
        known = self._known
        if len(changes) > _MOST_CHANGES:
            known.forget(np.ones(known.units.shape, np.bool_))
        elif len(known.cells):
            near = nearest_change(known.cells, changes, world.shape[1])
            known.forget(near[:, None] + near[None, :] - 2 * STRAIGHT <= known.units)


@njit(cache=True, nogil=True)
def _take_over(world: Bytes, mask: Bytes) -> Ints:
    """Make a mask (n,) like the world (n,); the cells where it was not. Eight cells are compared at once."""
    whole = world.size // 8
    new, old = world[: 8 * whole].view(np.uint64), mask[: 8 * whole].view(np.uint64)
    changes = np.empty(world.size, np.int64)
    count = 0
    for w in range(whole + 1):
        if w < whole and new[w] == old[w]:
            continue
        for k in range(8 * w, min(8 * w + 8, world.size)):
            if world[k] != mask[k]:
                mask[k] = world[k]
                changes[count] = k
                count += 1
    return changes[:count].copy()


@njit(cache=True, nogil=True)
def nearest_change(places: Ints, changes: Ints, cols: int) -> Ints:
    """Length int64 (n,) without walls from each place (n, 2) to the nearest changed cell, flat (m,)."""
    nearest = np.empty(len(places), np.int64)
    # Half words, of which many fit a register; lengths that do not fit come out shorter, and a length too
    # many is forgotten.
    rows, columns = np.empty(len(changes), np.int32), np.empty(len(changes), np.int32)
    for n in range(len(changes)):
        rows[n], columns[n] = changes[n] // cols, changes[n] % cols
    straight, more = np.int32(STRAIGHT), np.int32(DIAGONAL - STRAIGHT)
    for k in range(len(places)):
        row, column, best = np.int32(places[k, 0]), np.int32(places[k, 1]), np.int32(FAR)
        for n in range(len(changes)):
            one, other = np.int32(abs(rows[n] - row)), np.int32(abs(columns[n] - column))
            best = min(best, np.int32(straight * max(one, other) + more * min(one, other)))
        nearest[k] = best
    return nearest
