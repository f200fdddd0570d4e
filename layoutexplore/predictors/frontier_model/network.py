"""The convolutional network that scores frontiers by egocentric crops, run in whole numbers.

It scores every crop and its mirror image, which is as good as the mean of two networks. Inputs, weights and
what passes between layers are whole numbers so small that all sums stay below 2^24, which float32 holds
exactly. So a crop gets the same score on every machine and in every batch, and one that was scored at the
last decision need not be scored again. `layoutexplore.training.frontier_network` makes it.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from layoutexplore.errors import checks_making
from layoutexplore.grids.arrays import Bytes, Floats32
from layoutexplore.models.convolution import neighbourhoods, small_products
from layoutexplore.models.network_files import Layers, Weights, shapes_of
from layoutexplore.predictors.frontier_model.network_input import PLANES, SIDE

WIDTHS = (16, 40, 48)
"""Channels at half, fourth and eighth resolution."""

HIDDEN = 64
"""Numbers that a crop is summed up in."""

_A, _B, _C = WIDTHS

LAYERS: Layers = {
    "to_half": (PLANES, _A, 3, 2), "at_half": (_A, _A, 3, 1),
    "to_fourth": (_A, _B, 3, 2), "at_fourth": (_B, _B, 3, 1),
    "to_eighth": (_B, _C, 3, 2),
    "sum_up": (_C * (SIDE // 8) ** 2, HIDDEN, 1, 1), "weigh": (HIDDEN, HIDDEN, 1, 1),
    "judge": (HIDDEN, 3, 1, 1),
}  # fmt: skip
"""All but the last are followed by a ReLU.

"sum_up" takes all channels of all cells at once, by row, column and channel.
"""

SHAPES = shapes_of(LAYERS) | {f"{name}.scale": (layer[1],) for name, layer in LAYERS.items()}
"""Weights "LAYER.weight" are -127..127; a layer's output is their sums times ".scale" plus ".bias"."""

MOST = 127
"""What passes between layers is rounded and kept between 0 and this."""

AT_ONCE = 8
"""Crops that are scored at once: each takes 0.5 MB meanwhile."""


@checks_making
class FrontierNetwork:
    """A trained network, which keeps the scores of the crops that it saw the last time.

    Args:
        weights: Of `SHAPES`.
    """

    def __init__(self, weights: Weights) -> None:
        self._layers = {
            name: tuple(
                np.ascontiguousarray(weights[f"{name}.{part}"], np.float32)
                for part in ("weight", "scale", "bias")
            )
            for name in LAYERS
        }
        self._known: dict[bytes, Floats32] = {}

    def score(self, crops: Bytes) -> Floats32:
        """Score k frontiers.

        Args:
            crops: uint8 (k, SIDE, SIDE, PLANES), of `draw_crops`.

        Returns:
            float32 (k, 3): log-odds of "closed" and of "closed with less than 1 m2 left", log of 1 + square
                metres left.
        """
        keys = [crop.tobytes() for crop in crops]
        fresh = [k for k, key in enumerate(keys) if key not in self._known]
        known = self._known
        for begin in range(0, len(fresh), AT_ONCE):
            some = fresh[begin : begin + AT_ONCE]
            found = self._score(crops[some].astype(np.float32))
            known = known | {keys[k]: scores for k, scores in zip(some, found, strict=True)}
        self._known = {key: known[key] for key in keys}
        return np.array([known[key] for key in keys], np.float32).reshape(len(keys), 3)

    def _score(self, crops: Floats32) -> Floats32:
        """The mean scores of crops and mirrored crops."""
        values = np.concatenate([crops, crops[:, :, ::-1]])
        for name, (_, _, side, stride) in LAYERS.items():
            weight, scale, bias = self._layers[name]
            shown = neighbourhoods(values, stride) if side > 1 else values.reshape(len(values), -1)
            values = small_products(shown.reshape(-1, len(weight)), weight)
            if name == "judge":
                values = values * scale + bias
            else:
                _quantise(values, scale, bias)
                values = values.reshape(*shown.shape[:-1], -1)
        both: Floats32 = (values[: len(crops)] + values[len(crops) :]) / np.float32(2)
        return both


@njit(cache=True, nogil=True)
def _quantise(values: Floats32, scale: Floats32, bias: Floats32) -> None:
    """Make whole numbers 0..MOST of the sums (cells, channels) of a layer."""
    for square in range(values.shape[0]):
        for k in range(values.shape[1]):
            found = np.rint(values[square, k] * scale[k] + bias[k])
            values[square, k] = min(max(found, np.float32(0)), np.float32(MOST))
