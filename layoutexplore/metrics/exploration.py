"""Scores of one exploration: how many metres it took to see how much of the building.

A run is described by its coverage curve, a row a scan: metres travelled and the share of the target area
seen. The target is the free space that the robot can be asked to see, so 1.0 is possible. Definitions follow
the protocol of exploration studies (distance to a coverage level, area under the coverage curve); all are
pure functions of arrays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from layoutexplore.errors import ConfigError, checks_arguments

NEARLY_SEEN = 0.95
"""Coverage from which a building is nearly explored: what is left are corners."""

FULLY_SEEN = 0.99
"""Coverage from which a building counts as explored."""

LEVELS = (0.90, NEARLY_SEEN, FULLY_SEEN)
"""Coverage levels whose distances are reported as d90, d95 and d99."""

FINISHED_SHARE = 0.95
"""A room is finished when this share of its target area has been seen."""

REVISIT_SQUARE = 0.5
"""Side in metres of the squares by which places are told apart when revisits are counted."""

REVISIT_DELAY = 2.0
"""Metres walked since a square was first entered from which on walking in it counts as a revisit."""


@dataclass(frozen=True, kw_only=True)
class CurveScores:
    """What a coverage curve says about a run.

    Attributes:
        d90: Metres until 90 % of the target area was seen; the budget when that never happened, NaN where the
            run was ended below.
        d95: The same for 95 %.
        d99: The same for 99 %.
        reached90: Whether 90 % was seen; False where the run was ended below.
        reached95: The same for 95 %.
        reached99: The same for 99 %.
        auc: Mean coverage over the first `auc_horizon(target_area)` metres, 0..1.
    """

    d90: float
    d95: float
    d99: float
    reached90: bool
    reached95: bool
    reached99: bool
    auc: float


@checks_arguments
def auc_horizon(target_area: float) -> float:
    """Metres over which the column `auc` averages the coverage: 20 m + 0.2 m for each square metre.

    A fixed rule, a fifth of the default budget, so that the score of a run does not depend on what else was
    run.
    """
    return 20.0 + 0.2 * target_area


@checks_arguments
def score_curve(
    curve: ArrayLike, *, budget: float, target_area: float, goal: float = FULLY_SEEN
) -> CurveScores:
    """All scores of a coverage curve.

    Args:
        curve: float (n, 2 or more) rows of (metres travelled, coverage 0..1), both never falling.
        budget: Metres charged for a level that was not reached, and at most.
        target_area: Square metres that could be seen.
        goal: Coverage at which the run was ended; the distance of a level above it was not measured and is
            NaN, also where the last scan saw so much, and the level counts as not reached.

    Example:
        >>> scores = score_curve([(0, 0.5), (10, 0.9), (20, 1.0)], budget=100.0, target_area=10.0)
        >>> round(scores.d90, 3), round(scores.d95, 3), scores.reached99
        (10.0, 15.0, True)
    """
    distance, coverage = _columns(curve)
    metres, reached = [], []
    for level in LEVELS:
        value, was_reached = distance_to_coverage(distance, coverage, level, budget=budget)
        # The last scan may see beyond the goal: taking those runs alone would be a biased sample.
        measured = level <= goal + 1e-9
        metres.append(value if measured else float("nan"))
        reached.append(measured and was_reached)
    return CurveScores(
        d90=metres[0],
        d95=metres[1],
        d99=metres[2],
        reached90=reached[0],
        reached95=reached[1],
        reached99=reached[2],
        auc=mean_coverage(distance, coverage, auc_horizon(target_area)),
    )


@checks_arguments
def distance_to_coverage(
    distance: ArrayLike, coverage: ArrayLike, level: float, *, budget: float
) -> tuple[float, bool]:
    """Metres travelled when the coverage first reached a level, linear between the scans before and after.

    Args:
        distance: float (n,) metres, never falling.
        coverage: float (n,) shares 0..1, never falling.
        level: The share asked for.
        budget: What is charged when the level was not reached, and at most: the turn for a last scan may go
            beyond it.

    Returns:
        The metres, and whether the level was reached.

    Example:
        >>> distance_to_coverage([0, 10], [0.0, 1.0], 0.25, budget=50.0)
        (2.5, True)
        >>> distance_to_coverage([0, 10], [0.0, 0.2], 0.25, budget=50.0)
        (50.0, False)
    """
    metres, share = _checked(distance, coverage)
    above = share >= level
    if not above.any():
        return float(budget), False
    k = int(np.argmax(above))
    if k == 0 or share[k] == share[k - 1]:
        return min(float(metres[k]), float(budget)), True
    t = (level - share[k - 1]) / (share[k] - share[k - 1])
    return min(float(metres[k - 1] + t * (metres[k] - metres[k - 1])), float(budget)), True


@checks_arguments
def mean_coverage(distance: ArrayLike, coverage: ArrayLike, horizon: float) -> float:
    """Area under the coverage curve from 0 to `horizon` metres, divided by the horizon: 0..1.

    The coverage is linear between scans and stays at its last value after the run's end.

    Example:
        >>> mean_coverage([0, 10], [0.0, 1.0], horizon=20.0)
        0.75
    """
    metres, share = _checked(distance, coverage)
    if not 0 < horizon < np.inf:
        raise ConfigError(f"the horizon of the mean coverage must be a length above 0 m, got {horizon}")
    inside = metres <= horizon
    x = np.concatenate([metres[inside], [horizon]])
    y = np.concatenate([share[inside], [np.interp(horizon, metres, share)]])
    return float((np.trapezoid(y, x) + y[0] * x[0]) / horizon)


@checks_arguments
def coverage_at(distance: ArrayLike, coverage: ArrayLike, at: ArrayLike | float) -> NDArray[np.float64]:
    """Coverage at given distances, float64 like `at`.

    Linear between scans, the last value after the run's end.
    """
    metres, share = _checked(distance, coverage)
    return np.interp(np.asarray(at, np.float64), metres, share)


@checks_arguments
def revisit_share(track: ArrayLike, *, square: float = REVISIT_SQUARE, delay: float = REVISIT_DELAY) -> float:
    """Share of the metres walked that led through places walked before, 0..1.

    The plane is cut into squares. A step counts as a revisit when the square of its end was first entered
    more than `delay` metres of walking earlier; the delay keeps a walk along the border of two squares from
    counting.

    Args:
        track: float (n, 2 or more) positions in metres in the order walked.
        square: Side of a square in metres.
        delay: Metres.

    Raises:
        ConfigError: The track does not consist of rows of two numbers or more.

    Example:
        >>> there = [(0.1 * k, 0.0) for k in range(101)]
        >>> round(revisit_share(there + there[::-1]), 1)
        0.5
    """
    points = np.asarray(track, np.float64)
    if points.ndim != 2 or points.shape[1] < 2:
        raise ConfigError(f"a track needs rows of x and y in metres, got shape {points.shape}")
    points = points[:, :2]
    steps = np.hypot(*np.diff(points, axis=0).T)
    total = float(steps.sum())
    if total == 0.0:
        return 0.0
    walked = np.concatenate([[0.0], np.cumsum(steps)])
    squares = np.floor(points / square).astype(np.int64)
    _, first, which = np.unique(squares, axis=0, return_index=True, return_inverse=True)
    again = walked[1:] - walked[first][which.ravel()][1:] > delay
    return float(steps[again].sum()) / total


@checks_arguments
def rooms_finished(
    room_ids: NDArray[np.signedinteger[Any]], target: NDArray[np.bool_], seen: NDArray[np.bool_]
) -> tuple[int, int]:
    """Number of rooms of whose target area at least 95 % has been seen, and number of rooms that have any.

    Args:
        room_ids: int16 or int32 (rows, cols), 0 where there is no room.
        target: bool (rows, cols), cells that can be asked to be seen.
        seen: bool (rows, cols), cells that are known.
    """
    if not np.shape(room_ids) == np.shape(target) == np.shape(seen):
        raise ConfigError("rooms_finished: room_ids, target and seen must be of one shape")
    inside = target & (room_ids > 0)
    if not inside.any():
        return 0, 0
    cells = np.bincount(room_ids[inside])
    known = np.bincount(room_ids[inside & seen], minlength=len(cells))
    rooms = cells > 0
    return int(np.count_nonzero(known[rooms] >= FINISHED_SHARE * cells[rooms])), int(np.count_nonzero(rooms))


def _columns(curve: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    array = np.asarray(curve, np.float64)
    if array.ndim != 2 or array.shape[1] < 2:
        raise ConfigError(f"a coverage curve has rows of (metres, coverage, ...), got shape {array.shape}")
    return array[:, 0], array[:, 1]


def _checked(distance: ArrayLike, coverage: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    metres, share = np.asarray(distance, np.float64), np.asarray(coverage, np.float64)
    if metres.ndim != 1 or metres.shape != share.shape or len(metres) == 0:
        raise ConfigError(
            f"distance and coverage must be equally long and not empty, got {metres.shape} and {share.shape}"
        )
    if np.any(np.diff(metres) < 0) or np.any(np.diff(share) < 0):
        raise ConfigError("distance and coverage along a run never fall")
    return metres, share
