"""The points that scans measured, kept as their mean in each cell: what poses are matched with.

The two sides of a wall are two surfaces: each cell keeps which way its surface faces, and a beam is compared
with the side that it can have met.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.grids.arrays import Floats, Floats32

MOST = 50.0
"""A mean of more points than this moves as if there were so many."""

_LINE = 6.0
"""Means make a line where their variance along it is so many times that across it."""

_GRAZING = 20.0
"""Hundredths: the sine of the angle by which the normal of a wall may be wrong, some twelve degrees."""

_LOWEST = np.array([0] + [(n & -n).bit_length() - 1 for n in range(1, 512)], np.int64)
"""int64 (512,): the lowest bit that is set in a number of nine bits, 0 without any."""

_ROW = np.repeat((-1, 0, 1), 3)
"""int64 (9,): rows from the middle one of 3 x 3 cells in the order of the bits, row by row; likewise _COL."""

_COL = np.tile((-1, 0, 1), 3)


class MeasuredPoints(NamedTuple):
    """The points measured in each cell, (rows, cols).

    Attributes:
        number: float32, how many, at most `MOST`.
        x: float32, their mean in cells from the grid's corner; likewise y.
        y: See x.
        facing_x: int8, the normal of the wall's surface towards the robot, in hundredths, once the means
            around make a line; 0 before. Likewise facing_y.
        facing_y: See facing_x.
        around: uint16, which of the 3 x 3 cells around have points: a bit each, row by row.
    """

    number: Floats32
    x: Floats32
    y: Floats32
    facing_x: NDArray[np.int8]
    facing_y: NDArray[np.int8]
    around: NDArray[np.uint16]


def no_points(shape: tuple[int, int]) -> MeasuredPoints:
    """The points of a map (rows, cols) that nothing was measured in."""
    number, x, y = (np.zeros(shape, np.float32) for _ in range(3))
    facing_x, facing_y = (np.zeros(shape, np.int8) for _ in range(2))
    return MeasuredPoints(number, x, y, facing_x, facing_y, np.zeros(shape, np.uint16))


@njit(cache=True, nogil=True)
def add_point(points: MeasuredPoints, x: float, y: float) -> None:
    """Move the mean of the cell that a point lies in, which is not on the border."""
    row, col = int(y), int(x)
    if points.number[row, col] == 0.0:
        # Seen from the cell at the k-th bit, this one is on the opposite side of the middle.
        for k in range(9):
            points.around[row + _ROW[k], col + _COL[k]] |= np.uint16(1 << (8 - k))
    number = min(points.number[row, col] + 1.0, MOST)
    points.x[row, col] += (x - points.x[row, col]) / number
    points.y[row, col] += (y - points.y[row, col]) / number
    points.number[row, col] = number


@njit(cache=True, nogil=True)
def add_points(
    points: MeasuredPoints, x: float, y: float, heading: float, unit_x: Floats, unit_y: Floats, ranges: Floats
) -> None:
    """Move the means of the cells that the beams end in; beams that met nothing or failed end nowhere."""
    rows, cols = points.number.shape
    cos, sin = math.cos(heading), math.sin(heading)
    for i in range(ranges.size):
        if not math.isfinite(ranges[i]):
            continue
        beam_x, beam_y = unit_x[i] * cos - unit_y[i] * sin, unit_x[i] * sin + unit_y[i] * cos
        end_x, end_y = x + ranges[i] * beam_x, y + ranges[i] * beam_y
        # The cells on the border have no cells around them to make a line.
        if not (1.0 <= end_x < cols - 1 and 1.0 <= end_y < rows - 1):
            continue
        row, col = int(end_y), int(end_x)
        if is_turned_away(points, row, col, beam_x, beam_y):
            continue
        # A wall's surface lies on the border of two cells as often as inside one: the point counts for
        # the cell that it lies in, and the search looks at the cells around.
        add_point(points, end_x, end_y)
        is_line, _, _, normal_x, normal_y = wall_line(points, row, col, beam_x, beam_y)
        if is_line:
            towards = -100.0 if normal_x * beam_x + normal_y * beam_y > 0.0 else 100.0
            points.facing_x[row, col] = round(towards * normal_x)
            points.facing_y[row, col] = round(towards * normal_y)


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
    # a cell away. Of equally near ones it is the first, row by row: bits are taken from the lowest on.
    row, col = int(y), int(x)
    least, nearest_row, nearest_col = np.inf, row, col
    left = np.int64(points.around[row, col])
    while left:
        r, c = row + _ROW[_LOWEST[left]], col + _COL[_LOWEST[left]]
        left &= left - 1
        dx, dy = points.x[r, c] - x, points.y[r, c] - y
        away = dx * dx + dy * dy
        if away < least:
            least, nearest_row, nearest_col = away, r, c
    return least, nearest_row, nearest_col


@njit(cache=True, nogil=True)
def cells_met(points: MeasuredPoints, row: int, col: int, beam_x: float, beam_y: float) -> int:
    """Which of the 3 x 3 cells around one have points that a beam can have met, as bits row by row."""
    met = left = np.int64(points.around[row, col])
    while left:
        r, c = row + _ROW[_LOWEST[left]], col + _COL[_LOWEST[left]]
        if is_turned_away(points, r, c, beam_x, beam_y):
            met ^= left & -left
        left &= left - 1
    return int(met)


@njit(cache=True, nogil=True)
def wall_line(
    points: MeasuredPoints, row: int, col: int, beam_x: float, beam_y: float
) -> tuple[bool, float, float, float, float]:
    """The line through the means around one of a cell that is not on the border, which a beam can have met.

    Returns:
        Whether they make one; a point of it (x, y); its normal (x, y), of length 1.
    """
    return line_through(points, row, col, cells_met(points, row, col, beam_x, beam_y))


@njit(cache=True, nogil=True)
def line_through(
    points: MeasuredPoints, row: int, col: int, cells: int
) -> tuple[bool, float, float, float, float]:
    """As `wall_line`, through the means of some of the 3 x 3 cells around one, given as bits row by row."""
    count, sum_x, sum_y, sum_xx, sum_xy, sum_yy = 0, 0.0, 0.0, 0.0, 0.0, 0.0
    left = np.int64(cells)
    while left:
        r, c = row + _ROW[_LOWEST[left]], col + _COL[_LOWEST[left]]
        left &= left - 1
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
