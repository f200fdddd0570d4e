"""Words of 64 bits, for kernels that count members of sets."""

from __future__ import annotations

import numpy as np
from numba import njit

_ONE = np.uint64(1)
_PAIRS, _FOURS, _EIGHTS = (
    np.uint64(0x5555555555555555),
    np.uint64(0x3333333333333333),
    np.uint64(0x0F0F0F0F0F0F0F0F),
)
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
