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
            shown = _neighbourhoods(values, stride) if side > 1 else values.reshape(len(values), -1)
            values = shown.reshape(-1, len(weight)) @ weight
            if name == "judge":
                values = values * scale + bias
            else:
                _settle(values, scale, bias)
                values = values.reshape(*shown.shape[:-1], -1)
        both: NDArray[np.float32] = (values[: len(windows)] + values[len(windows) :]) / np.float32(2)
        return both


@njit(cache=True, nogil=True)
def _neighbourhoods(values: NDArray[np.float32], stride: int) -> NDArray[np.float32]:
    """The 3 x 3 squares around every so manieth one, padded with zeros.

    Takes (n, rows, cols, channels) and returns (n, rows / stride, cols / stride, 9 channels).
    """
    images, rows, cols, channels = values.shape
    out = np.empty((images, (rows - 1) // stride + 1, (cols - 1) // stride + 1, 9 * channels), np.float32)
    of, to = values.ravel(), out.ravel()
    at = np.uint64(0)
    for image in range(images):
        for r in range(-1, rows - 1, stride):
            for c in range(-1, cols - 1, stride):
                for row in range(r, r + 3):
                    first, last = (max(c, 0), min(c + 3, cols)) if 0 <= row < rows else (c, c)
                    start = np.uint64(((image * rows + row) * cols + first) * channels)
                    before, shown = np.uint64((first - c) * channels), np.uint64((last - first) * channels)
                    after = np.uint64(3 * channels) - before - shown
                    for k in range(before):
                        to[at + k] = 0.0
                    for k in range(shown):
                        to[at + before + k] = of[start + k]
                    for k in range(after):
                        to[at + before + shown + k] = 0.0
                    at += np.uint64(3 * channels)
    return out


@njit(cache=True, nogil=True)
def _settle(values: NDArray[np.float32], scale: NDArray[np.float32], bias: NDArray[np.float32]) -> None:
    """Make whole numbers 0..MOST of the sums (squares, channels) of a layer."""
    for square in range(values.shape[0]):
        for k in range(values.shape[1]):
            found = np.rint(values[square, k] * scale[k] + bias[k])
            values[square, k] = min(max(found, np.float32(0)), np.float32(MOST))
