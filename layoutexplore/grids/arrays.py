"""Short names for the arrays of the package; docstrings say shapes and units."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Cells = NDArray[np.int8]
"""Cells of an occupancy grid: -1 unknown, 0 free ... 100 occupied; and other int8 arrays."""

Mask = NDArray[np.bool_]
"""Which cells, or which entries."""

Ints = NDArray[np.int64]
"""Indices and counts."""

Ints32 = NDArray[np.int32]
"""Labels of cells, and cells as (row, col)."""

Floats = NDArray[np.float64]
"""Numbers with a unit."""

Floats32 = NDArray[np.float32]
"""Numbers with a unit, one a cell: distances, probabilities, scores."""

Bytes = NDArray[np.uint8]
"""Pictures, codes and flags."""

Words = NDArray[np.uint64]
"""Sets as bits, 64 a word."""
