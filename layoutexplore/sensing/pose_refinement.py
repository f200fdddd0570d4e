"""A pose refined on the walls of the map: Gauss-Newton steps that lay a scan's points onto their lines.

A point on a wall tells how far the robot is from the wall, and nothing about where along it. So its distance
is taken to the line through the means of the cells around the nearest one (Censi, "An ICP variant using a
point-to-line metric", 2008), and to that mean alone where the means around it make no line. Points that lie
far from all means weigh little, as in the score of `layoutexplore.sensing.scan_matching`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Floats, Ints
from layoutexplore.sensing.measured_points import (
    MeasuredPoints,
    cells_met,
    is_turned_away,
    line_through,
    nearest_mean,
)

PoseInCells = tuple[float, float, float]
"""(x, y, heading): in cells from the grid's corner, and in radians."""

REACH = 3.0
"""Spreads: a point that is farther from every mean than this lies on no wall that is known."""

ROUNDS = 8
"""At most so many steps; three or four are mostly enough."""

_FIXED = 1e15
"""Information about what does not move."""


Equations = tuple[float, float, float, float, float, float, float, float, float]
"""Normal equations of (x, y, heading): the matrix's upper triangle row by row, then the right side."""


class MatchModel(NamedTuple):
    """What a pose is judged by; lengths in cells.

    Attributes:
        spread: As in `ScanMatcherConfig`.
        weight: As in `ScanMatcherConfig`.
        position_std: Standard deviation of the prior along x and along y.
        heading_std: Its standard deviation of the heading, in radians.
    """

    spread: float
    weight: float
    position_std: float
    heading_std: float


class _Lines(NamedTuple):
    """The line that each of n points was last compared with: mostly it is the same in the next round.

    Attributes:
        cells: int64 (n, 2): the nearest mean's cell, counted row by row, or -1; and the cells around it that
            the line goes through, as `line_through` takes them.
        values: float64 (n, 4): a point of the line (x, y), and its normal (x, y); a normal of 0 is no line.
    """

    cells: Ints
    values: Floats


@njit(cache=True, nogil=True)
def _no_lines(count: int) -> _Lines:
    """The lines of so many points before the first round."""
    return _Lines(np.full((count, 2), -1), np.empty((count, 4)))


@njit(cache=True, nogil=True)
def refine_pose(
    points: MeasuredPoints, ends: Floats, start: PoseInCells, prior: PoseInCells, model: MatchModel
) -> PoseInCells:
    """The pose near to `start` from which the ends float64 (n, 2) lie best on the walls.

    Args:
        points: The map.
        ends: Measured points as the robot sees them, in cells.
        start: Where to begin.
        prior: Where odometry believes the robot to be; `model` says how sure.
        model: What a pose is judged by.
    """
    x, y, heading = start
    sure_xy = 1.0 / model.position_std**2 if model.position_std > 0.0 else _FIXED
    sure_heading = 1.0 / model.heading_std**2 if model.heading_std > 0.0 else _FIXED
    # The prior comes first; it also keeps the equations solvable where no point lies on a wall.
    no_pull = (sure_xy, 0.0, 0.0, sure_xy, 0.0, sure_heading)
    lines = _no_lines(len(ends))
    for _ in range(ROUNDS):
        pull = (sure_xy * (prior[0] - x), sure_xy * (prior[1] - y), sure_heading * (prior[2] - heading))
        equations = _equations(points, ends, lines, (x, y, heading), model, no_pull + pull)
        step_x, step_y, turn = _solved(equations)
        x, y, heading = x + step_x, y + step_y, heading + turn
        # What is left is far below what a scan can tell.
        if abs(step_x) + abs(step_y) < 1e-2 and abs(turn) < 1e-4:
            break
    return x, y, heading


@njit(cache=True, nogil=True)
def _equations(
    points: MeasuredPoints,
    ends: Floats,
    lines: _Lines,
    pose: PoseInCells,
    model: MatchModel,
    equations: Equations,
) -> Equations:
    """The normal equations with what all points tell added, from a pose."""
    rows, cols = points.number.shape
    x, y, heading = pose
    cos, sin = math.cos(heading), math.sin(heading)
    square_reach = (REACH * model.spread) ** 2
    for i in range(ends.shape[0]):
        arm_x = ends[i, 0] * cos - ends[i, 1] * sin
        arm_y = ends[i, 0] * sin + ends[i, 1] * cos
        end_x, end_y = x + arm_x, y + arm_y
        # The line of a mean reaches a cell farther than the mean itself.
        if not (2.0 <= end_x < cols - 2 and 2.0 <= end_y < rows - 2):
            continue
        square, row, col = nearest_mean(points, end_x, end_y)
        if square > square_reach or is_turned_away(points, row, col, arm_x, arm_y):
            continue
        here, met = row * cols + col, cells_met(points, row, col, arm_x, arm_y)
        if lines.cells[i, 0] != here or lines.cells[i, 1] != met:
            _keep_line(points, lines, i, row, col, met)
        normal_x, normal_y = lines.values[i, 2], lines.values[i, 3]
        if normal_x != 0.0 or normal_y != 0.0:
            off = normal_x * (lines.values[i, 0] - end_x) + normal_y * (lines.values[i, 1] - end_y)
            slope = (normal_x, normal_y, normal_y * arm_x - normal_x * arm_y)
            equations = _with(equations, slope, off, off * off, model)
        else:
            off_x, off_y = points.x[row, col] - end_x, points.y[row, col] - end_y
            equations = _with(equations, (1.0, 0.0, -arm_y), off_x, square, model)
            equations = _with(equations, (0.0, 1.0, arm_x), off_y, square, model)
    return equations


@njit(cache=True, nogil=True)
def _keep_line(points: MeasuredPoints, lines: _Lines, i: int, row: int, col: int, met: int) -> None:
    """Keep the line through some of the cells around one as that of the i-th point."""
    is_line, x, y, normal_x, normal_y = line_through(points, row, col, met)
    lines.cells[i, 0], lines.cells[i, 1] = row * points.number.shape[1] + col, met
    lines.values[i, 0], lines.values[i, 1] = x, y
    lines.values[i, 2], lines.values[i, 3] = (normal_x, normal_y) if is_line else (0.0, 0.0)


@njit(cache=True, nogil=True)
def _with(
    equations: Equations, slope: tuple[float, float, float], off: float, square: float, model: MatchModel
) -> Equations:
    """With one distance `off` added, which moves by `slope` with the pose, weighed by its point's square."""
    variance = model.spread * model.spread
    weight = model.weight * math.exp(-0.5 * square / variance) / variance
    xx, xy, xt, yy, yt, tt, x, y, t = equations
    a, b, c = slope
    return (
        xx + weight * a * a,
        xy + weight * a * b,
        xt + weight * a * c,
        yy + weight * b * b,
        yt + weight * b * c,
        tt + weight * c * c,
        x + weight * a * off,
        y + weight * b * off,
        t + weight * c * off,
    )


@njit(cache=True, nogil=True)
def _solved(equations: Equations) -> tuple[float, float, float]:
    """The solution of three symmetric positive definite equations."""
    # Elimination without pivots: none is zero, as the prior adds to each of the diagonal.
    xx, xy, xt, yy, yt, tt, x, y, t = equations
    below = xy / xx
    last = xt / xx
    middle = yy - below * xy
    cross = yt - below * xt
    second = y - below * x
    ratio = cross / middle
    third = t - last * x - ratio * second
    turn = third / (tt - last * xt - ratio * cross)
    step_y = (second - cross * turn) / middle
    step_x = (x - xy * step_y - xt * turn) / xx
    return step_x, step_y, turn
