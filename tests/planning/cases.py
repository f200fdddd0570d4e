"""What tours cost, place by place."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray


def tour_length(distances: NDArray[np.float64], order: NDArray[np.int64] | list[int]) -> float:
    """Length of the tour from place 0 through the places in this order."""
    return float(sum(distances[a, b] for a, b in itertools.pairwise([0, *order])))
