"""Disjoint sets as an array of parents, for kernels that join what touches (Tarjan, "A class of algorithms", 1979)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True, nogil=True)
def root_of(parent: NDArray[np.signedinteger[Any]], i: int) -> int:
    """The member that stands for the set of `i`; the way there is halved. `parent` int32 or int64 (n,)."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i
