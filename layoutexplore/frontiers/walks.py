"""Paths that agents plan themselves: what is right about them before a robot follows one."""

from __future__ import annotations

from typing import Any

import numpy as np

from layoutexplore.errors import ConfigError
from layoutexplore.frontiers.decision import CellPath, Choice, Walk
from layoutexplore.grids.arrays import Ints32
from layoutexplore.grids.grid import Cell
from layoutexplore.planning.shortest_paths import check_path

NO_SIGHTS = np.empty((0, 2), np.int32)
"""Of a path that is followed to its end: int32 (0, 2)."""


def plain_choice(choice: Choice) -> Choice:
    """A choice as it is; an array of one number, shape () or (1,), as policies answer, as that number.

    Example:
        >>> plain_choice(np.array([2])), plain_choice(np.int64(2))
        (2, 2)
    """
    given: Any = choice
    is_one = isinstance(given, np.ndarray) and given.ndim < 2 and given.size == 1
    if is_one or isinstance(given, np.integer):
        number: Choice = given.item()
        return number
    return choice


def checked_walk(choice: CellPath | Walk, here: Cell, shape: tuple[int, int]) -> Walk:
    """The path of a choice, and what it is followed for: nothing where it is followed to its end.

    Args:
        choice: As an agent gave it.
        here: The robot's cell.
        shape: (rows, cols) of the grid.

    Raises:
        ConfigError: The path does not lead from the robot's cell from neighbour to neighbour, or a walk has
            no sights or some outside of the grid.
    """
    if isinstance(choice, Walk):
        return Walk(check_path(choice.path, here), _check_sights(choice.sights, shape))
    return Walk(check_path(choice, here), NO_SIGHTS)


def _check_sights(sights: Ints32, shape: tuple[int, int]) -> Ints32:
    is_right = isinstance(sights, np.ndarray) and np.issubdtype(sights.dtype, np.integer)
    if not (is_right and sights.ndim == 2 and sights.shape[1] == 2 and len(sights)):
        told = f"{sights.dtype} {sights.shape}" if isinstance(sights, np.ndarray) else f"{sights!r:.40}"
        raise ConfigError(f"the sights of a walk are an integer array (n, 2) of cells, n > 0, got {told}")
    outside = np.flatnonzero(((sights < 0) | (sights >= np.array(shape))).any(axis=1))
    if len(outside):
        where = tuple(sights[outside[0]].tolist())
        raise ConfigError(
            f"the sight {where} of a walk lies outside of the grid of {shape[0]} x {shape[1]} cells"
        )
    return np.ascontiguousarray(sights, np.int32)
