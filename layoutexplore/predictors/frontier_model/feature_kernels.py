"""Local features of one frontier: rays, floods through the unknown, walls in line, doors.

A frontier has a frame: `forward` is the grid axis that points most into the unknown, `sideways` the other
axis, turned so that the frontier's normal leans towards it. In this frame mirrored grids look the same.
All kernels read the bits of a `BitMap` whose margin is wider than they look.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import ZERO, Bytes, Floats, Floats32, Ints, Ints32
from layoutexplore.grids.boxes import box_around
from layoutexplore.predictors.bit_map import ALONG_COLS, ALONG_ROWS, DOOR_BIT, FREE_BIT, UNKNOWN_BIT, WALL_BIT

RAYS = 16
_SIN, _COS = np.sin(np.arange(RAYS) * 2 * np.pi / RAYS), np.cos(np.arange(RAYS) * 2 * np.pi / RAYS)

AHEAD, ASIDE, BESIDE = 16, 8, 12
"""Slices in which walls are looked for: ahead, as far to either side; and along the path to either side."""

BACK, FORTH = 6, 10
"""Slices back and ahead that walls beside a frontier's path are measured over."""

TOUCHED = 24
"""Free cells kept of those that a flood touches."""


class Frame(NamedTuple):
    """Columns of frontiers' frames: the middle, two directions, slant and sides."""

    row: int
    col: int
    forward_row: int
    forward_col: int
    side_row: int
    side_col: int
    slant: int
    sides: int


FRAME = Frame(*range(len(Frame._fields)))


class FloodScratch(NamedTuple):
    """What floods write on, of `flood_sizes`.

    Attributes:
        taken: uint8 (n,), 1 for the cells that a flood has taken, from the first row on that it can reach;
            all 0 between two floods.
        queue: int32 (n,), the cells of a flood, in the order in which it takes them.
    """

    taken: Bytes
    queue: Ints32


@njit(cache=True, nogil=True)
def flood_sizes(members: Ints32, offsets: Ints, wanted: Ints, depth: int, cols: int) -> tuple[int, int]:
    """Cells of whole rows, and cells, that the largest flood so deep around some frontiers looks at."""
    rows, cells = 0, 0
    for k in wanted:
        cluster = members[offsets[k] : offsets[k + 1]]
        row0, row1, col0, col1 = box_around(cluster)
        down, across = row1 - row0 + 2 * (depth + 1), col1 - col0 + 2 * (depth + 1)
        rows, cells = max(rows, down), max(cells, down * across)
    return rows * cols, cells


@njit(cache=True, nogil=True)
def frontier_frame(code: Bytes, members: Ints32) -> Floats:
    """The frame of a frontier int32 (n, 2).

    Returns:
        float64 (8,): row and column of its middle cell, forward (row, col), sideways (row, col), slant of the
            normal (0 straight on, 1 diagonal), number of sides that border the unknown.
    """
    normal_row, normal_col, sides = 0, 0, 0
    sum_row, sum_col, count = 0, 0, len(members)
    for i in range(count):
        sum_row += members[i, 0]
        sum_col += members[i, 1]
        for dr, dc in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            if code[members[i, 0] + dr, members[i, 1] + dc] & UNKNOWN_BIT:
                normal_row += dr
                normal_col += dc
                sides += 1
    # In whole numbers, so that of equally near cells it is the first one wherever the grid lies.
    middle, nearest = 0, np.int64(2**62)
    for i in range(count):
        away = (count * members[i, 0] - sum_row) ** 2 + (count * members[i, 1] - sum_col) ** 2
        if away < nearest:
            middle, nearest = i, away
    frame = np.zeros(len(FRAME))
    frame[FRAME.row], frame[FRAME.col] = members[middle, 0], members[middle, 1]
    row_sign, col_sign = (1.0 if normal_row >= 0 else -1.0), (1.0 if normal_col >= 0 else -1.0)
    if abs(normal_row) >= abs(normal_col):
        frame[FRAME.forward_row], frame[FRAME.side_col] = row_sign, col_sign
    else:
        frame[FRAME.forward_col], frame[FRAME.side_row] = col_sign, row_sign
    frame[FRAME.slant] = min(abs(normal_row), abs(normal_col)) / max(abs(normal_row), abs(normal_col), 1)
    frame[FRAME.sides] = sides
    return frame


@njit(cache=True, nogil=True)
def cast_rays(code: Bytes, frame: Floats, reach: int, out: Floats32) -> None:
    """Per ray: length of the first unknown run, what ends it, distance to a wall, unknown cells before it.

    What ends it: 0 wall, 1 free, 2 nothing within reach, 3 there is no unknown on the ray. Lengths in cells.
    """
    # Not `grids.rays.ray_frame`: the models learnt from one sample a cell's length, not all cells crossed.
    forward_row, forward_col = frame[FRAME.forward_row], frame[FRAME.forward_col]
    side_row, side_col = frame[FRAME.side_row], frame[FRAME.side_col]
    for ray in range(RAYS):
        # Ray 0 looks forward; they turn towards the side that the frontier's normal leans to.
        dr = _COS[ray] * forward_row + _SIN[ray] * side_row
        dc = _COS[ray] * forward_col + _SIN[ray] * side_col
        first, end, hit, unknown = 0, 3, reach, 0
        for t in range(1, reach):
            bits = code[int(frame[FRAME.row] + dr * t + 0.5), int(frame[FRAME.col] + dc * t + 0.5)]
            if bits & WALL_BIT:
                hit = t
                if end == 2:
                    end = 0
                break
            if bits & UNKNOWN_BIT:
                unknown += 1
                if end == 3:
                    end = 2
                if end == 2:
                    first += 1
            elif end == 2:
                end = 1
        out[4 * ray], out[4 * ray + 1], out[4 * ray + 2], out[4 * ray + 3] = first, end, hit, unknown


@njit(cache=True, nogil=True)
def _start_flood(
    code: Bytes, barrier: int, members: Ints32, scratch: FloodScratch, base: int
) -> tuple[int, int, int]:
    """Queue the unknown cells beside a frontier that no barrier takes; `taken` begins at flat cell `base`.

    Returns:
        Number of unknown cells beside it, number of those queued, and the bits of all.
    """
    cols, (taken, queue) = code.shape[1], scratch
    flat = code.ravel()
    started = queued = met = 0
    for n in range(len(members)):
        i = members[n, 0] * cols + members[n, 1]
        for step in (cols, -cols, 1, -1):
            k = i + step
            # Taken whether queued or not: a cell between two frontier cells counts once.
            if flat[k] & UNKNOWN_BIT and not taken[k - base]:
                taken[k - base] = 1
                started += 1
                met |= int(flat[k])
                if not flat[k] & barrier:
                    queue[queued] = k
                    queued += 1
    return started, queued, met


@njit(cache=True, nogil=True)
def _forget_flood(cols: int, members: Ints32, scratch: FloodScratch, base: int, count: int) -> None:
    """Make `taken` 0 again after a flood from a frontier that has queued so many cells."""
    taken, queue = scratch
    for n in range(len(members)):
        i = members[n, 0] * cols + members[n, 1] - base
        for step in (cols, -cols, 1, -1):
            taken[i + step] = 0
    origin = np.uint64(base)
    for n in range(count):
        taken[np.uint64(queue[np.uint64(n)]) - origin] = 0


@njit(cache=True, nogil=True)
def _thin_out(touched: Ints32) -> None:
    """Keep every other cell."""
    for j in range(TOUCHED // 2):
        touched[j] = touched[2 * j]
    touched[TOUCHED // 2 :] = -1


@njit(cache=True, nogil=True)
def flood_unknown(
    code: Bytes,
    barrier: int,
    members: Ints32,
    depths: Ints,
    scratch: FloodScratch,
    out: Floats32,
    touched: Ints32,
) -> int:
    """Flood the unknown behind a frontier, ring by ring, not into cells with one of the bits of a barrier.

    Writes the number of cells within each depth, then the sides at which the flood touches walls, free space
    and the barrier, the share of its starting cells that the barrier takes, and whether it came to an end
    before the last depth. `touched` int32 (TOUCHED,) receives the free cells that the flood touches, evenly
    thinned out, as indices into the flat bit map; -1 for none.

    Returns:
        All bits of the unknown cells that the flood meets.
    """
    # Not `grids.flood.spread_in_place`: here the sides that the flood touches are counted and sampled.
    cols, (taken, queue) = code.shape[1], scratch
    flat = code.ravel()
    base = (box_around(members)[0] - depths[-1] - 1) * cols
    started, last, met = _start_flood(code, barrier, members, scratch, base)
    # Unsigned as `k` is: the difference of an unsigned and a signed number would not be a whole one.
    origin = np.uint64(base)
    stopped = started - last
    first = walls = free = barred = 0
    touched[:] = -1
    stride, kept, depth = 1, 0, 1
    for d in range(len(depths)):
        while depth < depths[d] and first < last:
            depth += 1
            ring = last  # queue[first:ring] is one ring, all cells as many steps away
            while first < ring:
                i = queue[first]
                first += 1
                for step in (cols, -cols, 1, -1):
                    k = np.uint64(i + step)
                    bits = flat[k]
                    if bits & UNKNOWN_BIT:
                        if taken[k - origin]:
                            continue
                        met |= bits
                        if bits & barrier:
                            # Not taken: every side at which the flood meets the barrier counts.
                            barred += 1
                            continue
                        taken[k - origin] = 1
                        queue[np.uint64(last)] = k
                        last += 1
                    elif bits & WALL_BIT:
                        walls += 1
                    else:
                        # Every `stride`-th free cell is kept; when the list is full, half of it goes and
                        # the stride doubles, so that those kept stay evenly spread.
                        if free % stride == 0:
                            if kept == TOUCHED:
                                _thin_out(touched)
                                kept, stride = TOUCHED // 2, 2 * stride
                            if free % stride == 0:
                                touched[kept] = k
                                kept += 1
                        free += 1
        out[d] = last
    _forget_flood(cols, members, scratch, base, last)
    end = len(depths)
    out[end], out[end + 1], out[end + 2] = walls, free, barred
    out[end + 3], out[end + 4] = stopped / max(started, 1), first == last
    return met


@njit(cache=True, nogil=True)
def _bits_on_lines(
    code: Bytes,
    along_rows: bool,
    row: int,
    col: int,
    lines: tuple[int, int, int],
    cells: tuple[int, int, int],
    other: int,
) -> tuple[Ints32, Ints32]:
    """Count the cells with the bit of a wall, and with one of the other bits, on lines along rows or columns.

    `lines` and `cells` say where, from (row, col), the lines and the cells of each begin, the step (1 or -1),
    and how many.
    """
    walls, others = np.zeros(lines[2], np.int32), np.zeros(lines[2], np.int32)
    at = cells[0] + min(0, cells[1] * (cells[2] - 1))
    if along_rows:
        for n in range(lines[2]):
            r = row + lines[0] + n * lines[1]
            hit, met = np.int32(0), np.int32(0)
            for bits in code[r, col + at : col + at + cells[2]]:
                hit += np.int32((bits & WALL_BIT) != 0)
                met += np.int32((bits & other) != 0)
            walls[n], others[n] = hit, met
        return walls, others
    # Cells of lines along the columns are taken row by row, as they lie in memory; lines that run down come
    # out backwards.
    left = col + lines[0] + min(0, lines[1] * (lines[2] - 1))
    for r in range(row + at, row + at + cells[2]):
        line = code[r, left : left + lines[2]]
        for n in range(lines[2]):
            walls[n] += np.int32((line[n] & WALL_BIT) != 0)
            others[n] += np.int32((line[n] & other) != 0)
    return walls[:: lines[1]], others[:: lines[1]]


@njit(cache=True, nogil=True)
def walls_in_line(code: Bytes, frame: Floats, unit: int, out: Floats32) -> None:
    """The longest walls across the frontier's path, and beside it.

    `AHEAD` slices of `unit` cells forward: most wall cells on a line across the path within `ASIDE` units to
    either side; the same for extensions of walls; `BESIDE` slices to either side: most wall cells on a line
    along the path.
    """
    row, col = int(frame[FRAME.row]), int(frame[FRAME.col])
    # The frame's axes are the grid's: of a direction's two numbers one is 1 or -1 and the other 0.
    forward = int(frame[FRAME.forward_row] + frame[FRAME.forward_col])
    side = int(frame[FRAME.side_row] + frame[FRAME.side_col])
    upright = frame[FRAME.forward_row] != 0
    across = ALONG_ROWS if upright else ALONG_COLS
    aside, length, one = ASIDE * unit, AHEAD * unit, ZERO + 1
    walls, extended = _bits_on_lines(
        code, upright, row, col, (ZERO, forward, length), (-aside, one, 2 * aside + 1), across
    )
    for k in range(AHEAD):
        out[k] = walls[k * unit : (k + 1) * unit].max()
        out[AHEAD + k] = extended[k * unit : (k + 1) * unit].max()
    beside, back, width = BESIDE * unit, BACK * unit, (BACK + FORTH) * unit
    lines, cells = (-beside * side, side, 2 * beside), (-back * forward, forward, width)
    walls, _ = _bits_on_lines(code, not upright, row, col, lines, cells, ZERO)
    for k in range(2 * BESIDE):
        out[2 * AHEAD + k] = walls[k * unit : (k + 1) * unit].max()


@njit(cache=True, nogil=True)
def doors_near(code: Bytes, members: Ints32, frame: Floats, reach: int, out: Floats32) -> None:
    """Share of the frontier in doors, distance of its middle to the nearest door, door cells near it."""
    inside = 0
    for i in range(len(members)):
        inside += (code[members[i, 0], members[i, 1]] & DOOR_BIT) != 0
    row, col = int(frame[FRAME.row]), int(frame[FRAME.col])
    nearest, free, unknown = reach * reach, 0, 0
    for dr in range(-reach, reach + 1):
        # Few rows hold a door: a row is passed over by all its bits at once.
        line = code[row + dr, col - reach : col + reach + 1]
        some = np.uint8(0)
        for bits in line:
            some |= bits
        if not some & DOOR_BIT:
            continue
        for dc in range(-reach, reach + 1):
            bits = line[dc + reach]
            if bits & DOOR_BIT and dr * dr + dc * dc <= reach * reach:
                nearest = min(nearest, dr * dr + dc * dc)
                free += (bits & FREE_BIT) != 0
                unknown += (bits & UNKNOWN_BIT) != 0
    out[0], out[1], out[2], out[3] = inside / len(members), np.sqrt(nearest), free, unknown
