"""Masks as bits, 64 cells a word: how many cells of a stretch are set is known after a few words."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.bits import ones

_ONE, _ALL = np.uint64(1), np.uint64(0xFFFFFFFFFFFFFFFF)


@njit("Tuple((uint64[:,::1], uint64[:,::1]))(int64[::1], int64, int64, int64)", cache=True, nogil=True)
def set_bits(
    cells: NDArray[np.int64], rows: int, cols: int, slack: int
) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
    """Cells and those at most `slack` beside them, as bits.

    Args:
        cells: int64 (n,), flat indices.
        rows: Of the grid.
        cols: Of the grid.
        slack: In cells.

    Returns:
        uint64 (rows, words), each row with the cells of those at most `slack` rows away; and uint64 (cols,
        words), the same for the columns.
    """
    of_rows = np.zeros((rows, cols // 64 + 1), np.uint64)
    of_cols = np.zeros((cols, rows // 64 + 1), np.uint64)
    for i in cells:
        r, c = i // cols, i % cols
        bit = _ONE << np.uint64(c & 63)
        for rr in range(max(r - slack, 0), min(r + slack + 1, rows)):
            of_rows[rr, c >> 6] |= bit
        bit = _ONE << np.uint64(r & 63)
        for cc in range(max(c - slack, 0), min(c + slack + 1, cols)):
            of_cols[cc, r >> 6] |= bit
    return of_rows, of_cols


@njit(cache=True, nogil=True)
def count_bits(words: NDArray[np.uint64], row: int, length: int, begin: int, end: int) -> int:
    """Cells begin <= c < end of a row of `length` cells that are set; none lies outside. For kernels."""
    begin, end = max(begin, 0), min(end, length)
    if begin >= end:
        return 0
    first, last = begin >> 6, (end - 1) >> 6
    head, tail = _ALL << np.uint64(begin & 63), _ALL >> np.uint64(63 - ((end - 1) & 63))
    if first == last:
        return ones(words[row, first] & head & tail)
    n = ones(words[row, first] & head) + ones(words[row, last] & tail)
    for k in range(first + 1, last):
        n += ones(words[row, k])
    return n
