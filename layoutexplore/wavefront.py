"""Exact octile distances on a grid by a wavefront in canonical order: the kernels behind `layoutexplore.planning`.

Of the many shortest paths to a cell one is followed: diagonal moves first, then straight ones, with another diagonal
only at a corner that forces it (canonical ordering as in jump point search, Harabor and Grastien 2011, in the variant
without corner cutting). A straight run therefore writes the cells it passes in one go; only diagonal steps and forced
corners wait in a queue, a few thousand for a floor of half a million cells. The queue is Dial's ("Algorithm 360",
1969): buckets one cell wide, in a ring. No move is shorter than a bucket, so cells of one bucket cannot improve each other.

Distances are whole numbers, 5741 for a straight and 8119 for a diagonal move (8119 / 5741 is a convergent of the square
root of 2, off by 8e-9): sums are exact, symmetric and free of the order in which they are made. Paths longer than about
370 000 cells do not fit and count as none.

Many searches on one grid share an array of distances that is not cleared in between: each search counts from an origin below
all that the earlier ones have written, so that what these left behind is farther than anything it can reach itself.

Arrays are padded by one cell that nothing enters, and flat. Moves are bits: N 0, S 1, W 2, E 3, NW 4, NE 5, SW 6, SE 7, where
north is the next row.
"""

from __future__ import annotations

import threading

import numpy as np
from numba import njit
from numpy.typing import NDArray

STRAIGHT = 5741
DIAGONAL = 8119
FAR = 2**31 - 1
"""Distance of a cell that cannot be reached."""

_SPAN = (FAR // 16) // STRAIGHT * STRAIGHT
"""How far apart the origins of searches that share an array lie: 16 searches for one time of clearing it."""

_TOO_FAR = -2

_FREE_ENTRY, _USED, _WAITING, _OVERFLOW = range(4)  # What the numbers of a queue's state mean.


class Workspace:
    """The arrays of one grid shape, kept from call to call because fresh memory costs more than the search.

    Attributes:
        moves: uint8 (rows + 2, cols + 2), the moves out of every cell, as bits.
        distance: int32, flat, padded.
        origin: What the last search has written at its source: subtract it.
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        padded = (shape[0] + 2, shape[1] + 2)
        self.world = np.zeros(padded, np.uint8)
        self.moves = np.zeros(padded, np.uint8)
        self.distance = np.empty(self.world.size, np.int32)
        self._scheduled = np.empty(self.world.size, np.uint8)
        self._heads = np.empty(1 << (max(padded) + 2).bit_length(), np.int32)
        self._resize_queue(4096)
        self.origin = 0

    @property
    def cols(self) -> int:
        """Columns of the padded grid."""
        return int(self.world.shape[1])

    def load(self, traversable: NDArray[np.bool_]) -> None:
        """Take a mask bool (rows, cols) as the grid to search."""
        self.world[1:-1, 1:-1] = traversable
        _find_moves(self.world, self.moves)

    def spread(self, source: int, stops: NDArray[np.int64]) -> int:
        """Fill `distance` from a padded flat cell; with `stops`, until all of those are settled.

        Returns:
            The distance up to which `distance` is exact.
        """
        self.origin = 0
        return self._search(source, stops, 0, True)

    def spread_again(self, source: int, stops: NDArray[np.int64]) -> NDArray[np.int64]:
        """The distances to the stops alone, int64 (n,), `FAR` where there is no way: for many searches on one grid.

        Before the first of them on a freshly loaded grid, call `spread` or set `origin` to 0.
        """
        fresh = self.origin < _SPAN
        self.origin = 15 * _SPAN if fresh else self.origin - _SPAN
        if self._search(source, stops, self.origin, fresh) == _TOO_FAR:
            self.spread(source, stops)
            return self.distance[stops].astype(np.int64)
        lengths = self.distance[stops].astype(np.int64) - self.origin
        return np.where(lengths >= _SPAN, FAR, lengths)

    def _search(self, source: int, stops: NDArray[np.int64], origin: int, clear: bool) -> int:
        if clear:
            self.distance[:] = FAR
        while True:
            arrays = (self.distance, self._scheduled, self._heads, self._items, self._links)
            settled = int(_spread(self.moves, source, stops, origin, *arrays))
            if settled >= 0 or settled == _TOO_FAR:
                return settled
            self._resize_queue(4 * self._items.size)
            self.distance[:] = FAR

    def _resize_queue(self, size: int) -> None:
        self._items = np.empty(size, np.int64)
        self._links = np.empty(size, np.int32)


_threads = threading.local()


def workspace(traversable: NDArray[np.bool_]) -> Workspace:
    """This thread's workspace for a mask bool (rows, cols), loaded with it."""
    rows, cols = traversable.shape
    kept: Workspace | None = getattr(_threads, "kept", None)
    if kept is None or kept.world.shape != (rows + 2, cols + 2):
        kept = _threads.kept = Workspace((rows, cols))
    kept.load(traversable)
    return kept


@njit(cache=True, nogil=True)
def _find_moves(world: NDArray[np.uint8], moves: NDArray[np.uint8]) -> None:
    """Write the moves out of each inner cell of a padded mask of 0 and 1, traversable or not."""
    rows, cols = world.shape
    for r in range(1, rows - 1):
        for c in range(1, cols - 1):
            north, south, west, east = world[r + 1, c], world[r - 1, c], world[r, c - 1], world[r, c + 1]
            moves[r, c] = (
                north
                | south << 1
                | west << 2
                | east << 3
                | (north & west & world[r + 1, c - 1]) << 4
                | (north & east & world[r + 1, c + 1]) << 5
                | (south & west & world[r - 1, c - 1]) << 6
                | (south & east & world[r - 1, c + 1]) << 7
            )


@njit(cache=True, nogil=True)
def _push(
    cell: int,
    move: int,
    distance: int,
    heads: NDArray[np.int32],
    items: NDArray[np.int64],
    links: NDArray[np.int32],
    state: NDArray[np.int64],
) -> None:
    """Queue a cell from which a diagonal move, and the two runs beside it, go on."""
    entry = state[_FREE_ENTRY]
    if entry >= 0:
        state[_FREE_ENTRY] = links[entry]
    else:
        entry = state[_USED]
        if entry == items.size:
            state[_OVERFLOW] = 1
            return
        state[_USED] = entry + 1
    bucket = (distance // STRAIGHT) & (heads.size - 1)
    items[entry] = cell * 8 + move
    links[entry] = heads[bucket]
    heads[bucket] = entry
    state[_WAITING] += 1


@njit(cache=True, nogil=True)
def _run(
    cell: int,
    here: int,
    step: int,
    move: int,
    side_a: int,
    side_b: int,
    corner_a: int,
    corner_b: int,
    moves: NDArray[np.uint8],
    distance: NDArray[np.int32],
    scheduled: NDArray[np.uint8],
    heads: NDArray[np.int32],
    items: NDArray[np.int64],
    links: NDArray[np.int32],
    state: NDArray[np.int64],
) -> None:
    """Go straight until a wall or a cell that is reached as well without; queue the corners that force a turn."""
    ahead = 1 << move
    sides = 1 << side_a | 1 << side_b
    at, stride = np.uint64(cell), np.uint64(step)  # Unsigned, so that indexing need not look out for negative numbers.
    allowed = moves[at]
    while allowed & ahead:
        at += stride
        here += STRAIGHT
        known = distance[at]
        if known > here:
            distance[at] = here
            scheduled[at] = ahead
        elif known < here or scheduled[at] & ahead:
            return
        else:
            scheduled[at] |= ahead
        # A side that is open here and was shut one cell before can only be reached by turning here.
        opened = moves[at] & ~allowed & sides
        allowed = moves[at]
        if opened >> side_a & 1:
            scheduled[at] |= 1 << corner_a | 1 << side_a
            _push(int(at), corner_a, here, heads, items, links, state)
        if opened >> side_b & 1:
            scheduled[at] |= 1 << corner_b | 1 << side_b
            _push(int(at), corner_b, here, heads, items, links, state)


@njit(cache=True, nogil=True)
def _spread(
    padded_moves: NDArray[np.uint8],
    source: int,
    stops: NDArray[np.int64],
    origin: int,
    distance: NDArray[np.int32],
    scheduled: NDArray[np.uint8],
    heads: NDArray[np.int32],
    items: NDArray[np.int64],
    links: NDArray[np.int32],
) -> int:
    """Lower `distance` from `origin` on; return up to where it is exact.

    It is -1 when the queue's memory is too small, and `_TOO_FAR` when cells lie too far from an origin above 0.

    `scheduled` holds the moves that will be, or have been, followed out of a cell at its present distance: what arrives
    at the same distance by another way adds only the moves that are missing, so that ties do not multiply.
    """
    moves = padded_moves.ravel()
    cols = padded_moves.shape[1]
    end = FAR if origin == 0 else origin + _SPAN
    longest = end - STRAIGHT * (max(padded_moves.shape[0], cols) + 2)
    heads[:] = -1
    state = np.array([-1, 0, 0, 0])
    distance[source] = origin
    scheduled[source] = 255
    for move in range(4, 8):
        _push(source, move, origin, heads, items, links, state)
    level, settled = origin // STRAIGHT, 0
    while state[_WAITING] > 0:
        bucket = level & (heads.size - 1)
        base = level * STRAIGHT
        while settled < stops.size and distance[stops[settled]] <= base:
            settled += 1
        if stops.size > 0 and settled == stops.size:
            return base
        entry = heads[bucket]
        heads[bucket] = -1
        while entry >= 0:
            cell, move = items[entry] >> 3, items[entry] & 7
            following = links[entry]
            links[entry] = state[_FREE_ENTRY]
            state[_FREE_ENTRY] = entry
            state[_WAITING] -= 1
            entry = following
            here = distance[cell]
            if here < base:
                continue  # Improved since it was queued.
            if here > longest:
                if origin > 0:
                    return _TOO_FAR
                continue
            north, east = move < 6, move & 1 == 1
            up = cols if north else -cols
            right = 1 if east else -1
            vertical, horizontal = (0 if north else 1), (3 if east else 2)
            # fmt: off
            _run(cell, here, up, vertical, 2, 3, 4 if north else 6, 5 if north else 7,
                 moves, distance, scheduled, heads, items, links, state)
            _run(cell, here, right, horizontal, 0, 1, 5 if east else 4, 7 if east else 6,
                 moves, distance, scheduled, heads, items, links, state)
            # fmt: on
            if not moves[cell] >> move & 1:
                continue
            target = cell + up + right
            there = here + DIAGONAL
            follow = 1 << move | 1 << vertical | 1 << horizontal
            if there < distance[target]:
                distance[target] = there
                scheduled[target] = follow
            elif there == distance[target] and follow & ~scheduled[target]:
                scheduled[target] |= follow
            else:
                continue
            _push(target, move, there, heads, items, links, state)
        if state[_OVERFLOW]:
            return -1
        level += 1
    return FAR


@njit(cache=True, nogil=True)
def to_metres(distance: NDArray[np.int32], metres: float, settled: int, lengths: NDArray[np.float32]) -> None:
    """Write padded flat distances as metres (rows, cols); beyond what is settled they are infinite."""
    rows, cols = lengths.shape
    farthest = min(settled, FAR - 1)
    for r in range(rows):
        start = (r + 1) * (cols + 2) + 1
        units, written = distance[start : start + cols], lengths[r]
        for c in range(cols):
            written[c] = np.float32(units[c] * metres) if units[c] <= farthest else np.float32(np.inf)
