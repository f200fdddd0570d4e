"""Cells that two labellings share: for all pairs of labels, and whose share of each label is largest."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from layoutexplore.errors import checks_arguments


@checks_arguments
def shared_cells(
    first: NDArray[np.integer[Any]], second: NDArray[np.integer[Any]], *, count: int = 0
) -> NDArray[np.int64]:
    """How many cells have each pair of labels.

    Args:
        first: int (n,) or (rows, cols), a label of each cell, at least 0.
        second: The other label of each cell, at least 0, of the same shape.
        count: Labels of the first kind that the table has at least a row for.

    Returns:
        int64 (highest first label + 1 or `count`, highest second label + 1).

    Example:
        >>> shared_cells(np.array([0, 1, 1, 1]), np.array([1, 0, 2, 2])).tolist()
        [[0, 1, 0], [1, 0, 2]]
    """
    rows = max(int(first.max(initial=0)) + 1, count)
    cols = int(second.max(initial=0)) + 1
    pairs = first.ravel().astype(np.int64) * cols + second.ravel()
    return np.asarray(np.bincount(pairs, minlength=rows * cols).reshape(rows, cols), np.int64)


@checks_arguments
def most_shared(
    first: NDArray[np.integer[Any]], second: NDArray[np.integer[Any]], *, count: int = 0
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """For each label the other one, above 0, that it shares most cells with, the lowest of several.

    Args:
        first: int (n,) or (rows, cols), a label of each cell, 0 for none.
        second: The other label of each cell, 0 for none, of the same shape.
        count: Labels of the first kind that there is an entry for at least.

    Returns:
        int64 (highest first label + 1 or `count`,) each: the other label, 0 where no cell is shared, and how
        many cells are. Entry 0 is that of cells without a first label.

    Example:
        >>> most_shared(np.array([1, 1, 1, 2]), np.array([3, 3, 4, 0]))
        (array([0, 3, 0]), array([0, 2, 0]))
    """
    table = shared_cells(first, second, count=count)
    table[:, 0] = 0
    return table.argmax(axis=1), table.max(axis=1)
