"""What a cell of a grid sees of the grid's corners: those that a search over corners goes on to from there.

Around obstacles, shortest paths on a grid without corner cutting turn at corners only: traversable cells with
a shut cell diagonally beside them, past which both straight neighbours are open. A cell is joined to a corner
where nothing shut and no third corner lies in the parallelogram of all shortest paths between them (simple
subgoal graphs: Uras, Koenig and Hernandez, "Subgoal Graphs for Optimal Pathfinding in Eight-Neighbor Grids",
ICAPS 2013). So what is joined is as far apart as if there were no obstacles.

Cells are those of the padded grid: (rows + 2, cols + 2), with a border that nothing enters.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Bytes, Ints, Ints32, Words
from layoutexplore.grids.bitsets import ones
from layoutexplore.planning.canonical_search import DIAGONAL, STRAIGHT

PAGE = 16
"""Side of the squares in which the numbers of corners stand side by side, whatever a cell measures."""

_ONE, _ALL = np.uint64(1), np.uint64(0xFFFFFFFFFFFFFFFF)


class Ground(NamedTuple):
    """What cells see corners on; numba kernels take it as it is.

    Attributes:
        world: uint8 (rows + 2, cols + 2), 1 where a robot can go.
        row_stops: uint64 (rows + 2, words): cells that are shut or corners, as bits, row by row.
        col_stops: uint64 (cols + 2, words): the same, column by column.
        page: int32 (pages down, pages across): which page a square of `PAGE` by `PAGE` cells is, 0 for an
            empty one.
        node: int32 (pages, PAGE, PAGE): the number of the corner in a cell, from 1; 0 where there is none.
            Few squares hold a corner.
    """

    world: Bytes
    row_stops: Words
    col_stops: Words
    page: Ints32
    node: Ints32


def shut_ground(shape: tuple[int, int]) -> Ground:
    """A grid of (rows, cols) that is nowhere traversable."""
    rows, cols = shape[0] + 2, shape[1] + 2
    return Ground(
        np.zeros((rows, cols), np.uint8),
        np.full((rows, cols // 64 + 1), _ALL, np.uint64),
        np.full((cols, rows // 64 + 1), _ALL, np.uint64),
        np.zeros((rows // PAGE + 1, cols // PAGE + 1), np.int32),
        np.zeros((64, PAGE, PAGE), np.int32),
    )


def numbers_at(ground: Ground, cells: Ints32) -> Ints32:
    """The numbers int32 (n,) of the corners in some cells int32 (n, 2); 0 where there is none."""
    rows, cols = cells.T
    numbers: Ints32 = ground.node[ground.page[rows // PAGE, cols // PAGE], rows % PAGE, cols % PAGE]
    return numbers


def with_numbers(ground: Ground, cells: Ints32, numbers: Ints) -> Ground:
    """The grid with other numbers int64 (n,) in some cells int32 (n, 2), 0 for no corner."""
    rows, cols = cells.T
    missing = np.unique(np.stack([rows, cols], axis=1)[numbers > 0] // PAGE, axis=0)
    missing = missing[ground.page[missing[:, 0], missing[:, 1]] == 0]
    if len(missing):
        used = int(ground.page.max()) + 1
        while used + len(missing) > len(ground.node):
            more = np.zeros((len(ground.node) // 2, PAGE, PAGE), np.int32)
            ground = ground._replace(node=np.concatenate([ground.node, more]))
        ground.page[missing[:, 0], missing[:, 1]] = np.arange(used, used + len(missing))
    page = ground.page[rows // PAGE, cols // PAGE]
    # The first page is that of all squares without a corner: nothing is written there.
    there = page > 0
    ground.node[page[there], rows[there] % PAGE, cols[there] % PAGE] = numbers[there]
    return ground


@njit(cache=True, nogil=True)
def number_at(ground: Ground, row: int, col: int) -> int:
    """The number of the corner in a cell, 0 where there is none."""
    number: int = ground.node[ground.page[row // PAGE, col // PAGE], row % PAGE, col % PAGE]
    return number


def room_for_corners(ground: Ground) -> Ints32:
    """Memory int32 (n, 2) for all corners that a cell can be joined to."""
    # A quarter has a diagonal and two straight runs a step of it, and the four axes have one each.
    return np.empty((8 * sum(ground.world.shape) + 16, 2), np.int32)


@njit(cache=True, nogil=True)
def octile(rows: int, cols: int) -> int:
    """The length of a path over so many rows and columns with nothing in between."""
    rows, cols = abs(rows), abs(cols)
    return STRAIGHT * (max(rows, cols) - min(rows, cols)) + DIAGONAL * min(rows, cols)


@njit(cache=True, nogil=True)
def is_corner(world: Bytes, r: int, c: int) -> bool:
    """Whether a shut cell lies diagonally beside an inner cell, and both cells beside that are open."""
    if not world[r, c]:
        return False
    north, south, west, east = world[r + 1, c], world[r - 1, c], world[r, c - 1], world[r, c + 1]
    return bool(
        (north and east and not world[r + 1, c + 1])
        or (north and west and not world[r + 1, c - 1])
        or (south and east and not world[r - 1, c + 1])
        or (south and west and not world[r - 1, c - 1])
    )


@njit(cache=True, nogil=True)
def write_stops(ground: Ground, cells: Ints32) -> None:
    """Write the stops anew at some cells int32 (n, 2)."""
    for n in range(len(cells)):
        r, c = cells[n, 0], cells[n, 1]
        by_row, by_col = _ONE << np.uint64(c & 63), _ONE << np.uint64(r & 63)
        if number_at(ground, r, c) or not ground.world[r, c]:
            ground.row_stops[r, c >> 6] |= by_row
            ground.col_stops[c, r >> 6] |= by_col
        else:
            ground.row_stops[r, c >> 6] &= ~by_row
            ground.col_stops[c, r >> 6] &= ~by_col


@njit(cache=True, nogil=True)
def _steps_to_stop(stops: Words, at: int, forwards: bool) -> int:
    """Steps from a cell of a row or column to the next stop; the border is one, so there always is one."""
    if forwards:
        k = at + 1
        w = k >> 6
        word = stops[w] & (_ALL << np.uint64(k & 63))
        while word == 0:
            w += 1
            word = stops[w]
        # All bits below the lowest one: as many as its place.
        return 64 * w + ones((word & (~word + _ONE)) - _ONE) - at
    k = at - 1
    w = k >> 6
    word = stops[w] & (_ALL >> np.uint64(63 - (k & 63)))
    while word == 0:
        w -= 1
        word = stops[w]
    # Filled up below the highest one: one more than its place.
    for shift in (1, 2, 4, 8, 16, 32):
        word |= word >> np.uint64(shift)
    return at - 64 * w - ones(word) + 1


@njit(cache=True, nogil=True)
def corners_in_sight(ground: Ground, row: int, col: int, found: Ints32) -> tuple[int, int, int, int, int]:
    """The corners that a cell is joined to, into `found`: how many, and the box that this depends on."""
    world, count = ground.world, 0
    ahead = np.empty((2, 2), np.int64)
    for k in range(2):
        ahead[0, k] = _steps_to_stop(ground.col_stops[col], row, k == 1)
        ahead[1, k] = _steps_to_stop(ground.row_stops[row], col, k == 1)
        for axis in range(2):
            steps = ahead[axis, k] if k == 1 else -ahead[axis, k]
            r, c = (row + steps, col) if axis == 0 else (row, col + steps)
            if world[r, c]:
                found[count, 0], found[count, 1] = r, c
                count += 1
    box = np.array([row - ahead[0, 0], row + ahead[0, 1], col - ahead[1, 0], col + ahead[1, 1]])
    for up in range(2):
        for right in range(2):
            count = _explore_diagonally(ground, row, col, (up, right), ahead, box, found, count)
    return count, box[0], box[1] + 1, box[2], box[3] + 1


@njit(cache=True, nogil=True)
def _explore_diagonally(
    ground: Ground,
    row: int,
    col: int,
    towards: tuple[int, int],
    ahead: Ints,
    box: Ints,
    found: Ints32,
    count: int,
) -> int:
    """`corners_in_sight` in one quarter: along a diagonal, and from each of its cells straight on."""
    world, (up, right) = ground.world, towards
    dr, dc = 2 * up - 1, 2 * right - 1
    # A stop at `rise` + 1 steps beside the path so far: farther runs would not see a free parallelogram.
    rise, aside = ahead[0, up] - 1, ahead[1, right] - 1
    r, c = row, col
    while world[r + dr, c] and world[r, c + dc] and world[r + dr, c + dc]:
        r, c = r + dr, c + dc
        if number_at(ground, r, c):
            found[count, 0], found[count, 1] = r, c
            count += 1
            break
        steps = _steps_to_stop(ground.col_stops[c], r, up == 1)
        if steps <= rise:
            rise = steps - 1
            if world[r + dr * steps, c]:
                found[count, 0], found[count, 1] = r + dr * steps, c
                count += 1
        steps = min(steps, rise + 1)
        box[0], box[1] = min(box[0], r + dr * steps), max(box[1], r + dr * steps)
        steps = _steps_to_stop(ground.row_stops[r], c, right == 1)
        if steps <= aside:
            aside = steps - 1
            if world[r, c + dc * steps]:
                found[count, 0], found[count, 1] = r, c + dc * steps
                count += 1
        steps = min(steps, aside + 1)
        box[2], box[3] = min(box[2], c + dc * steps), max(box[3], c + dc * steps)
    # What ended the diagonal was looked at as well.
    box[0], box[1] = min(box[0], r + dr), max(box[1], r + dr)
    box[2], box[3] = min(box[2], c + dc), max(box[3], c + dc)
    return count
