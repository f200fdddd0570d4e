"""Masks as bits, 64 cells a word: how many cells of a stretch are set is known after a few words."""

from __future__ import annotations

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Bytes, Ints, Mask, Words

_ONE, _ALL = np.uint64(1), np.uint64(0xFFFFFFFFFFFFFFFF)


_PAIRS = np.uint64(0x5555555555555555)
_FOURS = np.uint64(0x3333333333333333)
_EIGHTS = np.uint64(0x0F0F0F0F0F0F0F0F)
_BYTES = np.uint64(0x0101010101010101)


@njit(cache=True, nogil=True)
def ones(word: np.uint64) -> int:
    """Bits of a word that are set: counted in pairs, in fours, in eights, and summed by a product.

    The parallel count of Warren, "Hacker's Delight", section 5-1.

    Example:
        >>> ones(np.uint64(0b1011))
        3
    """
    word = word - ((word >> _ONE) & _PAIRS)
    word = (word & _FOURS) + ((word >> np.uint64(2)) & _FOURS)
    word = (word + (word >> np.uint64(4))) & _EIGHTS
    return int(np.int64((word * _BYTES) >> np.uint64(56)))


@njit(cache=True, nogil=True)
def set_bits(cells: Ints, rows: int, cols: int, slack: int) -> tuple[Words, Words]:
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
    # A cell sets one bit in each row near its own: the bits of a row stand for its columns, and the other way
    # round.
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
def count_bits(words: Words, row: int, length: int, begin: int, end: int) -> int:
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


@njit(cache=True, nogil=True)
def _true_cells(cells: Bytes, words: Words, total: int) -> Ints:
    """Indices of the `total` cells that are 1; `words` are the same cells, eight a word, but the last few."""
    out = np.empty(total + 1, np.int64)  # one place more: a cell is written before it is known to be true
    n = 0
    for w in range(len(words)):
        if words[w] != 0:
            for k in range(8 * w, 8 * w + 8):
                out[n] = k
                n += cells[k]
    for k in range(8 * len(words), len(cells)):
        out[n] = k
        n += cells[k]
    return out[:total]


def true_cells(mask: Mask) -> Ints:
    """What `np.flatnonzero` finds, in a third of its time.

    Args:
        mask: bool, of any shape.

    Returns:
        int64 (n,), flat indices of the cells that are true, rising.

    Example:
        >>> true_cells(np.array([[False, True], [True, True]])).tolist()
        [1, 2, 3]
    """
    # the kernel takes no array that may only be read
    cells = np.require(mask, requirements=("C", "W")).reshape(-1).view(np.uint8)
    return np.asarray(
        _true_cells(cells, cells[: len(cells) // 8 * 8].view(np.uint64), int(np.count_nonzero(cells)))
    )
