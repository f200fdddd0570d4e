"""Which cells of a grid are connected with one of them, at the cost of what changes.

The grid is cut into tiles. Within each its traversable cells fall into parts, and along its upper and right
side parts touch those of the next tiles. Only tiles that hold a change are taken apart again; the rest of the
work is done on parts, of which most tiles have one. Without corner cutting, cells that a robot can go between
are connected by straight moves alone.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.arrays import Bytes, Ints, Ints32, Mask, Words
from layoutexplore.grids.components import root_of

TILE = 32
"""Side of a tile in cells."""

_Parts = NDArray[np.unsignedinteger[Any]]

_PAIRS = TILE // 2
"""So many parts of two tiles touch at most along a side: between two of them lies a cell that is shut."""


class Tiles(NamedTuple):
    """The parts of all tiles; numba kernels take it as it is.

    Attributes:
        part: uint8, or uint16 once a tile falls into more parts than that can number, (rows, cols): the part
            of its tile that a cell lies in, from 1; 0 where it is shut.
        parts: int64 (tiles down, tiles across), how many there are.
        touching: uint16 (tiles down, tiles across, 2, n, 2), pairs of parts that touch above (0) and to the
            right (1): of the tile and of the next one; 0 behind the last pair.
        reached: uint64 (tiles down, tiles across), of the first 63 parts those that are connected, as bits.
    """

    part: _Parts
    parts: Ints
    touching: NDArray[np.uint16]
    reached: Words


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
            np.zeros(shape, np.uint8),
            np.zeros((down, across), np.int64),
            np.zeros((down, across, 2, _PAIRS, 2), np.uint16),
            np.zeros((down, across), np.uint64),
        )
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
        if not _divide(world, self._tiles, self._dirty):
            self._tiles = self._tiles._replace(part=self._tiles.part.astype(np.uint16))
            _divide(world, self._tiles, self._dirty)
        _connect(self._tiles, self._dirty, row, col, self.barred)
        self._dirty[:] = False


@njit(cache=True, nogil=True)
def _divide(world: Bytes, tiles: Tiles, dirty: Mask) -> bool:
    """Find the parts of the dirty tiles, and what touches along their sides; False if they are too many."""
    down, across = tiles.parts.shape
    queue = np.empty((TILE * TILE, 2), np.int64)
    for i in range(down):
        for j in range(across):
            if dirty[i, j]:
                count = _flood(world, tiles.part, i * TILE, j * TILE, queue)
                if count < 0:
                    return False
                tiles.parts[i, j] = count
    for i in range(down):
        for j in range(across):
            # The sides belong to the tiles below and to the left of them.
            if i + 1 < down and (dirty[i, j] or dirty[i + 1, j]):
                _touch(tiles, i, j, 0)
            if j + 1 < across and (dirty[i, j] or dirty[i, j + 1]):
                _touch(tiles, i, j, 1)
    return True


@njit(cache=True, nogil=True)
def _flood(world: Bytes, part: _Parts, row: int, col: int, queue: Ints) -> int:
    """Number the parts of the tile that begins at (row, col); how many they are, -1 where too many."""
    most = 256**part.itemsize - 1
    bottom, right = min(row + TILE, world.shape[0]), min(col + TILE, world.shape[1])
    part[row:bottom, col:right] = 0
    count = 0
    for r0 in range(row, bottom):
        for c0 in range(col, right):
            if not world[r0, c0] or part[r0, c0]:
                continue
            # One more would be numbered 0, as shut cells are.
            if count == most:
                return -1
            count += 1
            part[r0, c0] = count
            queue[0, 0], queue[0, 1] = r0, c0
            first, last = 0, 1
            while first < last:
                r, c = queue[first, 0], queue[first, 1]
                first += 1
                for step in range(4):
                    y, x = r + (step == 0) - (step == 1), c + (step == 2) - (step == 3)
                    if row <= y < bottom and col <= x < right and world[y, x] and not part[y, x]:
                        part[y, x] = count
                        queue[last, 0], queue[last, 1] = y, x
                        last += 1
    return count


@njit(cache=True, nogil=True)
def _touch(tiles: Tiles, i: int, j: int, side: int) -> None:
    """Write down the parts that touch along the upper (0) or the right (1) side of a tile."""
    part, pairs = tiles.part, tiles.touching[i, j, side]
    pairs[:] = 0
    count, mine_before, other_before = 0, 0, 0
    for k in range(TILE):
        r, c = (i * TILE + TILE - 1, j * TILE + k) if side == 0 else (i * TILE + k, j * TILE + TILE - 1)
        if r >= part.shape[0] or c >= part.shape[1]:
            break
        mine, other = part[r, c], (part[r + 1, c] if side == 0 else part[r, c + 1])
        # A pair lasts until a shut cell on one side: its parts do not change in between.
        if mine and other and not (mine == mine_before and other == other_before):
            pairs[count, 0], pairs[count, 1] = mine, other
            count += 1
        mine_before, other_before = (mine, other) if mine and other else (0, 0)


@njit(cache=True, nogil=True)
def _connect(tiles: Tiles, dirty: Mask, row: int, col: int, barred: Bytes) -> None:
    """Join the parts that touch, and write `barred` where it may have changed."""
    down, across = tiles.parts.shape
    offsets = np.zeros(down * across + 1, np.int64)
    for t in range(down * across):
        offsets[t + 1] = offsets[t] + tiles.parts[t // across, t % across]
    parent = np.arange(offsets[-1])
    for t in range(down * across):
        for side in range(2):
            for pair in tiles.touching[t // across, t % across, side]:
                if pair[0] == 0:
                    break
                a = root_of(parent, offsets[t] + pair[0] - 1)
                b = root_of(parent, offsets[t + (across if side == 0 else 1)] + pair[1] - 1)
                parent[max(a, b)] = min(a, b)
    home = root_of(parent, offsets[row // TILE * across + col // TILE] + tiles.part[row, col] - 1)
    for i in range(down):
        for j in range(across):
            first, bits = offsets[i * across + j], np.uint64(0)
            for k in range(tiles.parts[i, j]):
                if root_of(parent, first + k) == home:
                    bits |= np.uint64(1) << np.uint64(min(k, 63))
            # Bit 63 stands for all further parts, of which it cannot tell which.
            if dirty[i, j] or bits != tiles.reached[i, j] or tiles.parts[i, j] > 63:
                tiles.reached[i, j] = bits
                _write(tiles.part, parent, first, home, i * TILE, j * TILE, barred)


@njit(cache=True, nogil=True)
def _write(part: _Parts, parent: Ints, first: int, home: int, row: int, col: int, barred: Bytes) -> None:
    """Write the cells of the tile that begins at (row, col)."""
    for r in range(row, min(row + TILE, part.shape[0])):
        for c in range(col, min(col + TILE, part.shape[1])):
            k = part[r, c]
            barred[r, c] = k == 0 or root_of(parent, first + k - 1) != home
