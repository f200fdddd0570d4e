"""What the robot knows as images for a network: a close view that turns with it, and the whole map.

Both are uint8, channel first, 0 or 255 where a pixel is one cell and a share in between where it holds
several.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeVar

import numpy as np
from numba import njit

from layoutexplore.errors import checks_making
from layoutexplore.frontiers.decision import Decision
from layoutexplore.grids.arrays import Bytes, Cells, Floats, Ints, Ints32, Mask
from layoutexplore.grids.boxes import known_box
from layoutexplore.grids.grid import UNKNOWN, OccupancyGrid, Pose
from layoutexplore.grids.morphology import borders_unknown

CHANNELS = ("free", "occupied", "frontier", "trail")
"""Free floor (share of the pixel), then 255 where a pixel holds an occupied, frontier or visited cell."""

LAYOUT_CHANNELS = ("predicted_room", "predicted_wall", "closed_room")
"""255 where a pixel holds unknown cells of a predicted room, of its outline, or of a room that is closed."""

Length = TypeVar("Length", float, Floats)
"""A number, or an array float64 (n,)."""

FRONTIER, TRAIL, ROOM, WALL, CLOSED = 1, 2, 4, 8, 16
"""Bits of a mark: the channels from "frontier" on, in this order."""

FIRST_MARK = 2
"""The first channel that is a mark."""


class _View(NamedTuple):
    """A square image of the surroundings; the robot is at (row, col) in cells, its heading up.

    A pixel is `pixel` cells wide and is sampled `samples` times along either axis.
    """

    row: float
    col: float
    cos: float
    sin: float
    pixel: float
    samples: int


class MapFrame(NamedTuple):
    """Where the image of the whole map lies.

    Attributes:
        row: Lowest row of the image, in cells (a fraction; may be negative).
        col: Lowest column.
        cells_per_pixel: Side of a pixel in cells, 1 or more.
    """

    row: float
    col: float
    cells_per_pixel: float


NOWHERE = MapFrame(0.0, 0.0, 1.0)
"""The frame of an image that is not drawn."""


def place_on(grid: OccupancyGrid, x: Length, y: Length) -> tuple[Length, Length]:
    """Where world points lie on a grid, which may be turned: (row, col) in cells, with fractions."""
    dx, dy = x - grid.origin.x, y - grid.origin.y
    if grid.origin.theta:
        c, s = math.cos(grid.origin.theta), math.sin(grid.origin.theta)
        dx, dy = c * dx + s * dy, c * dy - s * dx
    return dy / grid.resolution, dx / grid.resolution


@checks_making
class Trail:
    """Where the robot believes it has been, as a mark in each cell that it passed.

    Args:
        grid: The grid whose cells are marked.

    Attributes:
        marks: uint8 (rows, cols), `TRAIL` in the cells passed.
    """

    def __init__(self, grid: OccupancyGrid) -> None:
        self._grid = grid
        self.marks = np.zeros(grid.shape, np.uint8)

    def extend(self, track: Floats) -> None:
        """Mark the cells along believed poses float64 (n, 3), the first one of which is marked already."""
        _mark_lines(self.marks, *place_on(self._grid, track[:, 0], track[:, 1]))


def draw_local_map(
    grid: OccupancyGrid,
    marks: Bytes,
    pose: Pose,
    *,
    size: int,
    span: float,
    channels: int,
    detect: bool = False,
) -> Bytes:
    """A square around the robot, its heading up.

    Args:
        grid: What the robot knows.
        marks: uint8 (rows, cols), bits as above.
        pose: The middle of the image, and its upward direction.
        size: Side in pixels.
        span: Side in metres.
        channels: Number of channels: those of `CHANNELS`, then one for each further bit.
        detect: Take every free cell beside an unknown one as a frontier instead of the marked ones.

    Returns:
        uint8 (channels, size, size).
    """
    image = np.zeros((channels, size, size), np.uint8)
    pixel = span / size / grid.resolution
    row, col = place_on(grid, pose.x, pose.y)
    heading = pose.theta - grid.origin.theta
    samples = max(1, math.ceil(pixel - 1e-9))
    view = _View(row, col, math.cos(heading), math.sin(heading), pixel, samples)
    _draw_local(grid.cells, marks, view, detect, image)
    return image


def draw_global_map(
    grid: OccupancyGrid, marks: Bytes, *, size: int, min_span: float, channels: int
) -> tuple[Bytes, MapFrame]:
    """All that is known, the grid's north up: the square around the known cells; it tells nothing else.

    Args:
        grid: What the robot knows.
        marks: uint8 (rows, cols), bits as above.
        size: Side in pixels.
        min_span: Least side of the square in metres; it grows with the map.
        channels: Number of channels: those of `CHANNELS`, then one for each further bit.

    Returns:
        uint8 (channels, size, size), and where it lies.
    """
    image = np.zeros((channels, size, size), np.uint8)
    row0, row1, col0, col1 = known_box(grid.cells)
    span = max(row1 - row0, col1 - col0, min_span / grid.resolution, size)
    frame = MapFrame((row0 + row1 - span) / 2, (col0 + col1 - span) / 2, span / size)
    _draw_global(grid.cells, marks, frame.row, frame.col, 1.0 / frame.cells_per_pixel, image)
    return image, frame


@njit(cache=True, nogil=True)
def _mark_lines(marks: Bytes, rows: Floats, cols: Floats) -> None:
    """Mark the cells along straight lines from point to point (in cells), sampled every half cell."""
    for k in range(len(rows)):
        row, col = rows[max(0, k - 1)], cols[max(0, k - 1)]
        d_row, d_col = rows[k] - row, cols[k] - col
        samples = max(1, int(2 * np.hypot(d_row, d_col)))
        for n in range(1, samples + 1):
            # Rounded down: towards 0, a cell beyond the grid would count as one at its edge.
            r, c = math.floor(row + d_row * n / samples), math.floor(col + d_col * n / samples)
            if 0 <= r < marks.shape[0] and 0 <= c < marks.shape[1]:
                marks[r, c] |= TRAIL


@njit(cache=True, nogil=True)
def _draw_local(cells: Cells, marks: Bytes, view: _View, detect: bool, image: Bytes) -> None:
    """Sample each pixel; with `detect`, free cells beside an unknown one are frontiers."""
    row, col, cos, sin, pixel, samples = view
    rows, cols = cells.shape
    size = image.shape[1]
    step = pixel / samples
    # Samples lie in the middle of their step, half a step inside of the image's border.
    half = 0.5 * size * pixel - 0.5 * step
    free = np.zeros(size, np.int32)
    bits = np.zeros(size, np.int32)
    for i in range(size):
        free[:] = 0
        bits[:] = 0
        for k in range(i * samples, (i + 1) * samples):
            # A row of samples, left to right: the far end of the image, row 0, lies ahead of the robot.
            ahead = half - k * step
            y = row + ahead * sin + half * cos
            x = col + ahead * cos - half * sin
            for j in range(size):
                for _ in range(samples):
                    # Outside of the grid everything is unknown: such samples count in the share as not free.
                    if 0.0 <= y < rows and 0.0 <= x < cols:
                        r, c = int(y), int(x)
                        value = cells[r, c]
                        bits[j] |= marks[r, c]
                        if value == 0:
                            free[j] += 1
                            if detect and borders_unknown(cells, r, c):
                                bits[j] |= FRONTIER
                        elif value == 100:
                            image[1, i, j] = 255
                    y -= step * cos
                    x += step * sin
        for j in range(size):
            image[0, i, j] = (255 * free[j]) // (samples * samples)
            _show_marks(image, i, j, bits[j])


@njit(cache=True, nogil=True)
def _draw_global(
    cells: Cells, marks: Bytes, low_row: float, low_col: float, pixels_per_cell: float, image: Bytes
) -> None:
    """Gather cells and marks into the pixels that hold their centres."""
    size = image.shape[1]
    rows = _borders(low_row, pixels_per_cell, size, cells.shape[0])
    cols = _borders(low_col, pixels_per_cell, size, cells.shape[1])
    first, width = cols[0], cols[size] - cols[0]
    free_below = np.empty(width, np.uint16)
    value_below = np.empty(width, np.int8)
    bits_below = np.empty(width, np.uint8)
    # First down the columns of a band of cells, as they lie in memory, then along the band. Row 0 of the
    # image is the highest band. Occupied (100) is the greatest value: a pixel's greatest tells of any.
    for i in range(size):
        free_below[:] = 0
        value_below[:] = 0
        bits_below[:] = 0
        height = rows[size - i] - rows[size - 1 - i]
        for r in range(rows[size - 1 - i], rows[size - i]):
            values, bits = cells[r, first : first + width], marks[r, first : first + width]
            for c in range(width):
                free_below[c] += np.uint16(values[c] == 0)
                value_below[c] = max(value_below[c], values[c])
                bits_below[c] |= bits[c]
        for j in range(size):
            free, highest, bit = 0, 0, 0
            for c in range(cols[j] - first, cols[j + 1] - first):
                free += free_below[c]
                highest = max(highest, value_below[c])
                bit |= bits_below[c]
            if free:
                image[0, i, j] = (255 * free) // (height * (cols[j + 1] - cols[j]))
            if highest == 100:
                image[1, i, j] = 255
            _show_marks(image, i, j, bit)


@njit(cache=True, nogil=True, inline="always")
def _show_marks(image: Bytes, i: int, j: int, bits: int) -> None:
    """Show the bits of marks in a pixel, each in its channel; bits without one are of nothing shown."""
    if bits:
        for channel in range(FIRST_MARK, image.shape[0]):
            if bits & (1 << (channel - FIRST_MARK)):
                image[channel, i, j] = 255


@njit(cache=True, nogil=True)
def _borders(low: float, pixels_per_cell: float, size: int, count: int) -> Ints:
    """int64 (size + 1,): the first cell of `count` whose centre lies in each pixel or beyond, on one axis."""
    borders = np.empty(size + 1, np.int64)
    for k in range(size + 1):
        borders[k] = min(max(0, int(np.ceil(low + k / pixels_per_cell - 0.5))), count)
    return borders


def layout_marks(decision: Decision, rooms: str = "sketched") -> Bytes:
    """What the layout predicts of the cells that are not known, as bits uint8 (rows, cols).

    Args:
        decision: A decision with predicted rooms.
        rooms: "sketched" or "completed" (see `ObservationConfig`).
    """
    predicted = decision.rooms
    assert predicted is not None
    # Rooms of a predictor of one's own may know no sketch.
    sketched = rooms == "sketched" and hasattr(predicted, "sketch")
    labels = predicted.sketch if sketched else predicted.labels
    closed = np.zeros(int(labels.max(initial=0)) + 1, np.bool_)
    for frontier in decision.frontiers:
        if frontier.is_closed and frontier.room is not None and 0 < frontier.room < len(closed):
            closed[frontier.room] = True
    marks = np.zeros(labels.shape, np.uint8)
    _mark_rooms(decision.grid.cells, labels, closed, marks)
    return marks


@njit(cache=True, nogil=True)
def _mark_rooms(cells: Cells, labels: Ints32, closed: Mask, marks: Bytes) -> None:
    """Mark unknown cells of rooms, of closed rooms, and those whose room ends towards the next row or column.

    The outline lies on the cell of the lower row or column, whichever side of it is a room.
    """
    rows, cols = cells.shape
    for r in range(rows):
        for c in range(cols):
            if cells[r, c] != UNKNOWN:
                continue
            label, bits = labels[r, c], 0
            if label > 0:
                bits = ROOM | (CLOSED if closed[label] else 0)
            if (r + 1 < rows and labels[r + 1, c] != label) or (c + 1 < cols and labels[r, c + 1] != label):
                bits |= WALL
            marks[r, c] = bits
