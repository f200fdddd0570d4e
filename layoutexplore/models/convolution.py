"""Convolutions of 3 x 3 cells, padded with zeros, in numpy: they run the small shipped networks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeVar

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.models.network_files import Layers

ValuesT = TypeVar("ValuesT")

_ONE_THREAD = 1 << 18
"""Multiplications of one product up to which OpenBLAS keeps to one thread (its `interface/gemm.c`)."""

_STRIP = 8192
"""So many places are convolved at once, in strips of rows: what is needed on the way fits into a cache."""


def small_products(
    values: NDArray[np.float32], weight: NDArray[np.float32], out: NDArray[np.float32] | None = None
) -> NDArray[np.float32]:
    """`values @ weight`, a few rows at a time: threads that share so little work wait longer than they work.

    Where other processes use the cores, they may wait fifty times as long.

    Args:
        values: float32 (n, inputs), C-contiguous.
        weight: float32 (inputs, outputs).
        out: float32 (n, outputs), where they are written.

    Returns:
        float32 (n, outputs). Sums of whole numbers below 2^24 are exact; others may differ in the last bit
        with the number of rows.
    """
    rows = max(_ONE_THREAD // weight.size, 1)
    whole = len(values) // rows * rows
    if out is None:
        out = np.empty((len(values), weight.shape[1]), np.float32)
    blocks = values[:whole].reshape(-1, rows, values.shape[1])
    np.matmul(blocks, weight, out=out[:whole].reshape(-1, rows, weight.shape[1]))
    np.matmul(values[whole:], weight, out=out[whole:])
    return out


def convolve(
    values: NDArray[np.float32], weight: NDArray[np.float32], side: int, stride: int
) -> NDArray[np.float32]:
    """One convolution, without its bias: float32 (rows / stride, cols / stride, channels out).

    Args:
        values: float32 (rows, cols, channels in).
        weight: float32 (side * side * channels in, channels out), by row, column and channel.
        side: Side of the kernel, 1 or 3.
        stride: So many cells lie between those of the result.
    """
    if side == 1:
        return small_products(values.reshape(-1, values.shape[2]), weight).reshape(*values.shape[:2], -1)
    rows, cols, _ = values.shape
    # A strip of an even number of rows: the cells of a stride of two begin anew in each.
    strip = 2 * max(_STRIP // (2 * cols), 1)
    out = np.empty(((rows - 1) // stride + 1, (cols - 1) // stride + 1, weight.shape[1]), np.float32)
    for first in range(0, rows, strip):
        last = min(first + strip, rows)
        into = out[first // stride : (last - 1) // stride + 1]
        padded = np.zeros((last - first + 3, cols + 2, values.shape[2]), np.float32)
        low, high = max(first - 1, 0), min(last + 1, rows)
        padded[low - first + 1 : high - first + 1, 1 : cols + 1] = values[low:high]
        into[:] = _convolve_dense(padded, weight) if stride == 1 else _convolve_sparse(padded, weight, stride)
    return out


def run_layer(
    name: str, values: NDArray[np.float32], layers: Layers, weights: Mapping[str, NDArray[np.float32]]
) -> NDArray[np.float32]:
    """One of the layers of a network, with its bias; behind all but the last, "judge", comes a ReLU.

    Args:
        name: Of the layer.
        values: float32 (rows, cols, channels in); padded with zeros.
        layers: All layers.
        weights: Of them, as `layoutexplore.models.network_files` names them.
    """
    _, _, side, stride = layers[name]
    found = convolve(values, weights[f"{name}.weight"], side, stride)
    found += weights[f"{name}.bias"]
    return found if name == "judge" else np.maximum(found, 0.0, out=found)


def halved(layer: Callable[[str, ValuesT], ValuesT], full: ValuesT) -> tuple[ValuesT, ValuesT, ValuesT]:
    """Values at a half, a fourth and an eighth of their resolution, as U-Nets of such layers have them.

    Args:
        layer: Runs the layer of a name, "to_half", "at_half" and so on: NumPy's or torch's.
        full: At full resolution.
    """
    half = layer("at_half", layer("to_half", full))
    fourth = layer("at_fourth", layer("to_fourth", half))
    return half, fourth, layer("at_eighth", layer("to_eighth", fourth))


def joined_to_larger(small: NDArray[np.float32], larger: NDArray[np.float32]) -> NDArray[np.float32]:
    """Values grown to twice as many rows and columns, and beside them those that are as many.

    Args:
        small: float32 (rows, cols, channels).
        larger: float32 (2 rows or one less, 2 cols or one less, other channels).

    Returns:
        float32, `larger` with the channels of `small` before its own.
    """
    rows, cols, kept = larger.shape
    joined = np.empty((rows, cols, small.shape[2] + kept), np.float32)
    joined[..., -kept:] = larger
    for row, col in ((0, 0), (0, 1), (1, 0), (1, 1)):
        part = joined[row::2, col::2, :-kept]
        part[:] = small[: part.shape[0], : part.shape[1]]
    return joined


def _convolve_dense(padded: NDArray[np.float32], weight: NDArray[np.float32]) -> NDArray[np.float32]:
    """Stride 1 as nine products: in rows with a common margin a shift is an offset."""
    rows, cols, inputs = padded.shape
    flat, count = padded.reshape(-1, inputs), (rows - 3) * cols
    found = small_products(flat[:count], weight[:inputs])
    part = np.empty_like(found)
    for k in range(1, 9):
        begin = k // 3 * cols + k % 3
        found += small_products(flat[begin : begin + count], weight[k * inputs : (k + 1) * inputs], part)
    return found.reshape(rows - 3, cols, -1)[:, : cols - 2]


def _convolve_sparse(
    padded: NDArray[np.float32], weight: NDArray[np.float32], stride: int
) -> NDArray[np.float32]:
    """A larger stride as one product: the cells around each that counts, side by side."""
    rows, cols, inputs = padded.shape
    parts = [padded[r : rows - 3 + r : stride, c : cols - 2 + c : stride] for r in range(3) for c in range(3)]
    near = np.concatenate(parts, axis=2)
    return small_products(near.reshape(-1, 9 * inputs), weight).reshape(*near.shape[:2], -1)


@njit(cache=True, nogil=True)
def neighbourhoods(values: NDArray[np.float32], stride: int) -> NDArray[np.float32]:
    """The 3 x 3 cells around every `stride`-th one, padded with zeros.

    Takes (n, rows, cols, channels) and returns (n, rows / stride, cols / stride, 9 channels), rounded up.
    """
    images, rows, cols, channels = values.shape
    out = np.empty((images, (rows - 1) // stride + 1, (cols - 1) // stride + 1, 9 * channels), np.float32)
    of, to = values.ravel(), out.ravel()
    at = np.uint64(0)  # Unsigned: numba need not look whether an index counts from the end.
    for image in range(images):
        for r in range(-1, rows - 1, stride):
            for c in range(-1, cols - 1, stride):
                for row in range(r, r + 3):
                    # Columns [first, last) of the kernel's row lie in the image; none of a row outside of it.
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
