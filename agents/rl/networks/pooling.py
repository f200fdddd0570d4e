"""Sums over the frontiers of each decision and their gradients: what deep sets are made of.

On the CPU both are one pass of a compiled kernel, faster than torch's `segment_reduce` with its gradient;
elsewhere torch does it. The frontiers of a decision follow one another.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numba import njit
from torch import Tensor

from layoutexplore.grids.arrays import Floats32, Ints, Ints32


def pool(tokens: Tensor, counts: Tensor) -> Tensor:
    """Mean and greatest values of each decision's tokens, 0 where it has none.

    Args:
        tokens: float32 (n, width), not negative.
        counts: int64 (batch,), how many belong to each decision.

    Returns:
        float32 (batch, 2 * width): the means, then the greatest values.
    """
    if tokens.device.type == "cpu":
        return torch.as_tensor(_Pool.apply(tokens, counts))  # type: ignore[no-untyped-call]
    total = torch.segment_reduce(tokens, "sum", lengths=counts, axis=0)
    greatest = torch.segment_reduce(tokens, "max", lengths=counts, axis=0, initial=0.0)
    return torch.cat([total / counts.clamp(min=1)[:, None], greatest], dim=1)


def spread(shared: Tensor, owners: Tensor, counts: Tensor) -> Tensor:
    """A row of each decision for each of its frontiers.

    Args:
        shared: float32 (batch, width).
        owners: int64 (n,), the decision of each frontier.
        counts: int64 (batch,), how many belong to each decision.

    Returns:
        float32 (n, width).
    """
    if shared.device.type == "cpu":
        return torch.as_tensor(_Spread.apply(shared, owners, counts))  # type: ignore[no-untyped-call]
    return shared.index_select(0, owners)


class _Pool(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, tokens: Tensor, counts: Tensor) -> Tensor:
        width = tokens.shape[1]
        pooled = torch.empty(len(counts), 2 * width)
        best = torch.empty(len(counts), width, dtype=torch.int32)
        _pool(tokens.detach().contiguous().numpy(), counts.numpy(), pooled.numpy(), best.numpy())
        ctx.save_for_backward(counts, best)
        ctx.size = len(tokens)
        return pooled

    @staticmethod
    def backward(ctx: Any, *gradients: Any) -> Any:
        counts, best = ctx.saved_tensors
        found = torch.empty(ctx.size, best.shape[1])
        _unpool(gradients[0].contiguous().numpy(), counts.numpy(), best.numpy(), found.numpy())
        return found, None


class _Spread(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, shared: Tensor, owners: Tensor, counts: Tensor) -> Tensor:
        ctx.save_for_backward(counts)
        return shared.index_select(0, owners)

    @staticmethod
    def backward(ctx: Any, *gradients: Any) -> Any:
        (counts,) = ctx.saved_tensors
        found = torch.empty(len(counts), gradients[0].shape[1])
        _gather(gradients[0].contiguous().numpy(), counts.numpy(), found.numpy())
        return found, None, None


@njit(cache=True, nogil=True)
def _pool(tokens: Floats32, counts: Ints, pooled: Floats32, best: Ints32) -> None:
    """Means and greatest values (batch, 2 * width) of tokens (n, width), and whose those are (-1: none)."""
    width, k = tokens.shape[1], 0
    for b in range(counts.size):
        total, greatest, place = (
            np.zeros(width, np.float32),
            np.zeros(width, np.float32),
            np.full(width, -1, np.int32),
        )
        for i in range(k, k + counts[b]):
            for w in range(width):
                value, here = tokens[i, w], np.int32(i)
                total[w] += value
                place[w] = here if value > greatest[w] else place[w]
                greatest[w] = value if value > greatest[w] else greatest[w]
        pooled[b, :width] = total * np.float32(1.0 / max(counts[b], 1))
        pooled[b, width:], best[b] = greatest, place
        k += counts[b]


@njit(cache=True, nogil=True)
def _unpool(gradient: Floats32, counts: Ints, best: Ints32, found: Floats32) -> None:
    """The gradient (n, width) of the tokens from that (batch, 2 * width) of what `_pool` finds."""
    width, k = found.shape[1], 0
    for b in range(counts.size):
        share = np.float32(1.0 / max(counts[b], 1))
        for i in range(k, k + counts[b]):
            for w in range(width):
                found[i, w] = gradient[b, w] * share
        for w in range(width):
            if best[b, w] >= 0:
                found[best[b, w], w] += gradient[b, width + w]
        k += counts[b]


@njit(cache=True, nogil=True)
def _gather(gradient: Floats32, counts: Ints, found: Floats32) -> None:
    """Sums (batch, width) of each decision's rows (n, width)."""
    k = 0
    for b in range(counts.size):
        found[b] = np.float32(0.0)
        for i in range(k, k + counts[b]):
            for w in range(found.shape[1]):
                found[b, w] += gradient[i, w]
        k += counts[b]
