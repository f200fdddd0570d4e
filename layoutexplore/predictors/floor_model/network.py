"""The convolutional network that completes a map: a small U-Net, run with numpy.

It sees a map in squares of 0.1 m, folded 4 x 4 into places, and says of each square how likely it is floor.
`layoutexplore.training.floor_network` makes it.
"""

from __future__ import annotations

import numpy as np

from layoutexplore.errors import checks_making
from layoutexplore.grids.arrays import Bytes, Floats32
from layoutexplore.models.convolution import halved, joined_to_larger, run_layer
from layoutexplore.models.network_files import Layers, Weights

FOLD = 4
"""Squares on a side of a place of the network."""

KINDS = 2
"""What is told of each square: whether it is known to be free, and whether to be occupied."""

WHOLE = 32
"""The sides of what the network sees are whole multiples of so many squares: places of its coarsest layer."""

WIDTHS = (24, 48, 64, 64)
"""Channels at full, half, fourth and eighth resolution of places."""

_A, _B, _C, _D = WIDTHS

LAYERS: Layers = {
    "at_full": (KINDS * FOLD**2, _A, 3, 1),
    "to_half": (_A, _B, 3, 2), "at_half": (_B, _B, 3, 1),
    "to_fourth": (_B, _C, 3, 2), "at_fourth": (_C, _C, 3, 1),
    "to_eighth": (_C, _D, 3, 2), "at_eighth": (_D, _D, 3, 1),
    "up_to_fourth": (_D + _C, _C, 3, 1), "up_to_half": (_C + _B, _B, 3, 1), "up_to_full": (_B + _A, _A, 3, 1),
    "judge": (_A, FOLD**2, 1, 1),
}  # fmt: skip
"""All but the last are followed by a ReLU."""


@checks_making
class FloorNetwork:
    """A trained network.

    Args:
        weights: Of `LAYERS`.
    """

    def __init__(self, weights: Weights) -> None:
        self._weights = {name: np.ascontiguousarray(values, np.float32) for name, values in weights.items()}

    def score(self, known: Bytes) -> Floats32:
        """Log-odds float32 (rows, cols) that each square is floor.

        Args:
            known: uint8 (KINDS, rows, cols), 1 where a square is known to be free, and where to be occupied;
                rows and columns are multiples of `WHOLE`.
        """
        _, rows, cols = known.shape
        places = known.reshape(KINDS, rows // FOLD, FOLD, cols // FOLD, FOLD).transpose(1, 3, 0, 2, 4)
        found = self._forward(places.reshape(rows // FOLD, cols // FOLD, -1).astype(np.float32))
        squares = found.reshape(rows // FOLD, cols // FOLD, FOLD, FOLD).transpose(0, 2, 1, 3)
        return squares.reshape(rows, cols)

    def _forward(self, places: Floats32) -> Floats32:
        """Log-odds float32 (rows, cols, FOLD ** 2) for the squares of all places."""
        full = self._layer("at_full", places)
        half, fourth, low = halved(self._layer, full)
        for name, skipped in (("up_to_fourth", fourth), ("up_to_half", half), ("up_to_full", full)):
            low = self._layer(name, joined_to_larger(low, skipped))
        return self._layer("judge", low)

    def _layer(self, name: str, values: Floats32) -> Floats32:
        return run_layer(name, values, LAYERS, self._weights)
