"""Kernels that probe the surroundings of one frontier: rays, floods through the unknown, walls in line.

A frontier has a frame: `forward` is the grid axis that points most into the unknown, `sideways` the other axis, turned so that
the frontier's normal leans towards it. Mirrored situations look the same in this frame.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

RAYS = 16
_SIN, _COS = np.sin(np.arange(RAYS) * 2 * np.pi / RAYS), np.cos(np.arange(RAYS) * 2 * np.pi / RAYS)

ALONG_ROWS, ALONG_COLS = 1, 2
"""Bits of `wall_extensions`: the cell continues a wall that runs along its row, along its column."""


@njit(cache=True, nogil=True)
def wall_extensions(cells: NDArray[np.int8], shortest: int, reach: int) -> NDArray[np.uint8]:
    """Unknown cells that continue a wall straight on, up to the next known cell.

    Args:
        cells: int8 (rows, cols).
        shortest: Cells of wall in line that are continued.
        reach: How many cells far.

    Returns:
        uint8 (rows, cols), the bits `ALONG_ROWS` and `ALONG_COLS`.
    """
    rows, cols = cells.shape
    bits = np.zeros((rows, cols), np.uint8)
    for r in range(rows):
        for side in range(2):
            run, left = 0, 0
            for k in range(cols):
                c = k if side == 0 else cols - 1 - k
                run, left = _continue(cells[r, c], run, left, shortest, reach)
                if left > 0 and cells[r, c] == -1:
                    bits[r, c] |= 1
    # Column by column, but all columns of a row at once: rows are what lies together in memory.
    for side in range(2):
        runs, lefts = np.zeros(cols, np.int32), np.zeros(cols, np.int32)
        for k in range(rows):
            r = k if side == 0 else rows - 1 - k
            for c in range(cols):
                runs[c], lefts[c] = _continue(cells[r, c], runs[c], lefts[c], shortest, reach)
                if lefts[c] > 0 and cells[r, c] == -1:
                    bits[r, c] |= 2
    return bits


@njit(cache=True, nogil=True, inline="always")
def _continue(value: int, run: int, left: int, shortest: int, reach: int) -> tuple[int, int]:
    """Length of the wall that ends here, and how far it may still be continued."""
    if value == 100:
        return run + 1, 0
    if value == -1:
        return 0, (reach if run >= shortest else max(left - 1, 0))
    return 0, 0


@njit(cache=True, nogil=True)
def frontier_frame(cells: NDArray[np.int8], members: NDArray[np.int32]) -> NDArray[np.float64]:
    """The frame of a frontier int32 (n, 2).

    Returns:
        float64 (8,): row and column of its middle cell, forward (row, col), sideways (row, col), slant of the normal
        (0 straight on, 1 diagonal), number of sides that border the unknown.
    """
    rows, cols = cells.shape
    normal_row, normal_col, sides = 0, 0, 0
    for i in range(len(members)):
        for step in range(4):
            dr, dc = (step == 0) - (step == 1), (step == 2) - (step == 3)
            r, c = members[i, 0] + dr, members[i, 1] + dc
            if 0 <= r < rows and 0 <= c < cols and cells[r, c] == -1:
                normal_row += dr
                normal_col += dc
                sides += 1
    frame = np.zeros(8)
    middle = np.argmin((members[:, 0] - members[:, 0].mean()) ** 2 + (members[:, 1] - members[:, 1].mean()) ** 2)
    frame[0], frame[1] = members[middle, 0], members[middle, 1]
    row_sign, col_sign = (1.0 if normal_row >= 0 else -1.0), (1.0 if normal_col >= 0 else -1.0)
    if abs(normal_row) >= abs(normal_col):
        frame[2], frame[5] = row_sign, col_sign
    else:
        frame[3], frame[4] = col_sign, row_sign
    frame[6] = min(abs(normal_row), abs(normal_col)) / max(abs(normal_row), abs(normal_col), 1)
    frame[7] = sides
    return frame


@njit(cache=True, nogil=True)
def cast_rays(cells: NDArray[np.int8], frame: NDArray[np.float64], reach: int, out: NDArray[np.float32]) -> None:
    """Per ray: length of the first unknown stretch, what ends it, distance to the first wall, unknown cells before that.

    What ends it: 0 wall, 1 free, 2 nothing within reach, 3 there is no unknown on the ray. Lengths in cells.
    """
    for ray in range(RAYS):
        dr, dc = _COS[ray] * frame[2] + _SIN[ray] * frame[4], _COS[ray] * frame[3] + _SIN[ray] * frame[5]
        first, end, hit, unknown = 0, 3, reach, 0
        for t in range(1, reach):
            r, c = int(np.floor(frame[0] + dr * t + 0.5)), int(np.floor(frame[1] + dc * t + 0.5))
            if not (0 <= r < cells.shape[0] and 0 <= c < cells.shape[1]):
                break
            value = cells[r, c]
            if value == 100:
                hit = t
                if end == 2:
                    end = 0
                break
            if value == -1:
                unknown += 1
                if end == 3:
                    end = 2
                if end == 2:
                    first += 1
            elif end == 2:
                end = 1
        out[4 * ray], out[4 * ray + 1], out[4 * ray + 2], out[4 * ray + 3] = first, end, hit, unknown


@njit(cache=True, nogil=True)
def flood_unknown(
    cells: NDArray[np.int8],
    barrier: NDArray[np.bool_],
    members: NDArray[np.int32],
    depths: NDArray[np.int64],
    stamp: NDArray[np.int32],
    mark: int,
    queue: NDArray[np.int32],
    out: NDArray[np.float32],
) -> None:
    """Flood the unknown behind a frontier, ring by ring, not across a barrier.

    Writes the number of cells within each depth, then the sides at which the flood touches walls, free space and the
    barrier, the share of its starting cells that the barrier takes, and whether it came to an end before the last depth.
    `stamp` int32 (rows, cols) must not hold `mark`.
    """
    rows, cols = cells.shape
    first = last = started = stopped = walls = free = barred = 0
    for n in range(len(members)):
        for step in range(4):
            r, c = members[n, 0] + (step == 0) - (step == 1), members[n, 1] + (step == 2) - (step == 3)
            if 0 <= r < rows and 0 <= c < cols and cells[r, c] == -1 and stamp[r, c] != mark:
                stamp[r, c] = mark
                started += 1
                if barrier[r, c]:
                    stopped += 1
                else:
                    queue[last] = r, c
                    last += 1
    depth = 1
    for d in range(len(depths)):
        while depth < depths[d]:
            depth += 1
            ring = last
            while first < ring:
                row, col = queue[first]
                first += 1
                for step in range(4):
                    r, c = row + (step == 0) - (step == 1), col + (step == 2) - (step == 3)
                    if not (0 <= r < rows and 0 <= c < cols):
                        continue
                    if cells[r, c] == 100:
                        walls += 1
                    elif cells[r, c] == 0:
                        free += 1
                    elif stamp[r, c] != mark:
                        if barrier[r, c]:
                            barred += 1
                            continue
                        stamp[r, c] = mark
                        queue[last] = r, c
                        last += 1
        out[d] = last
    end = len(depths)
    out[end], out[end + 1], out[end + 2], out[end + 3], out[end + 4] = (
        walls,
        free,
        barred,
        stopped / max(started, 1),
        first == last,
    )


@njit(cache=True, nogil=True)
def walls_in_line(
    cells: NDArray[np.int8], extensions: NDArray[np.uint8], frame: NDArray[np.float64], unit: int, out: NDArray[np.float32]
) -> None:
    """The longest walls across the frontier's way, and beside it.

    16 slices of `unit` cells forward: most wall cells on a line across the way within 8 units to either side; the same 16
    for extensions of walls; 24 slices sideways: most wall cells on a line along the way, from 6 units back to 10 ahead.
    """
    across = 1 if frame[2] != 0 else 2
    r0, c0 = int(frame[0]), int(frame[1])
    ur, uc, vr, vc = int(frame[2]), int(frame[3]), int(frame[4]), int(frame[5])
    for k in range(16):
        most, most_extended = 0, 0
        for u in range(k * unit, (k + 1) * unit):
            walls, extended = 0, 0
            for v in range(-8 * unit, 8 * unit + 1):
                r, c = r0 + u * ur + v * vr, c0 + u * uc + v * vc
                if 0 <= r < cells.shape[0] and 0 <= c < cells.shape[1]:
                    walls += cells[r, c] == 100
                    extended += extensions[r, c] & across != 0
            most, most_extended = max(most, walls), max(most_extended, extended)
        out[k], out[16 + k] = most, most_extended
    for k in range(24):
        most = 0
        for v in range((k - 12) * unit, (k - 11) * unit):
            walls = 0
            for u in range(-6 * unit, 10 * unit):
                r, c = r0 + u * ur + v * vr, c0 + u * uc + v * vc
                if 0 <= r < cells.shape[0] and 0 <= c < cells.shape[1]:
                    walls += cells[r, c] == 100
            most = max(most, walls)
        out[32 + k] = most
