"""The convolutional network that classifies cells: a small U-Net, run with numpy.

It sees what the trees see of each lattice cell, and what they see of all lattice cells around it.
`layoutexplore.training.cell_network` makes it.
"""

from __future__ import annotations

import numpy as np

from layoutexplore.errors import checks_making
from layoutexplore.grids.arrays import Floats32
from layoutexplore.models.convolution import halved, joined_to_larger, run_layer
from layoutexplore.models.network_files import Layers, Weights
from layoutexplore.predictors.cell_model.network_input import PLANES, NetworkInput, draw_planes

WIDTHS = (32, 48, 64, 64)
"""Channels at full, half, fourth and eighth resolution."""

_A, _B, _C, _D = WIDTHS

LAYERS: Layers = {
    "show": (PLANES, _A, 1, 1), "at_full": (_A, _A, 3, 1),
    "to_half": (_A, _B, 3, 2), "at_half": (_B, _B, 3, 1),
    "to_fourth": (_B, _C, 3, 2), "at_fourth": (_C, _C, 3, 1),
    "to_eighth": (_C, _D, 3, 2), "at_eighth": (_D, _D, 3, 1), "wide": (_D, _D, 3, 1),
    "up_to_fourth": (_D + _C, _C, 3, 1), "up_to_half": (_C + _B, _B, 3, 1), "up_to_full": (_B + _A, _A, 3, 1),
    "end": (_A, _A, 3, 1), "judge": (_A, 2, 1, 1),
}  # fmt: skip
"""All but the last are followed by a ReLU."""


@checks_making
class CellNetwork:
    """A trained network.

    Args:
        weights: Of `LAYERS`.
    """

    def __init__(self, weights: Weights) -> None:
        self._weights = {name: np.ascontiguousarray(values, np.float32) for name, values in weights.items()}

    def score(self, scene: NetworkInput) -> Floats32:
        """Log-odds float32 (n,) that each lattice cell of the input belongs to its region's room."""
        if len(scene.lattice_cells) == 0:
            return np.zeros(0, np.float32)
        planes = draw_planes(scene)
        row, col = scene.lattice_cells[:, 0] - planes.row, scene.lattice_cells[:, 1] - planes.col
        shown = self._layer("show", planes.values)
        del planes  # The largest array of all is not needed any longer.
        return self._forward(shown)[row, col, scene.rank]

    def _forward(self, shown: Floats32) -> Floats32:
        """Log-odds float32 (rows, cols, 2) for the two ranks of every lattice cell."""
        full = self._layer("at_full", shown)
        half, fourth, low = halved(self._layer, full)
        low = self._layer("wide", low)
        for name, skipped in (("up_to_fourth", fourth), ("up_to_half", half), ("up_to_full", full)):
            low = self._layer(name, joined_to_larger(low, skipped))
        return self._layer("judge", self._layer("end", low))

    def _layer(self, name: str, values: Floats32) -> Floats32:
        return run_layer(name, values, LAYERS, self._weights)
