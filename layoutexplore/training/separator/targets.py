"""What the separator network sees of crops, and what it is to answer for their squares; needs torch.

On the device of the training: a processor would take longer for the answers than for all else of a crop.
"""

from __future__ import annotations

import torch
from torch.nn import functional

from layoutexplore.layout.merging.separator.network import (
    BORDER,
    FIRST_PAIR,
    OFFSETS,
    OUTPUTS,
    OUTSIDE,
    THING,
    pair_ends,
)
from layoutexplore.layout.merging.separator.planes import KINDS, PATCH

FREE_SHARE = 0.3
"""A square is asked about as floor from this share of free cells on."""

BOTH_OUTSIDE = 0.2
"""Weight of a pair of squares that lie in no room, where others have 1."""


def as_input(shares: torch.Tensor) -> torch.Tensor:
    """float32 (batch, channels, places, places) of shares uint8 (batch, fine rows, fine columns, KINDS)."""
    batch, rows, cols = len(shares), shares.shape[1] // PATCH, shares.shape[2] // PATCH
    parts = (shares.float() / 255).reshape(batch, rows, PATCH, cols, PATCH, KINDS)
    return parts.permute(0, 2, 4, 5, 1, 3).reshape(batch, -1, rows, cols)


def targets_of(
    shares: torch.Tensor, rooms: torch.Tensor, thing: torch.Tensor, thing_weight: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """What is true of each square and output, and its weight: float32 (batch, OUTPUTS, rows, columns) each.

    The last of each row and column are not asked about pairs that reach beyond the crop.

    Args:
        shares: uint8 (batch, fine rows, fine columns, KINDS); this and the others as `SeparatorExample` has
            them, of crops of one size.
        rooms: int16 (batch, rows, columns).
        thing: uint8 (batch, rows, columns).
        thing_weight: uint8 (batch, rows, columns).
    """
    batch, rows, cols = rooms.shape
    mean = shares.float().reshape(batch, rows, 2, cols, 2, KINDS).mean((2, 4)) / 255
    free, known = mean[..., 0] > FREE_SHARE, mean[..., :3].sum(-1) > 0
    truth = torch.zeros(batch, OUTPUTS, rows, cols, device=rooms.device)
    weight = torch.zeros_like(truth)
    truth[:, BORDER] = _borders(rooms)
    weight[:, BORDER] = functional.max_pool2d(known.float()[:, None], 3, 1, 1)[:, 0]
    truth[:, OUTSIDE], weight[:, OUTSIDE] = (rooms == 0).float(), free.float()
    truth[:, THING] = thing / 255
    weight[:, THING] = thing_weight / 255 * (mean[..., 1] + mean[..., 2] > 0)
    for k, (up, right) in enumerate(OFFSETS, FIRST_PAIR):
        here, there = pair_ends(up, right, rows, cols)
        one, other = rooms[:, *here], rooms[:, *there]
        truth[:, k, *here] = (one == other).float()
        asked = (free[:, *here] & free[:, *there]).float()
        weight[:, k, *here] = asked * torch.where((one == 0) & (other == 0), BOTH_OUTSIDE, 1.0)
    return truth, weight


def _borders(rooms: torch.Tensor) -> torch.Tensor:
    """float32 (batch, rows, columns): 1 for squares beside one of another room."""
    out = torch.zeros(rooms.shape, device=rooms.device)
    for axis in (1, 2):
        size = rooms.shape[axis] - 1
        differ = (rooms.narrow(axis, 1, size) != rooms.narrow(axis, 0, size)).float()
        for first in (0, 1):
            part = out.narrow(axis, first, size)
            torch.maximum(part, differ, out=part)
    return out
