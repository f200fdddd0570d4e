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
from numpy.typing import NDArray

from layoutexplore.grids.arrays import Floats, Floats32

PoseInCells = tuple[float, float, float]
"""(x, y, heading): in cells from the grid's corner, and in radians."""

REACH = 3.0
"""Spreads: a point that is farther from every mean than this lies on no wall that is known."""

ROUNDS = 8
"""At most so many steps; three or four are mostly enough."""

_LINE = 6.0
"""Means make a line where their variance along it is so many times that across it."""

_GRAZING = 20.0
"""Hundredths: the sine of the angle by which the normal of a wall may be wrong, some twelve degrees."""

_FIXED = 1e15
"""Information about what does not move."""


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


class MeasuredPoints(NamedTuple):
    """The points measured in each cell, (rows, cols).

    Attributes:
        number: float32, how many, at most `MOST`.
        x: float32, their mean in cells from the grid's corner; likewise y.
        y: See x.
        facing_x: int8, the normal of the wall's surface towards the robot, in hundredths, once the means
            around make a line; 0 before. Likewise facing_y.
        facing_y: See facing_x.
    """

    number: Floats32
    x: Floats32
    y: Floats32
    facing_x: NDArray[np.int8]
    facing_y: NDArray[np.int8]


def no_points(shape: tuple[int, int]) -> MeasuredPoints:
    """The points of a map (rows, cols) that nothing was measured in."""
    number, x, y = (np.zeros(shape, np.float32) for _ in range(3))
    return MeasuredPoints(number, x, y, np.zeros(shape, np.int8), np.zeros(shape, np.int8))


@njit(cache=True, nogil=True)
def is_turned_away(points: MeasuredPoints, row: int, col: int, beam_x: float, beam_y: float) -> bool:
    """Whether a beam (x, y), of any length, can only have met the other side of the surface in a cell.

    A wall is seen from both its sides, a decimetre or two apart: points of one on means of the other would
    turn a robot that enters a room.
    """
    along = points.facing_x[row, col] * beam_x + points.facing_y[row, col] * beam_y
    return bool(along > 0.0 and along * along > _GRAZING * _GRAZING * (beam_x * beam_x + beam_y * beam_y))


@njit(cache=True, nogil=True)
def nearest_mean(points: MeasuredPoints, x: float, y: float) -> tuple[float, int, int]:
    """The squared distance to the nearest mean in the 3 x 3 cells around a point, inf without, and its cell.

    The point lies in none of the cells on the border.
    """
    # A mean lies somewhere in its cell: the nearest one to a point is among the nine around it, or more than
    # a cell away.
    row, col = int(y), int(x)
    least, nearest_row, nearest_col = np.inf, row, col
    for r in range(row - 1, row + 2):
        for c in range(col - 1, col + 2):
            if points.number[r, c] > 0.0:
                dx, dy = points.x[r, c] - x, points.y[r, c] - y
                away = dx * dx + dy * dy
                if away < least:
                    least, nearest_row, nearest_col = away, r, c
    return least, nearest_row, nearest_col


@njit(cache=True, nogil=True)
def wall_line(
    points: MeasuredPoints, row: int, col: int, beam_x: float, beam_y: float
) -> tuple[bool, float, float, float, float]:
    """The line through the means around one of a cell that is not on the border, which a beam can have met.

    Returns:
        Whether they make one; a point of it (x, y); its normal (x, y), of length 1.
    """
    count, sum_x, sum_y, sum_xx, sum_xy, sum_yy = 0, 0.0, 0.0, 0.0, 0.0, 0.0
    for r in range(row - 1, row + 2):
        for c in range(col - 1, col + 2):
            if points.number[r, c] > 0.0 and not is_turned_away(points, r, c, beam_x, beam_y):
                # Relative to the middle of the cells: squares of small numbers stay exact.
                x, y = points.x[r, c] - col, points.y[r, c] - row
                count += 1
                sum_x, sum_y = sum_x + x, sum_y + y
                sum_xx, sum_xy, sum_yy = sum_xx + x * x, sum_xy + x * y, sum_yy + y * y
    if count < 3:
        return False, 0.0, 0.0, 1.0, 0.0
    x, y = sum_x / count, sum_y / count
    xx, xy, yy = sum_xx / count - x * x, sum_xy / count - x * y, sum_yy / count - y * y
    along = 0.5 * (xx + yy) + math.hypot(0.5 * (xx - yy), xy)
    angle = 0.5 * math.atan2(2.0 * xy, xx - yy)
    is_line = along > _LINE * (xx + yy - along)
    return is_line, x + col, y + row, -math.sin(angle), math.cos(angle)


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
    matrix, vector = np.empty((3, 3)), np.empty(3)
    sure_xy = 1.0 / model.position_std**2 if model.position_std > 0.0 else _FIXED
    sure_heading = 1.0 / model.heading_std**2 if model.heading_std > 0.0 else _FIXED
    for _ in range(ROUNDS):
        # The prior comes first; it also keeps the equations solvable where no point lies on a wall.
        matrix[:] = 0.0
        matrix[0, 0], matrix[1, 1], matrix[2, 2] = sure_xy, sure_xy, sure_heading
        vector[0], vector[1] = sure_xy * (prior[0] - x), sure_xy * (prior[1] - y)
        vector[2] = sure_heading * (prior[2] - heading)
        cos, sin = math.cos(heading), math.sin(heading)
        for i in range(ends.shape[0]):
            arm_x = ends[i, 0] * cos - ends[i, 1] * sin
            arm_y = ends[i, 0] * sin + ends[i, 1] * cos
            _pull(points, (x + arm_x, y + arm_y, arm_x, arm_y), model, matrix, vector)
        step_x, step_y, turn = _solved(matrix, vector)
        x, y, heading = x + step_x, y + step_y, heading + turn
        # What is left is far below what a scan can tell.
        if abs(step_x) + abs(step_y) < 1e-2 and abs(turn) < 1e-4:
            break
    return x, y, heading


@njit(cache=True, nogil=True)
def _pull(
    points: MeasuredPoints,
    end: tuple[float, float, float, float],
    model: MatchModel,
    matrix: Floats,
    vector: Floats,
) -> None:
    """Add what a point (x, y and the same from the robot) tells to the normal equations' upper triangle."""
    rows, cols = points.number.shape
    x, y, arm_x, arm_y = end
    # The line of a mean reaches a cell farther than the mean itself.
    if not (2.0 <= x < cols - 2 and 2.0 <= y < rows - 2):
        return
    square, row, col = nearest_mean(points, x, y)
    if square > (REACH * model.spread) ** 2 or is_turned_away(points, row, col, arm_x, arm_y):
        return
    is_line, line_x, line_y, normal_x, normal_y = wall_line(points, row, col, arm_x, arm_y)
    if is_line:
        off = normal_x * (line_x - x) + normal_y * (line_y - y)
        _add(matrix, vector, (normal_x, normal_y, normal_y * arm_x - normal_x * arm_y), off, off * off, model)
    else:
        _add(matrix, vector, (1.0, 0.0, -arm_y), points.x[row, col] - x, square, model)
        _add(matrix, vector, (0.0, 1.0, arm_x), points.y[row, col] - y, square, model)


@njit(cache=True, nogil=True)
def _add(
    matrix: Floats,
    vector: Floats,
    slope: tuple[float, float, float],
    off: float,
    square: float,
    model: MatchModel,
) -> None:
    """Add one distance `off`, which moves by `slope` with the pose, weighed by the point's squared one."""
    variance = model.spread * model.spread
    weight = model.weight * math.exp(-0.5 * square / variance) / variance
    for i in range(3):
        vector[i] += weight * slope[i] * off
        for j in range(i, 3):
            matrix[i, j] += weight * slope[i] * slope[j]


@njit(cache=True, nogil=True)
def _solved(matrix: Floats, vector: Floats) -> tuple[float, float, float]:
    """The solution of three symmetric positive definite equations, of which the upper triangle counts."""
    # Elimination without pivots: none is zero, as the prior adds to each of the diagonal.
    below = matrix[0, 1] / matrix[0, 0]
    last = matrix[0, 2] / matrix[0, 0]
    middle = matrix[1, 1] - below * matrix[0, 1]
    cross = matrix[1, 2] - below * matrix[0, 2]
    second = vector[1] - below * vector[0]
    ratio = cross / middle
    third = vector[2] - last * vector[0] - ratio * second
    z = third / (matrix[2, 2] - last * matrix[0, 2] - ratio * cross)
    y = (second - cross * z) / middle
    x = (vector[0] - matrix[0, 1] * y - matrix[0, 2] * z) / matrix[0, 0]
    return x, y, z
