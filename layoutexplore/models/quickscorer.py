"""Boosted trees as masks of leaves, for many samples at once (Lucchese et al., "QuickScorer", SIGIR 2015).

The leaves of a tree are numbered from left to right. A node whose feature is greater than its threshold rules
out the leaves of its left side; of those that no node rules out, a sample belongs in the first. All nodes are
asked, but of many samples at once and without a branch.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

LANES = 64
"""Samples that are scored together."""

_SINGLE, _DOUBLE = (np.uint32(0x077CB531), 27), (np.uint64(0x03F79D71B4CB0A89), 58)
"""Factor and shift that turn a single bit into its place (a de Bruijn sequence), for 32 and 64 leaves."""


class LeafMasks(NamedTuple):
    """A forest as masks.

    Attributes:
        feature: int32 (nodes,), tree after tree, without leaves.
        threshold: float (nodes,), a sample whose feature is at most this rules nothing out.
        masks: uint32 or uint64 (nodes,), the leaves that are left otherwise.
        starts: int64 (trees + 1,), first node of each tree.
        values: float64 (trees, 32 or 64), of the leaves, in the order that factor and shift give.
        factor: See `_SINGLE`.
        shift: See `_SINGLE`.
        bias: What the sum of the trees begins with.
    """

    feature: NDArray[np.int32]
    threshold: NDArray[np.floating[Any]]
    masks: NDArray[np.unsignedinteger[Any]]
    starts: NDArray[np.int64]
    values: NDArray[np.float64]
    factor: np.unsignedinteger[Any]
    shift: int
    bias: float


NO_MASKS = LeafMasks(
    np.zeros(0, np.int32),
    np.zeros(0),
    np.zeros(0, np.uint32),
    np.zeros(1, np.int64),
    np.zeros((0, 32)),
    *_SINGLE,
    0.0,
)
"""Of no tree: for kernels that go on without masks where there are none."""


def leaf_masks(
    feature: NDArray[np.int32],
    threshold: NDArray[np.float64],
    left: NDArray[np.int32],
    right: NDArray[np.int32],
    roots: NDArray[np.int32],
    bias: float,
) -> LeafMasks | None:
    """The masks of a `Forest`, given by its attributes; None when a tree has more than 64 leaves."""
    nodes, masks, starts, leaves = _number_leaves(feature, left, right, roots)
    most = int(np.diff(leaves[1]).max(initial=1))
    if most > 64:
        return None
    factor, shift = _SINGLE if most <= 32 else _DOUBLE
    word = factor.dtype.type
    size = 8 * factor.itemsize
    place = np.array([((int(factor) << k) % 2**size) >> shift for k in range(size)])
    values = np.zeros((len(roots), size))
    for tree, (first, last) in enumerate(zip(leaves[1][:-1], leaves[1][1:], strict=True)):
        values[tree, place[: last - first]] = threshold[leaves[0][first:last]]
    return LeafMasks(
        feature[nodes], threshold[nodes], masks.astype(word), starts, values, factor, shift, bias
    )


def rounded_down(values: NDArray[np.floating[Any]]) -> NDArray[np.float32]:
    """The greatest float32 that is at most each value: float32 samples compare with both alike.

    Example:
        >>> rounded_down(np.array([0.5, 0.1])).tolist()
        [0.5, 0.09999999403953552]
    """
    single = values.astype(np.float32)
    return np.where(single > values, np.nextafter(single, np.float32(-np.inf)), single)


@njit(cache=True, nogil=True)
def _number_leaves(
    feature: NDArray[np.int32], left: NDArray[np.int32], right: NDArray[np.int32], roots: NDArray[np.int32]
) -> tuple[
    NDArray[np.int64], NDArray[np.uint64], NDArray[np.int64], tuple[NDArray[np.int64], NDArray[np.int64]]
]:
    """The nodes that ask, their masks, the first of each tree; and the leaves, the first of each tree.

    Leaves are numbered from left to right.
    """
    size, full = len(feature), np.uint64(0xFFFFFFFFFFFFFFFF)
    nodes, masks, leaves = np.empty(size, np.int64), np.empty(size, np.uint64), np.empty(size, np.int64)
    starts, first_leaves = np.zeros(len(roots) + 1, np.int64), np.zeros(len(roots) + 1, np.int64)
    waiting, begun = np.empty(size + 1, np.int64), np.full(size, -1, np.int64)
    asked = found = 0
    for tree in range(len(roots)):
        waiting[0], count = roots[tree], 1
        while count > 0:
            i = waiting[count - 1]
            if feature[i] < 0:
                leaves[found] = i
                found += 1
                count -= 1
            elif begun[i] < 0:
                begun[i] = found - first_leaves[tree]
                waiting[count] = left[i]
                count += 1
            else:
                # All leaves of its left side have been numbered.
                low, high = np.uint64(begun[i]), np.uint64(found - first_leaves[tree])
                below_high = full if high >= 64 else (np.uint64(1) << high) - np.uint64(1)
                below_low = full if low >= 64 else (np.uint64(1) << low) - np.uint64(1)
                nodes[asked], masks[asked] = i, full ^ (below_high & ~below_low)
                asked += 1
                waiting[count - 1] = right[i]
        starts[tree + 1], first_leaves[tree + 1] = asked, found
    return nodes[:asked], masks[:asked], starts, (leaves[:found], first_leaves)


@njit(cache=True, nogil=True)
def log_odds_by_masks(x: NDArray[np.floating[Any]], forest: LeafMasks, odds: NDArray[np.float64]) -> None:
    """Write the sums of the trees for samples `x` (n, features) to `odds` (n,).

    The result is that of `layoutexplore.models.forest.log_odds`.
    """
    columns, left = np.zeros((x.shape[1], LANES), x.dtype), np.zeros(LANES, forest.masks.dtype)
    totals = np.empty(LANES)
    for begin in range(0, len(x), LANES):
        end = min(begin + LANES, len(x))
        for n in range(begin, end):
            for j in range(x.shape[1]):
                columns[j, n - begin] = x[n, j]
        totals[:] = forest.bias
        for tree in range(len(forest.starts) - 1):
            left[:] = ~np.uint64(0)
            for k in range(forest.starts[tree], forest.starts[tree + 1]):
                column, threshold, mask = columns[forest.feature[k]], forest.threshold[k], forest.masks[k]
                for j in range(LANES):
                    left[j] = left[j] if column[j] <= threshold else left[j] & mask
            # Leaves are numbered from left to right: the sample's is the first that is left, the lowest bit.
            for j in range(LANES):
                left[j] = (left[j] & (~left[j] + 1)) * forest.factor
            values = forest.values[tree]
            for j in range(LANES):
                totals[j] += values[left[j] >> forest.shift]
        for n in range(begin, end):
            odds[n] = totals[n - begin]
