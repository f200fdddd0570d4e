"""Agents and predictors are asked: what they answer is what was asked for, and the map is left as it was."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

import numpy as np

from layoutexplore.errors import ConfigError, OwnCodeError
from layoutexplore.frontiers.decision import Decision, Predictor
from layoutexplore.grids.arrays import Cells
from layoutexplore.options import check_kind
from layoutexplore.plugins.tracebacks import told


@contextlib.contextmanager
def saying_where(where: Callable[[], str]) -> Iterator[None]:
    """Inside the block somebody is asked; what fails says who, and where.

    Args:
        where: Asked for that once something has failed.

    Raises:
        OwnCodeError: What was raised is neither an `Exception` nor meant to end this process.
    """
    try:
        yield
    except (Exception, SystemExit) as error:
        error.add_note(f"({where()})")
        raise
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a cancelled coroutine, a panic of compiled code: it ends this run alone
        raise OwnCodeError(f"{where()}:\n{told(error)}") from error


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
