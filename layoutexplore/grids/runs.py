"""Runs of equal cells along the rows of a grid: what is done once a run need not be done once a cell."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.arrays import ZERO, Ints, Ints32, Mask


@njit(cache=True, nogil=True)
def run_end(line: NDArray[Any], c: int, value: Any) -> int:
    """The first column from `c` on whose cell differs from a value; the line's length if there is none.

    Args:
        line: Integers or bools (cols,).
        c: Column, from 0 to the line's length.
        value: Of the type of the cells.
    """
    # Eight cells are compared without a branch in between, so that the compiler puts them into one register.
    # The unsigned index spares the check for negative ones.
    while c + 8 <= line.size:
        differ = line[np.uint64(c)] ^ value
        for k in range(1, 8):
            differ |= line[np.uint64(c + k)] ^ value
        if differ:
            break
        c += 8
    while c < line.size and line[c] == value:
        c += 1
    return c


@njit(cache=True, nogil=True)
def find_runs(cells: NDArray[Any], background: Any) -> Ints32:
    """The runs of equal cells along the rows: int32 (n, 3) as row, first column and column behind the last.

    Args:
        cells: Integers (rows, cols).
        background: Value of the cells that belong to no run; of the type of the cells.

    Returns:
        In raster order.
    """
    rows, cols = cells.shape
    # Room for a run a cell would be memory that the system hands out and takes back at every call.
    runs = np.empty((8 * rows + cols, 3), np.int32)
    n = 0
    for r in range(rows):
        if n + cols > len(runs):
            larger = np.empty((2 * n + cols, 3), np.int32)
            for k in range(n):
                larger[k, 0], larger[k, 1], larger[k, 2] = runs[k, 0], runs[k, 1], runs[k, 2]
            runs = larger
        c = ZERO
        while c < cols:
            value, first = cells[r, c], c
            c = run_end(cells[r], c, value)
            if value != background:
                runs[n, 0], runs[n, 1], runs[n, 2] = r, first, c
                n += 1
    return runs[:n]


@njit(cache=True, nogil=True)
def runs_of(cells: NDArray[Any], value: int) -> Ints32:
    """The runs of one value along the rows, as of `find_runs`.

    Args:
        cells: Integers (rows, cols).
        value: Of the runs.
    """
    runs = np.empty((256, 3), np.int32)
    n = 0
    for r in range(cells.shape[0]):
        row, c = cells[r], ZERO
        while c < row.size:
            here, first = row[c], c
            c = run_end(row, c, here)
            if here != value:
                continue
            if n == len(runs):
                runs = np.concatenate((runs, np.empty_like(runs)))
            runs[n, 0], runs[n, 1], runs[n, 2] = r, first, c
            n += 1
    return runs[:n].copy()


@njit(cache=True, nogil=True)
def write_runs(runs: Ints32, number: Ints, labels: NDArray[Any]) -> None:
    """Write the number int64 (n,) of each run int32 (n, 3) into its cells."""
    for k in range(len(runs)):
        labels[runs[k, 0], runs[k, 1] : runs[k, 2]] = np.int32(number[k])


def run_lengths(mask: Mask) -> Ints:
    """The lengths int64 (n,) in cells of the runs of true cells along the rows of a mask, in raster order.

    Example:
        >>> run_lengths(np.array([[True, True, False, True], [True, False, False, False]])).tolist()
        [2, 1, 1]
    """
    # A false cell before and behind every row: no run goes on in the next one, and each has both its ends.
    steps = np.diff(np.pad(mask, ((0, 0), (1, 1))).astype(np.int8).ravel())
    return np.asarray(np.flatnonzero(steps == -1) - np.flatnonzero(steps == 1))
