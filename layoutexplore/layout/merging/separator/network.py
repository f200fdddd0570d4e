"""The separator network: a small U-Net over the squares of a map, run with numpy.

`layoutexplore.training.separator` makes it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from layoutexplore.grids.arrays import Cells, Floats32, Ints32, Mask
from layoutexplore.layout.limits import MOST_PLACES
from layoutexplore.layout.merging.separator.planes import DEPTH, FINE, KINDS, PATCH, network_input
from layoutexplore.models.convolution import halved, run_layer
from layoutexplore.models.network_files import Layers, load_weights, shapes_of

NETWORK_PATH = Path(__file__).with_name("separator_network.safetensors")

OFFSETS = ((0, 5), (5, 0), (0, 12), (12, 0), (8, 8), (8, -8))
"""Rows and columns to the square that a square is asked about: whether both are in one room."""

NEAR = 2
"""The first so many offsets are near ones."""

BORDER, OUTSIDE, THING = 0, 1, 2
"""The first outputs: a room's border passes here, in no room, an obstacle that is no wall. The last
is learnt beside the others; nothing asks for it."""

FIRST_PAIR = 3
"""Pairs come after these."""

OUTPUTS = FIRST_PAIR + len(OFFSETS)

_A, _B, _C, _D = 16, 32, 48, 64

LAYERS: Layers = {
    "patch": (PATCH * PATCH * KINDS, _A, 1, 1), "at_full": (_A, _A, 3, 1),
    "to_half": (_A, _B, 3, 2), "at_half": (_B, _B, 3, 1),
    "to_fourth": (_B, _C, 3, 2), "at_fourth": (_C, _C, 3, 1),
    "to_eighth": (_C, _D, 3, 2), "at_eighth": (_D, _D, 3, 1),
    "from_eighth": (_D, _C, 1, 1), "wide": (_C, _C, 3, 1),
    "from_fourth": (_C, _B, 1, 1), "up_half": (_B, _B, 3, 1),
    "from_half": (_B, _A, 1, 1), "up_full": (_A, _A, 3, 1),
    "judge": (_A, PATCH * PATCH // 4 * OUTPUTS, 1, 1),
}  # fmt: skip
"""All but the last are followed by a ReLU."""


class Unasked:
    """In place of a network where none is asked."""

    def judge(self, cells: Cells, wall: Mask, gap: Ints32, resolution: float) -> Floats32:
        """Nothing: float32 (0, 0, OUTPUTS)."""
        return np.zeros((0, 0, OUTPUTS), np.float32)


UNASKED = Unasked()


@dataclass(frozen=True, eq=False)
class SeparatorNetwork:
    """A trained network.

    Attributes:
        weights: Of `LAYERS`.
    """

    weights: Mapping[str, Floats32]

    def judge(self, cells: Cells, wall: Mask, gap: Ints32, resolution: float) -> Floats32:
        """Log-odds float32 (squares, squares, OUTPUTS); arguments as for `network_input`.

        Of a map of more than `MOST_PLACES` places it is (0, 0, OUTPUTS): nothing is known.
        """
        places = math.prod(size * resolution / (PATCH * FINE) + DEPTH for size in cells.shape)
        if places > MOST_PLACES:
            return np.zeros((0, 0, OUTPUTS), np.float32)
        return self.agreed(network_input(cells, wall, gap, resolution))

    def agreed(self, values: Floats32) -> Floats32:
        """Mean log-odds of a map and of the same one turned by half a turn; arguments as for `forward`.

        The two err apart: places are taken together in other ways.
        """
        rows, cols, _ = values.shape
        parts = values[::-1, ::-1].reshape(rows, cols, PATCH, PATCH, KINDS)[:, :, ::-1, ::-1]
        turned = self.forward(np.ascontiguousarray(parts).reshape(values.shape))[::-1, ::-1]
        odds = self.forward(values)
        odds[..., :FIRST_PAIR] += turned[..., :FIRST_PAIR]
        for k, (up, right) in enumerate(OFFSETS, FIRST_PAIR):
            # of a pair that is turned, the other square comes first
            here, there = pair_ends(up, right, odds.shape[0], odds.shape[1])
            odds[(*here, k)] += turned[(*there, k)]
        odds *= 0.5
        return odds

    def forward(self, values: Floats32) -> Floats32:
        """Log-odds of the squares, for an input of (places, places, channels), whole ones of `DEPTH`."""
        full = self._layer("at_full", self._layer("patch", values))
        half, fourth, low = halved(self._layer, full)
        for smaller, skipped, at in (
            ("from_eighth", fourth, "wide"),
            ("from_fourth", half, "up_half"),
            ("from_half", full, "up_full"),
        ):
            low = self._layer(at, self._layer(smaller, low).repeat(2, axis=0).repeat(2, axis=1) + skipped)
        found = self._layer("judge", low)
        rows, cols = found.shape[:2]
        found = found.reshape(rows, cols, 2, 2, OUTPUTS).transpose(0, 2, 1, 3, 4)
        return np.ascontiguousarray(found).reshape(2 * rows, 2 * cols, OUTPUTS)

    def _layer(self, name: str, values: Floats32) -> Floats32:
        return run_layer(name, values, LAYERS, self.weights)


def pair_ends(up: int, right: int, rows: int, cols: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """The squares of which the one so many rows and columns on is there, too; and those ones."""
    here = slice(0, max(rows - up, 0)), slice(max(-right, 0), max(cols - max(right, 0), 0))
    there = slice(up, rows), slice(max(right, 0), max(cols - max(-right, 0), 0))
    return here, there


@lru_cache(maxsize=1)
def load_separator(path: Path = NETWORK_PATH) -> SeparatorNetwork:
    """The shipped network."""
    return SeparatorNetwork(load_weights(path, shapes_of(LAYERS), "separator network"))
