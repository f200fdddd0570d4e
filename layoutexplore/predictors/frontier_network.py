"""Convolutional networks that judge frontiers by their windows, run in whole numbers.

Two that began differently judge better together than either. Inputs, weights and what passes between layers are whole numbers
so small that all sums stay below 2^24, which float32 holds exactly. So a window is judged the same on every machine and in
whatever company, and one that has been judged at the last decision need not be judged again.
`layoutexplore.predictors.frontier_training` makes them.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.predictors.frontier_windows import PLANES, SIDE
from layoutexplore.predictors.network_io import Layers, Weights, shapes_of

WIDTHS = (24, 48, 48)
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

MEMBERS = 2
"""Networks, which differ in their weights alone; what they find is averaged."""

_SHAPES = shapes_of(LAYERS) | {f"{name}.scale": (layer[1],) for name, layer in LAYERS.items()}

SHAPES = {f"{member}.{name}": shape for member in range(MEMBERS) for name, shape in _SHAPES.items()}
"""Weights "MEMBER.LAYER.weight" -127..127; sums of products times "MEMBER.LAYER.scale" plus "MEMBER.LAYER.bias" are what a
layer finds."""

MOST = 127
"""What passes between layers is rounded and kept between 0 and this."""


class FrontierNetworks:
    """Trained networks, which remember the windows that they judged the last time.

    Args:
        weights: Of `SHAPES`.
    """

    def __init__(self, weights: Weights) -> None:
        kept = {name: np.ascontiguousarray(values, np.float32) for name, values in weights.items()}
        self._parts = {
            name: (kept[f"{name}.weight"], kept[f"{name}.scale"], kept[f"{name}.bias"])
            for name in (f"{member}.{layer}" for member in range(MEMBERS) for layer in LAYERS)
        }
        self._known: dict[bytes, NDArray[np.float32]] = {}

    def judge(self, windows: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Judge k frontiers.

        Args:
            windows: uint8 (k, SIDE, SIDE, PLANES), of `draw_windows`.

        Returns:
            float32 (k, 3): log-odds of "closed" and of "closed with less than 1 m2 left", log of 1 + square metres left.
        """
        keys = [window.tobytes() for window in windows]
        fresh = [k for k, key in enumerate(keys) if key not in self._known]
        found = self._judge(windows[fresh].astype(np.float32)) if fresh else ()
        known = self._known | {keys[k]: judged for k, judged in zip(fresh, found, strict=True)}
        self._known = {key: known[key] for key in keys}
        return np.array([known[key] for key in keys], np.float32).reshape(len(keys), 3)

    def _judge(self, windows: NDArray[np.float32]) -> NDArray[np.float32]:
        total = np.zeros((len(windows), 3), np.float32)
        for member in range(MEMBERS):
            values = windows
            for name, (_, _, side, stride) in LAYERS.items():
                weight, scale, bias = self._parts[f"{member}.{name}"]
                shown = _neighbourhoods(values, side, stride) if side > 1 else values.reshape(len(values), -1)
                values = shown @ weight
                values *= scale
                values += bias
                if name != "judge":
                    np.clip(np.rint(values, out=values), 0, MOST, out=values)
            total += values
        return total / np.float32(MEMBERS)


@njit(cache=True, nogil=True)
def _neighbourhoods(values: NDArray[np.float32], side: int, stride: int) -> NDArray[np.float32]:
    """What a kernel sees (n, rows / stride, cols / stride, side * side * channels), padded with zeros."""
    images, rows, cols, channels = values.shape
    pad = side // 2
    out = np.zeros((images, (rows - 1) // stride + 1, (cols - 1) // stride + 1, side * side * channels), np.float32)
    for n in range(images):
        for r in range(out.shape[1]):
            for c in range(out.shape[2]):
                for k in range(side * side):
                    row, col = r * stride + k // side - pad, c * stride + k % side - pad
                    if 0 <= row < rows and 0 <= col < cols:
                        out[n, r, c, k * channels : (k + 1) * channels] = values[n, row, col]
    return out
