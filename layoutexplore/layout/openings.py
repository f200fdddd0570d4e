"""Openings in walls: short gaps in line with a run of wall, behind which the free space widens on both sides.

Works on a grid whose walls run along rows and columns. Every candidate cell knows how wide its gap is and how long the
walls on either side of it are; what is a door is decided later.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Openings:
    """Candidate openings.

    Attributes:
        width: float32 (rows, cols), width of the gap in metres on its cells, 0 elsewhere; of two the narrower.
        long_run: float32 (rows, cols), length in metres of the longer of the walls beside the gap.
        short_run: float32 (rows, cols), length of the shorter one.
    """

    width: NDArray[np.float32]
    long_run: NDArray[np.float32]
    short_run: NDArray[np.float32]


@njit(cache=True, nogil=True)
def _free_runs(blocked: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Length of the run of cells that are not blocked in its row, for each cell; 0 for blocked ones."""
    rows, cols = blocked.shape
    out = np.zeros((rows, cols), np.int32)
    for r in range(rows):
        begin = 0
        for c in range(cols + 1):
            if c == cols or blocked[r, c]:
                for k in range(begin, c):
                    out[r, k] = c - begin
                begin = c + 1
    return out


@njit(cache=True, nogil=True)
def _wall_runs(blocked: NDArray[np.bool_], slack: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Length of the run of wall that ends at each cell, coming from the left and from the right.

    A run follows the wall where it steps aside by up to `slack` cells from the row it ends in.
    """
    rows, cols = blocked.shape
    left = np.zeros((rows, cols), np.int32)
    right = np.zeros((rows, cols), np.int32)
    thick = np.zeros(cols, np.bool_)
    for r in range(rows):
        for c in range(cols):
            thick[c] = False
            for k in range(max(r - slack, 0), min(r + slack + 1, rows)):
                if blocked[k, c]:
                    thick[c] = True
                    break
        run = 0
        for c in range(cols):
            run = run + 1 if thick[c] else 0
            left[r, c] = run
        run = 0
        for c in range(cols - 1, -1, -1):
            run = run + 1 if thick[c] else 0
            right[r, c] = run
    return left, right


@njit(cache=True, nogil=True)
def _widens(runs: NDArray[np.int32], blocked: NDArray[np.bool_], r: int, c: int, step: int, reach: int, wanted: int) -> bool:
    for k in range(1, reach + 1):
        rr = r + step * k
        if rr < 0 or rr >= runs.shape[0] or blocked[rr, c]:
            return False
        if runs[rr, c] >= wanted:
            return True
    return False


@njit(cache=True, nogil=True)
def _mark(
    blocked: NDArray[np.bool_],
    narrowest: int,
    widest: int,
    run_min: int,
    widening: int,
    reach: int,
    slack: int,
    width: NDArray[np.int32],
    longer: NDArray[np.int32],
    shorter: NDArray[np.int32],
) -> None:
    """Mark the gaps of the rows; a cell of two gaps belongs to the narrower."""
    rows, cols = blocked.shape
    runs = _free_runs(blocked)
    left, right = _wall_runs(blocked, slack)
    for r in range(rows):
        c = 0
        while c < cols:
            n = runs[r, c]
            if n == 0:
                c += 1
                continue
            if narrowest <= n <= widest and c > 0 and c + n < cols:
                a, b = left[r, c - 1], right[r, c + n]
                middle = c + n // 2
                if (
                    max(a, b) >= run_min
                    and _widens(runs, blocked, r, middle, -1, reach, n + widening)
                    and _widens(runs, blocked, r, middle, 1, reach, n + widening)
                ):
                    for k in range(c, c + n):
                        if width[r, k] == 0 or n < width[r, k]:
                            width[r, k] = n
                            longer[r, k] = max(a, b)
                            shorter[r, k] = min(a, b)
            c += n


@njit(cache=True, nogil=True)
def _mark_mouths(
    blocked: NDArray[np.bool_],
    narrowest: int,
    widest: int,
    widening: int,
    depth: int,
    width: NDArray[np.int32],
    longer: NDArray[np.int32],
    shorter: NDArray[np.int32],
) -> None:
    """Mark where a passage that runs across the rows for `depth` cells ends in a wider space; doors keep their marks."""
    rows, cols = blocked.shape
    runs = _free_runs(blocked)
    for r in range(1, rows - 1):
        c = 0
        while c < cols:
            n = runs[r, c]
            if n == 0:
                c += 1
                continue
            if narrowest <= n <= widest and c > 0 and c + n < cols:
                middle = c + n // 2
                for step in (-1, 1):
                    if blocked[r + step, middle] or runs[r + step, middle] < n + widening:
                        continue
                    steady = True
                    for k in range(1, depth + 1):
                        rr = r - step * k
                        if rr < 0 or rr >= rows or blocked[rr, middle] or abs(runs[rr, middle] - n) > max(2, n // 6):
                            steady = False
                            break
                    if steady:
                        for k in range(c, c + n):
                            if width[r, k] == 0:
                                width[r, k] = n
                                longer[r, k] = depth
                                shorter[r, k] = 0
            c += n


def find_openings(
    blocked: NDArray[np.bool_],
    resolution: float,
    *,
    width_min: float,
    width_max: float,
    run_min: float,
    widening: float = 0.4,
    reach: float = 0.6,
    slack: float = 0.1,
    mouth_max: float = 4.0,
    mouth_depth: float = 1.0,
) -> Openings:
    """Gaps along rows and columns that may be doors.

    Args:
        blocked: bool (rows, cols), the obstacles.
        resolution: Metres a cell.
        width_min: Narrowest gap [m].
        width_max: Widest gap [m].
        run_min: The wall on at least one side is this long [m].
        widening: The free run grows by this much [m] ...
        reach: ... within this distance [m], on both sides.
        slack: A wall may step aside by this much [m].
    """
    shape = blocked.shape
    marks = [np.zeros(shape, np.int32) for _ in range(3)]
    turned = [np.zeros(shape[::-1], np.int32) for _ in range(3)]
    sizes = [max(round(v / resolution), 1) for v in (width_min, width_max, run_min, widening, reach)]
    step = max(round(slack / resolution), 1)
    _mark(np.ascontiguousarray(blocked), *sizes, step, *marks)
    _mark(np.ascontiguousarray(blocked.T), *sizes, step, *turned)
    other = [t.T for t in turned]
    take = (other[0] > 0) & ((marks[0] == 0) | (other[0] < marks[0]))
    mouths = [np.zeros(shape, np.int32) for _ in range(3)]
    mouths_turned = [np.zeros(shape[::-1], np.int32) for _ in range(3)]
    long = max(round(mouth_depth / resolution), 1)
    wider = max(round(2 * widening / resolution), 1)
    widest = max(round(mouth_max / resolution), 1)
    _mark_mouths(np.ascontiguousarray(blocked), sizes[0], widest, wider, long, *mouths)
    _mark_mouths(np.ascontiguousarray(blocked.T), sizes[0], widest, wider, long, *mouths_turned)
    for found in (mouths, [m.T for m in mouths_turned]):
        free_yet = (found[0] > 0) & (marks[0] == 0) & (other[0] == 0)
        marks = [np.where(free_yet, f, m) for f, m in zip(found, marks, strict=True)]
    merged = [
        np.ascontiguousarray(np.where(take, o, m)).astype(np.float32) * np.float32(resolution)
        for o, m in zip(other, marks, strict=True)
    ]
    return Openings(*merged)
