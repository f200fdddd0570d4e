"""Which cells of a grid are connected with one of them, at the cost of what changes.

The grid is cut into tiles. Within each its traversable cells fall into parts, and along its upper and right
side parts touch those of the next tiles. Only tiles that hold a change are taken apart again; the rest of the
work is done on parts, of which most tiles have one. Without corner cutting, cells that a robot can go between
are connected by straight moves alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.errors import checks_making
from layoutexplore.grids.arrays import Bytes, Ints, Ints32, Mask, Words
from layoutexplore.grids.components import join, root_of

TILE = 32
"""Side of a tile in cells."""

_Parts = NDArray[np.uint16]

_PAIRS = TILE // 2
"""So many parts of two tiles touch at most along a side: between two of them lies a cell that is shut."""

_LOWER, _UPPER, _LEFT, _RIGHT = range(4)
"""The sides of a tile."""


class Tiles(NamedTuple):
    """The parts of all tiles; numba kernels take it as it is.

    The parts of single cells are not kept: where a tile has several, it is flooded again to be written.

    Attributes:
        sides: uint16 (tiles down, tiles across, 4, TILE), along each side of a tile the part that its cells
            lie in, from 1; 0 where they are shut or outside.
        parts: int64 (tiles down, tiles across), how many there are.
        touching: uint16 (tiles down, tiles across, 2, n, 2), pairs of parts that touch above (0) and to the
            right (1): of the tile and of the next one; 0 behind the last pair.
        reached: uint64 (tiles down, tiles across), of the first 63 parts those that are connected, as bits.
    """

    sides: _Parts
    parts: Ints
    touching: _Parts
    reached: Words


class _Scratch(NamedTuple):
    """Memory to flood a tile in.

    Attributes:
        part: uint16 (TILE, TILE), the part that each of its cells lies in, from 1; 0 where it is shut.
        queue: int64 (TILE * TILE, 2).
    """

    part: _Parts
    queue: Ints


@checks_making
class ConnectedTiles:
    """The cells connected with a source on a grid that changes, nowhere traversable at first.

    Args:
        shape: (rows, cols) of the padded grid.

    Attributes:
        barred: uint8 (rows, cols), 0 where a cell is connected with the source, 1 elsewhere.
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        down, across = -(-shape[0] // TILE), -(-shape[1] // TILE)
        self._tiles = Tiles(
            np.zeros((down, across, 4, TILE), np.uint16),
            np.zeros((down, across), np.int64),
            np.zeros((down, across, 2, _PAIRS, 2), np.uint16),
            np.zeros((down, across), np.uint64),
        )
        self._scratch = _Scratch(np.zeros((TILE, TILE), np.uint16), np.empty((TILE * TILE, 2), np.int64))
        self._dirty = np.zeros((down, across), np.bool_)
        self.barred = np.ones(shape, np.uint8)

    def note(self, cells: Ints32) -> None:
        """Cells int32 (n, 2) have changed."""
        self._dirty[cells[:, 0] // TILE, cells[:, 1] // TILE] = True

    def update(self, world: Bytes, row: int, col: int) -> None:
        """Follow the noted changes of a grid uint8 (rows, cols), 1 where a robot can go.

        Args:
            world: The grid.
            row: Of the source, which is traversable; likewise `col`.
            col: See `row`.
        """
        _divide(world, self._tiles, self._dirty, self._scratch)
        _connect(world, self._tiles, self._dirty, (row, col), self._scratch, self.barred)
        self._dirty[:] = False


@njit(cache=True, nogil=True)
def _divide(world: Bytes, tiles: Tiles, dirty: Mask, scratch: _Scratch) -> None:
    """Find the parts of the dirty tiles, and what touches along their sides."""
    down, across = tiles.parts.shape
    for i in range(down):
        for j in range(across):
            if dirty[i, j]:
                tiles.parts[i, j] = _flood(world, scratch, i * TILE, j * TILE)
                sides, part = tiles.sides[i, j], scratch.part
                sides[_LOWER], sides[_UPPER] = part[0], part[TILE - 1]
                sides[_LEFT], sides[_RIGHT] = part[:, 0], part[:, TILE - 1]
    for i in range(down):
        for j in range(across):
            # The sides belong to the tiles below and to the left of them.
            if i + 1 < down and (dirty[i, j] or dirty[i + 1, j]):
                _touch(tiles.sides[i, j, _UPPER], tiles.sides[i + 1, j, _LOWER], tiles.touching[i, j, 0])
            if j + 1 < across and (dirty[i, j] or dirty[i, j + 1]):
                _touch(tiles.sides[i, j, _RIGHT], tiles.sides[i, j + 1, _LEFT], tiles.touching[i, j, 1])


@njit(cache=True, nogil=True)
def _flood(world: Bytes, scratch: _Scratch, row: int, col: int) -> int:
    """Number the parts of the tile that begins at (row, col) in the scratch memory; how many they are."""
    part, queue = scratch.part, scratch.queue
    part[:] = 0
    bottom, right = min(TILE, world.shape[0] - row), min(TILE, world.shape[1] - col)
    count = 0
    for r0 in range(bottom):
        for c0 in range(right):
            if not world[row + r0, col + c0] or part[r0, c0]:
                continue
            count += 1
            part[r0, c0] = count
            queue[0, 0], queue[0, 1] = r0, c0
            # Every cell of the part enters the queue once; `queue[first:last]` is to be spread from.
            # Where the part goes on in other tiles is found along the sides (`_touch`).
            first, last = 0, 1
            while first < last:
                r, c = queue[first, 0], queue[first, 1]
                first += 1
                for step in range(4):
                    y, x = r + (step == 0) - (step == 1), c + (step == 2) - (step == 3)
                    if 0 <= y < bottom and 0 <= x < right and world[row + y, col + x] and not part[y, x]:
                        part[y, x] = count
                        queue[last, 0], queue[last, 1] = y, x
                        last += 1
    return count


@njit(cache=True, nogil=True)
def _touch(mine: _Parts, others: _Parts, pairs: _Parts) -> None:
    """Write down the pairs of parts uint16 (n, 2) that touch along two sides uint16 (TILE,) of tiles."""
    pairs[:] = 0
    count, mine_before, other_before = 0, 0, 0
    for k in range(TILE):
        a, b = mine[k], others[k]
        # A pair lasts until a shut cell on one side: its parts do not change in between.
        if a and b and not (a == mine_before and b == other_before):
            pairs[count, 0], pairs[count, 1] = a, b
            count += 1
        mine_before, other_before = (a, b) if a and b else (0, 0)


@njit(cache=True, nogil=True)
def _connect(
    world: Bytes, tiles: Tiles, dirty: Mask, source: tuple[int, int], scratch: _Scratch, barred: Bytes
) -> None:
    """Join the parts that touch, and write `barred` where it may have changed."""
    down, across = tiles.parts.shape
    offsets = np.zeros(down * across + 1, np.int64)
    for t in range(down * across):
        offsets[t + 1] = offsets[t] + tiles.parts[t // across, t % across]
    parent = np.arange(offsets[-1]).astype(np.int32)
    for t in range(down * across):
        for side in range(2):
            for pair in tiles.touching[t // across, t % across, side]:
                if pair[0] == 0:
                    break
                other = offsets[t + (across if side == 0 else 1)] + pair[1] - 1
                join(parent, offsets[t] + pair[0] - 1, other)
    i, j = source[0] // TILE, source[1] // TILE
    _flood(world, scratch, i * TILE, j * TILE)
    number = scratch.part[source[0] - i * TILE, source[1] - j * TILE]
    home = root_of(parent, offsets[i * across + j] + number - 1)
    connected = np.zeros(TILE * TILE // 2 + 1, np.bool_)  # By part; number 0 are the cells that are shut.
    for i in range(down):
        for j in range(across):
            first, count, bits, some = offsets[i * across + j], tiles.parts[i, j], np.uint64(0), 0
            for k in range(count):
                connected[k + 1] = root_of(parent, first + k) == home
                if connected[k + 1]:
                    some += 1
                    bits |= np.uint64(1) << np.uint64(min(k, 63))
            # Bit 63 stands for all further parts, of which it cannot tell which.
            if not (dirty[i, j] or bits != tiles.reached[i, j] or count > 63):
                continue
            tiles.reached[i, j] = bits
            row, col = i * TILE, j * TILE
            if some == 0:
                barred[row : row + TILE, col : col + TILE] = 1
            elif some == count:
                _write_shut(world, row, col, barred)
            else:
                _flood(world, scratch, row, col)
                _write_parts(scratch.part, connected, row, col, barred)


@njit(cache=True, nogil=True)
def _write_shut(world: Bytes, row: int, col: int, barred: Bytes) -> None:
    """Bar the shut cells alone of the tile that begins at (row, col)."""
    for r in range(row, min(row + TILE, world.shape[0])):
        for c in range(col, min(col + TILE, world.shape[1])):
            barred[r, c] = 1 - world[r, c]


@njit(cache=True, nogil=True)
def _write_parts(part: _Parts, connected: Mask, row: int, col: int, barred: Bytes) -> None:
    """Bar the cells outside of the connected parts, in the tile that begins at (row, col)."""
    for r in range(row, min(row + TILE, barred.shape[0])):
        for c in range(col, min(col + TILE, barred.shape[1])):
            barred[r, c] = not connected[part[r - row, c - col]]
