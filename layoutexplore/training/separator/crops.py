"""Crops of examples: what a step of the training of the separator network shows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from layoutexplore.grids.grid import Cell
from layoutexplore.layout.merging.separator.planes import PATCH
from layoutexplore.training.separator.disturb import disturbed
from layoutexplore.training.separator.examples import SeparatorExample

T = TypeVar("T", bound=np.generic)

TRIES, LEAST_FREE = 8, 0.08
"""A crop is drawn again, so often at most, while it shows less free space than this."""


def draw_crop(example: SeparatorExample, places: int, rng: np.random.Generator) -> SeparatorExample:
    """A square part of an example in one of the eight orientations, padded with unknown space.

    Args:
        example: The map.
        places: Side of the crop, in places of the network.
        rng: Source of randomness.
    """
    side = places * PATCH
    corner = Cell(0, 0)
    for _ in range(TRIES):
        spare = [max(size - side, 0) // PATCH + 1 for size in example.shares.shape[:2]]
        corner = Cell(int(rng.integers(spare[0])) * PATCH, int(rng.integers(spare[1])) * PATCH)
        part = example.shares[corner.row : corner.row + side, corner.col : corner.col + side, 0]
        if part.mean() > 255 * LEAST_FREE:
            break
    turn = int(rng.integers(8))
    half = Cell(corner.row // 2, corner.col // 2)
    return SeparatorExample(
        _part(example.shares, corner, side, turn),
        _part(example.rooms, half, side // 2, turn),
        _part(example.thing, half, side // 2, turn),
        _part(example.thing_weight, half, side // 2, turn),
    )


def _part(values: NDArray[T], corner: Cell, side: int, turn: int) -> NDArray[T]:
    """A part of (side, side, ...), 0 beyond the values, transposed and mirrored as the bits of `turn` say."""
    out = np.zeros((side, side, *values.shape[2:]), values.dtype)
    found = values[corner.row : corner.row + side, corner.col : corner.col + side]
    out[: found.shape[0], : found.shape[1]] = found
    out = out.swapaxes(0, 1) if turn & 4 else out
    out = out[::-1] if turn & 1 else out
    return np.ascontiguousarray(out[:, ::-1] if turn & 2 else out)


def stacked_crops(
    examples: Sequence[SeparatorExample], count: int, places: int, rng: np.random.Generator
) -> SeparatorExample:
    """So many disturbed crops of examples drawn at random, stacked: each attribute is (count, ...) of them.

    Args:
        examples: Maps.
        count: Crops.
        places: Side of a crop, in places of the network.
        rng: Source of randomness.
    """
    crops = [
        disturbed(draw_crop(examples[int(rng.integers(len(examples)))], places, rng), rng)
        for _ in range(count)
    ]
    return SeparatorExample(
        np.stack([crop.shares for crop in crops]),
        np.stack([crop.rooms for crop in crops]),
        np.stack([crop.thing for crop in crops]),
        np.stack([crop.thing_weight for crop in crops]),
    )
