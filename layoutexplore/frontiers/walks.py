"""What agents and predictors answer: paths that lead from cell to cell, and a map that is left as it was."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import numpy as np

from layoutexplore.errors import ConfigError
from layoutexplore.frontiers.decision import CellPath, Choice, Decision, Predictor, Walk
from layoutexplore.grids.arrays import Cells, Ints32
from layoutexplore.grids.grid import Cell
from layoutexplore.options import check_kind
from layoutexplore.planning.shortest_paths import check_path

NO_SIGHTS = np.empty((0, 2), np.int32)
"""Of a path that is followed to its end: int32 (0, 2)."""


def plain_choice(choice: Choice) -> Choice:
    """A choice as it is; that of a policy whose answer is an array of one number, shape (), as a number."""
    return choice.item() if isinstance(choice, np.ndarray) and choice.ndim == 0 else choice


@contextlib.contextmanager
def leaving_the_map(cells: Cells, who: str) -> Iterator[None]:
    """Inside the block somebody is asked who may read the robot's map int8 (rows, cols) and not change it.

    Raises:
        ConfigError: It is another one afterwards: the robot would drive by what it has never seen.
    """
    before = _sum_of(cells)
    yield
    if _sum_of(cells) != before:
        raise ConfigError(f"{who} has changed the robot's map: change a copy, decision.grid.cells.copy()")


def _sum_of(cells: Cells) -> tuple[int, bytes]:
    """The sum of all cells, eight in a number, and those left over: a copy would take ten times as long."""
    flat = np.ascontiguousarray(cells).reshape(-1)
    words = len(flat) // 8 * 8
    return int(flat[:words].view(np.uint64).sum()), flat[words:].tobytes()


def completed(decision: Decision, predictor: Predictor) -> Decision:
    """What a predictor makes of a decision.

    Raises:
        ConfigError: That is no decision, or it has changed the map.
    """
    who = f"predictor {getattr(predictor, 'name', type(predictor).__name__)!r}"
    with leaving_the_map(decision.grid.cells, who):
        made = predictor.predict(decision)
    check_kind(f"what {who} makes of a decision", made, Decision)
    return made


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
