"""The convolutional network that judges frontiers by their windows, run in whole numbers.

It looks at every window and at the mirrored one, which makes it judge as well as two networks do. Inputs,
weights and what passes between layers are whole numbers so small that all sums stay below 2^24, which float32
holds exactly. So a window is judged the same on every machine and in whatever company, and one that has been
judged at the last decision need not be judged again. `layoutexplore.training.frontier_network` makes it.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.models.convolution import neighbourhoods
from layoutexplore.models.network_files import Layers, Weights, shapes_of
from layoutexplore.predictors.frontier_model.network_input import PLANES, SIDE

WIDTHS = (16, 40, 48)
"""Channels at half, fourth and eighth resolution."""

HIDDEN = 64
"""Numbers that a window is summed up in."""

_A, _B, _C = WIDTHS

LAYERS: Layers = {
    "to_half": (PLANES, _A, 3, 2), "at_half": (_A, _A, 3, 1),
    "to_fourth": (_A, _B, 3, 2), "at_fourth": (_B, _B, 3, 1),
    "to_eighth": (_B, _C, 3, 2),
    "sum_up": (_C * (SIDE // 8) ** 2, HIDDEN, 1, 1), "weigh": (HIDDEN, HIDDEN, 1, 1), "judge": (HIDDEN, 3, 1, 1),
}  # fmt: skip
"""All but the last are followed by a ReLU; "sum_up" takes all channels of all squares at once, by row, column and channel."""

SHAPES = shapes_of(LAYERS) | {f"{name}.scale": (layer[1],) for name, layer in LAYERS.items()}
"""Weights "LAYER.weight" -127..127; sums of products times "LAYER.scale" plus "LAYER.bias" are what a layer finds."""

MOST = 127
"""What passes between layers is rounded and kept between 0 and this."""


class FrontierNetwork:
    """A trained network, which remembers the windows that it judged the last time.

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
        self._known: dict[bytes, NDArray[np.float32]] = {}

    def judge(self, windows: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Judge k frontiers.

        Args:
            windows: uint8 (k, SIDE, SIDE, PLANES), of `draw_crops`.

        Returns:
            float32 (k, 3): log-odds of "closed" and of "closed with less than 1 m2 left", log of 1 + square
                metres left.
        """
        keys = [window.tobytes() for window in windows]
        fresh = [k for k, key in enumerate(keys) if key not in self._known]
        found = self._judge(windows[fresh].astype(np.float32)) if fresh else ()
        known = self._known | {keys[k]: judged for k, judged in zip(fresh, found, strict=True)}
        self._known = {key: known[key] for key in keys}
        return np.array([known[key] for key in keys], np.float32).reshape(len(keys), 3)

    def _judge(self, windows: NDArray[np.float32]) -> NDArray[np.float32]:
        """What is found on average for windows and mirrored windows."""
        values = np.concatenate([windows, windows[:, :, ::-1]])
        for name, (_, _, side, stride) in LAYERS.items():
            weight, scale, bias = self._layers[name]
            shown = neighbourhoods(values, stride) if side > 1 else values.reshape(len(values), -1)
            values = shown.reshape(-1, len(weight)) @ weight
            if name == "judge":
                values = values * scale + bias
            else:
                _quantise(values, scale, bias)
                values = values.reshape(*shown.shape[:-1], -1)
        both: NDArray[np.float32] = (values[: len(windows)] + values[len(windows) :]) / np.float32(2)
        return both


@njit(cache=True, nogil=True)
def _quantise(values: NDArray[np.float32], scale: NDArray[np.float32], bias: NDArray[np.float32]) -> None:
    """Make whole numbers 0..MOST of the sums (squares, channels) of a layer."""
    for square in range(values.shape[0]):
        for k in range(values.shape[1]):
            found = np.rint(values[square, k] * scale[k] + bias[k])
            values[square, k] = min(max(found, np.float32(0)), np.float32(MOST))
