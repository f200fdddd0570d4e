"""Exact octile distances on a grid by a search in canonical order: the kernels behind `shortest_paths`.

Of the many shortest paths to a cell one is followed: diagonal moves first, then straight ones, with another
diagonal only at a corner that forces it (canonical ordering as in jump point search, Harabor and Grastien
2011, in the variant without corner cutting). A straight run therefore writes the cells it passes in one go;
only diagonal steps and forced corners wait in a queue, a few thousand for a floor of half a million cells.
The queue is Dial's ("Algorithm 360", 1969): buckets one cell wide, in a ring. No move is shorter than a
bucket, so cells of one bucket cannot improve each other.

Distances are whole numbers, 5741 for a straight and 8119 for a diagonal move (8119 / 5741 is a convergent of
the square root of 2, off by 8e-9): sums are exact, symmetric and free of the order in which they are made.
Paths longer than about 370 000 cells do not fit and count as none.

Many searches on one grid share an array of distances that is not cleared in between: each search counts from
an origin below all that the earlier ones have written, so that what these left behind is farther than
anything it can reach itself.

Arrays are padded by one cell that nothing enters, and flat. Moves are bits: N 0, S 1, W 2, E 3, NW 4, NE 5,
SW 6, SE 7, where north is the next row.
"""

from __future__ import annotations

import threading
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from layoutexplore.errors import checks_making
from layoutexplore.grids.arrays import Bytes, Floats32, Ints, Ints32, Mask

STRAIGHT = 5741
DIAGONAL = 8119
FAR = 2**31 - 1
"""Distance of a cell that cannot be reached."""

_SPAN = (FAR // 16) // STRAIGHT * STRAIGHT
"""How far apart the origins of searches that share an array lie: 15 searches for one time of clearing it."""

_QUEUE_FULL, _TOO_FAR = -1, -2  # Why a search ended without a result.
_FREE_ENTRY, _USED, _WAITING, _OVERFLOW = range(4)  # What the numbers of a queue's state mean.


class _Grid(NamedTuple):
    """What a search reads and writes per cell of the padded grid, flat (n,)."""

    moves: Bytes
    """The moves out of a cell, as bits."""
    distance: Ints32
    scheduled: Bytes
    """The moves that will be, or have been, followed out of a cell at its present distance: what arrives at
    the same distance by another way adds only those that are missing, so that ties do not multiply."""
    cols: int


class _Queue(NamedTuple):
    """Dial's queue: each bucket is a chain of entries, and so are the entries that are free again."""

    heads: Ints32
    """First entry of each bucket of the ring, -1 if there is none; their number is a power of two."""
    items: Ints
    """The cell of each entry times eight, plus its diagonal move."""
    links: Ints32
    """The next entry of the chain, -1 at its end."""


class _Direction(NamedTuple):
    """A straight run: its step in flat cells, its move, and what may turn it off to either side."""

    step: int
    move: int
    side_a: int
    side_b: int
    corner_a: int
    corner_b: int


class _Memory:
    """What a search needs besides its grid, kept because fresh memory costs more than the search."""

    def __init__(self, shape: tuple[int, int], size: int = 4096) -> None:
        self.shape = shape
        self.scheduled = np.empty(shape[0] * shape[1], np.uint8)
        self.resize(size)

    def resize(self, size: int) -> None:
        """Make room for so many entries of the queue."""
        self.queue = _Queue(
            heads=np.empty(1 << (max(self.shape) + 2).bit_length(), np.int32),
            items=np.empty(size, np.int64),
            links=np.empty(size, np.int32),
        )
        self.plain_queue = tuple(self.queue)


@checks_making
class Search:
    """Searches on one grid, one after the other.

    Args:
        shape: (rows, cols) of the grid, nowhere traversable at first.

    Attributes:
        shape: (rows + 2, cols + 2), of the padded grid.
        origin: What the last search has written at its source: subtract it.
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self.shape = shape[0] + 2, shape[1] + 2
        self._moves: Bytes | None = None
        self._distance: Ints32 | None = None
        self.origin = 0
        self._grid: tuple[Any, ...] | None = None

    @property
    def moves(self) -> Bytes:
        """uint8 (rows + 2, cols + 2), the moves out of every cell, as bits."""
        if self._moves is None:
            self._moves = np.zeros(self.shape, np.uint8)
        return self._moves

    @property
    def distance(self) -> Ints32:
        """int32, flat, padded: distances plus the origin, once a search was made."""
        if self._distance is None:
            self._distance = np.empty(self.shape[0] * self.shape[1], np.int32)
        return self._distance

    @property
    def cols(self) -> int:
        """Columns of the padded grid."""
        return self.shape[1]

    @property
    def memory(self) -> _Memory:
        """This thread's memory for grids of this shape."""
        kept: _Memory | None = getattr(_threads, "memory", None)
        if kept is None or kept.shape != self.shape:
            size = 4096 if kept is None else kept.queue.items.size
            kept = _threads.memory = _Memory(self.shape, size)
        return kept

    def release(self) -> None:
        """Give all memory back, what this thread keeps for searches included: no cell is traversable now."""
        self._moves, self._distance, self._grid, self.origin = None, None, None, 0
        _threads.memory = _threads.kept = None

    def spread(self, source: int, stops: Ints) -> int:
        """Search from a padded flat cell; with `stops`, until all of those are settled.

        Returns:
            The greatest value of `distance` that is exact; above it lie cells that were not reached.
        """
        fresh = self.origin <= _SPAN
        self.origin = 15 * _SPAN if fresh else self.origin - _SPAN
        settled = self._search(source, stops, fresh)
        if settled == _TOO_FAR:
            self.origin = 0
            return min(self._search(source, stops, True), FAR - 1)
        return min(settled, self.origin + _SPAN - 1)

    def lengths_to(self, source: int, stops: Ints) -> Ints:
        """The distances to the stops alone, int64 (n,), `FAR` where there is no way."""
        settled = self.spread(source, stops)
        lengths = self.distance[stops].astype(np.int64)
        return np.where(lengths > settled, FAR, lengths - self.origin)

    def _search(self, source: int, stops: Ints, clear: bool) -> int:
        if clear:
            self.distance[:] = FAR
        memory = self.memory
        if self._grid is None or self._grid[2] is not memory.scheduled:
            self._grid = (self.moves.ravel(), self.distance, memory.scheduled, self.cols)
        while True:
            settled = int(_search(self._grid, memory.plain_queue, source, stops, self.origin))
            if settled != _QUEUE_FULL:
                return settled
            memory.resize(4 * memory.queue.items.size)
            self.distance[:] = FAR


@checks_making
class Workspace(Search):
    """A search on masks of one shape.

    Attributes:
        world: uint8 (rows + 2, cols + 2), the mask.
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        super().__init__(shape)
        self.world = np.zeros(self.shape, np.uint8)

    def load(self, traversable: Mask) -> None:
        """Take a mask bool (rows, cols) as the grid to search."""
        self.world[1:-1, 1:-1] = traversable
        find_moves(self.world, self.moves, 0, 0)


_threads = threading.local()


def workspace(traversable: Mask) -> Workspace:
    """This thread's workspace for a mask bool (rows, cols), loaded with it."""
    rows, cols = traversable.shape
    kept: Workspace | None = getattr(_threads, "kept", None)
    if kept is None or kept.world.shape != (rows + 2, cols + 2):
        kept = _threads.kept = Workspace((rows, cols))
    kept.load(traversable)
    return kept


@njit(cache=True, nogil=True)
def find_moves(world: Bytes, moves: Bytes, row: int, col: int) -> None:
    """Write the moves out of each inner cell of a padded mask of 0 and 1, traversable or not.

    The mask is a window of the padded grid that `moves` is of; its corner lies at (row, col) there.
    """
    for r in range(1, world.shape[0] - 1):
        behind, here, ahead = world[r - 1], world[r], world[r + 1]
        written = moves[row + r, col + 1 : col + world.shape[1] - 1]
        for c in range(written.size):
            south, west, east, north = behind[c + 1], here[c], here[c + 2], ahead[c + 1]
            written[c] = (
                north
                | south << 1
                | west << 2
                | east << 3
                # No corner is cut: a diagonal move needs both cells beside it.
                | (north & west & ahead[c]) << 4
                | (north & east & ahead[c + 2]) << 5
                | (south & west & behind[c]) << 6
                | (south & east & behind[c + 2]) << 7
            )


@njit(cache=True, nogil=True)
def _push(queue: _Queue, state: Ints, cell: int, move: int, distance: int) -> None:
    """Queue a cell from which a diagonal move, and the two runs beside it, go on."""
    entry = state[_FREE_ENTRY]
    if entry >= 0:
        state[_FREE_ENTRY] = queue.links[entry]
    else:
        entry = state[_USED]
        if entry == queue.items.size:
            state[_OVERFLOW] = 1
            return
        state[_USED] = entry + 1
    # What waits is at most a diagonal move and a grid's longer side away: the ring is longer than that.
    bucket = (distance // STRAIGHT) & (queue.heads.size - 1)
    # Unsigned, as in `_run`: indexing need not look out for negative numbers.
    place, ring = np.uint64(entry), np.uint64(bucket)
    queue.items[place] = cell * 8 + move
    queue.links[place] = queue.heads[ring]
    queue.heads[ring] = entry
    state[_WAITING] += 1


@njit(cache=True, nogil=True)
def _run(grid: _Grid, queue: _Queue, state: Ints, cell: int, here: int, direction: _Direction) -> None:
    """Go straight until a wall or a cell reached as well without; queue the corners that force a turn."""
    moves, distance, scheduled = grid.moves, grid.distance, grid.scheduled
    ahead = 1 << direction.move
    side_a, side_b = direction.side_a, direction.side_b
    sides = 1 << side_a | 1 << side_b
    # Unsigned, so that indexing need not look out for negative numbers.
    at, stride = np.uint64(cell), np.uint64(direction.step)
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
            scheduled[at] |= 1 << direction.corner_a | 1 << side_a
            _push(queue, state, int(np.int64(at)), direction.corner_a, here)
        if opened >> side_b & 1:
            scheduled[at] |= 1 << direction.corner_b | 1 << side_b
            _push(queue, state, int(np.int64(at)), direction.corner_b, here)


@njit(cache=True, nogil=True)
def _runs_beside(move: int, cols: int) -> tuple[_Direction, _Direction]:
    """The vertical and the horizontal run that belong to a diagonal move."""
    north, east = move < 6, move & 1 == 1
    # A run turns at the corners on its own side only: a run to the north never turns to the south.
    a, b = (4, 5) if north else (6, 7)
    c, d = (5, 7) if east else (4, 6)
    vertical = _Direction(cols if north else -cols, 0 if north else 1, 2, 3, a, b)
    horizontal = _Direction(1 if east else -1, 3 if east else 2, 0, 1, c, d)
    return vertical, horizontal


@njit(cache=True, nogil=True)
def _step(grid: _Grid, queue: _Queue, state: Ints, target: int, there: int, move: int, follow: int) -> None:
    """Arrive at a cell by a diagonal move; queue it if its distance, or a move to follow, is new."""
    distance, scheduled = grid.distance, grid.scheduled
    at = np.uint64(target)
    if there < distance[at]:
        distance[at] = there
        scheduled[at] = follow
    elif there == distance[at] and follow & ~scheduled[at]:
        scheduled[at] |= follow
    else:
        return
    _push(queue, state, target, move, there)


@njit(cache=True, nogil=True)
def _begin(grid: _Grid, queue: _Queue, source: int, origin: int) -> Ints:
    """Queue the four diagonal moves out of the source; the queue's state."""
    queue.heads[:] = -1
    state = np.array([-1, 0, 0, 0])
    grid.distance[source] = origin
    grid.scheduled[source] = 255
    for move in range(4, 8):
        _push(queue, state, source, move, origin)
    return state


@njit(cache=True, nogil=True)
def _spread(grid: _Grid, queue: _Queue, source: int, stops: Ints, origin: int) -> int:
    """Lower the distances from `origin` on; return up to where they are exact.

    It is `_QUEUE_FULL` when the queue's memory is too small, and `_TOO_FAR` when cells lie too far from an
    origin above 0.
    """
    moves, distance = grid.moves, grid.distance
    heads, items, links = queue.heads, queue.items, queue.links
    longer_side = max(grid.moves.size // grid.cols, grid.cols)
    # No run from within `longest` gets above what earlier searches have written, or the largest number.
    longest = (FAR if origin == 0 else origin + _SPAN) - STRAIGHT * (longer_side + 2)
    state = _begin(grid, queue, source, origin)
    level, settled = origin // STRAIGHT, 0
    while state[_WAITING] > 0:
        bucket = level & (heads.size - 1)
        base = level * STRAIGHT
        # All below `base` is settled; cells of this bucket cannot improve each other, so their order is free.
        while settled < stops.size and distance[stops[settled]] <= base:
            settled += 1
        if stops.size > 0 and settled == stops.size:
            return base
        entry, heads[bucket] = heads[bucket], -1
        while entry >= 0:
            cell, move = items[entry] >> 3, items[entry] & 7
            # The entry is freed before its cell is followed, so that what that queues can take its place.
            links[entry], state[_FREE_ENTRY], entry = state[_FREE_ENTRY], entry, links[entry]
            state[_WAITING] -= 1
            here = distance[cell]
            if here < base:
                continue  # Improved since it was queued.
            if here > longest:
                if origin > 0:
                    return _TOO_FAR
                continue
            vertical, horizontal = _runs_beside(move, grid.cols)
            _run(grid, queue, state, cell, here, vertical)
            _run(grid, queue, state, cell, here, horizontal)
            if moves[cell] >> move & 1:
                target = cell + vertical.step + horizontal.step
                follow = 1 << move | 1 << vertical.move | 1 << horizontal.move
                _step(grid, queue, state, target, here + DIAGONAL, move, follow)
        if state[_OVERFLOW]:
            return _QUEUE_FULL
        level += 1
    return FAR


@njit(cache=True, nogil=True)
def _search(grid: tuple[Any, ...], queue: tuple[Any, ...], source: int, stops: Ints, origin: int) -> int:
    """`_spread` with plain tuples, whose types numba finds faster than those of named ones."""
    return _spread(_Grid(*grid), _Queue(*queue), source, stops, origin)


@njit(cache=True, nogil=True)
def to_metres(distance: Ints32, origin: float, metres: float, settled: int, lengths: Floats32) -> None:
    """Write padded flat distances as metres (rows, cols); beyond what is settled they are infinite."""
    rows, cols = lengths.shape
    for r in range(rows):
        start = (r + 1) * (cols + 2) + 1
        units, written = distance[start : start + cols], lengths[r]
        for c in range(cols):
            written[c] = (
                np.float32((np.float64(units[c]) - origin) * metres)
                if units[c] <= settled
                else np.float32(np.inf)
            )
