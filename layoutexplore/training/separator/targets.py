"""Crops of examples, and what the separator network is to answer for their squares."""

from __future__ import annotations

from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from layoutexplore.grids.arrays import Bytes, Floats32
from layoutexplore.grids.grid import Cell
from layoutexplore.layout.merging.separator.network import BORDER, OFFSETS, OUTPUTS, OUTSIDE, THING
from layoutexplore.layout.merging.separator.planes import KINDS, PATCH
from layoutexplore.training.separator.examples import SeparatorExample

T = TypeVar("T", bound=np.generic)

FREE_SHARE = 0.3
"""A square is asked about as floor from this share of free cells on."""

BOTH_OUTSIDE = 0.2
"""Weight of a pair of squares that lie in no room, where others have 1."""

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


def as_input(shares: Bytes) -> Floats32:
    """float32 (channels, places, places) of shares uint8 (fine squares, fine squares, KINDS)."""
    rows, cols = shares.shape[0] // PATCH, shares.shape[1] // PATCH
    parts = shares.reshape(rows, PATCH, cols, PATCH, KINDS).transpose(1, 3, 4, 0, 2)
    return np.asarray(parts.reshape(-1, rows, cols) / np.float32(255), np.float32)


def targets_of(crop: SeparatorExample) -> tuple[Floats32, Floats32]:
    """What is true of each square and output, and its weight: float32 (OUTPUTS, squares, squares) each.

    The last of each row and column are not asked about pairs that reach beyond the crop.
    """
    rows, cols = crop.rooms.shape
    shares = crop.shares.reshape(rows, 2, cols, 2, KINDS).mean((1, 3)) / 255
    free, known = shares[..., 0] > FREE_SHARE, shares[..., :3].sum(-1) > 0
    truth, weight = (np.zeros((OUTPUTS, rows, cols), np.float32) for _ in range(2))
    rooms = crop.rooms
    for a, b in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:], np.s_[:-1])):
        differ = rooms[a] != rooms[b]
        truth[BORDER][a] = np.maximum(truth[BORDER][a], differ)
        truth[BORDER][b] = np.maximum(truth[BORDER][b], differ)
    weight[BORDER] = cv2.dilate(known.astype(np.uint8), np.ones((3, 3), np.uint8))
    truth[OUTSIDE], weight[OUTSIDE] = rooms == 0, free
    truth[THING] = crop.thing / 255
    weight[THING] = crop.thing_weight / 255 * (shares[..., 1] + shares[..., 2] > 0)
    for k, (up, right) in enumerate(OFFSETS):
        here = np.s_[: rows - up, max(-right, 0) : cols - max(right, 0)]
        there = np.s_[up:, max(right, 0) : cols - max(-right, 0)]
        truth[3 + k][here] = rooms[here] == rooms[there]
        none = (rooms[here] == 0) & (rooms[there] == 0)
        weight[3 + k][here] = (free[here] & free[there]) * np.where(none, BOTH_OUTSIDE, 1.0)
    return truth, weight
