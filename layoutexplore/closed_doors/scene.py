"""A grid turned to the closed doors of one direction, and what is computed from it once for all of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from layoutexplore.grids.arrays import Cells, Floats, Ints, Ints32, Mask
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, in_cells
from layoutexplore.grids.runs import run_lengths

LARGEST = 20.0
"""Longest side of a room behind a closed door, in metres."""

APART = 0.25
"""Metres: lines of walls that lie nearer to each other are one."""

_ASTRAY = 0.05
"""Metres by which the faces of walls in line, and the thickness of walls, differ from map noise."""

_LINE, _RUN = 0.5, 0.4
"""Metres of wall in line that make a peak, and of straight wall around a cell that is a face."""

_THINNEST, _WALLS = 0.2, 5.0
"""Metres: the thinnest wall, and how much wall must be seen from both sides to tell their thickness."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A turned grid and what is computed from it once for all doors of a direction.

    Attributes:
        cells: int8 (rows, cols), rooms lie towards lower rows of their doors.
        resolution: Metres a cell.
        thickness: Thickness of the walls in cells.
        hull: Bool (rows, cols): the convex hull of what is known.
        leaves: Bool (rows, cols): the closed doors of all directions.
        mirrored: int8 (rows, cols): the mirror image of the plan, registered to it.
        likeness: How well the mirror image fits, and how much of it overlaps (`Mirror.score`,
            `Mirror.overlap`).
        possible: Bool (rows, cols): unknown and at least a wall's thickness away from everything known but
            the doors.
    """

    cells: Cells
    resolution: float
    thickness: int
    hull: Mask
    leaves: Mask
    mirrored: Cells
    likeness: tuple[float, float]
    possible: Mask

    def span(self, metres: float) -> int:
        """A length in cells, one at least."""
        return in_cells(metres, self.resolution)

    @cached_property
    def widths(self) -> tuple[Floats, Floats]:
        """Metres of free space seen in rows of each length, and in columns of each length (index: cells)."""
        return _run_lengths(self.cells, self.resolution), _run_lengths(self.cells.T, self.resolution)

    @cached_property
    def _face_layers(self) -> dict[str, Mask]:
        """Cells just inside walls that a side of a room may be in line with, by their direction."""
        free, occupied, t = self.cells == FREE, self.cells == OCCUPIED, self.thickness
        shape = self.cells.shape
        below, above, right, left = (np.zeros(shape, np.bool_) for _ in range(4))
        below[1:], above[:-1] = occupied[:-1] & free[1:], occupied[1:] & free[:-1]
        right[:, 1:], left[:, :-1] = occupied[:, :-1] & free[:, 1:], occupied[:, 1:] & free[:, :-1]
        known = self.cells != UNKNOWN
        outline = np.zeros(shape, np.bool_)
        outline[1:] = known[1:] & ~known[:-1]
        return {
            "far": below | _moved(above, t, 0),
            "start": right | _moved(left, 0, t),
            "stop": left | _moved(right, 0, -t),
            "outline": outline,
        }

    @cached_property
    def sums(self) -> dict[str, Ints32]:
        """Integral images of what the features count."""
        known = self.cells != UNKNOWN
        layers = {
            "known": known,
            "possible": self.possible,
            "hull": self.hull,
            "leaves": self.leaves,
            **self._face_layers,
            "mirror_free": self.mirrored == FREE,
            "mirror_wall": self.mirrored == OCCUPIED,
        }
        return {name: integral(layer) for name, layer in layers.items()}

    @cached_property
    def box(self) -> tuple[int, int, int, int]:
        """First and last known row, first and last known column."""
        rows, cols = np.nonzero(self.cells != UNKNOWN)
        return int(rows.min()), int(rows.max()), int(cols.min()), int(cols.max())

    @cached_property
    def faces(self) -> tuple[Ints, Ints, Ints, Ints]:
        """Cells of wall with their face on each column (free right, left) and row (free below, above)."""
        free, occupied = self.cells == FREE, self.cells == OCCUPIED
        run = 2 * self.span(_RUN / 2) + 1
        right = (occupied[:, :-1] & free[:, 1:] & _solid(occupied[:, :-1], (run, 1))).sum(0)
        left = (occupied[:, 1:] & free[:, :-1] & _solid(occupied[:, 1:], (run, 1))).sum(0)
        below = (occupied[:-1] & free[1:] & _solid(occupied[:-1], (1, run))).sum(1)
        above = (occupied[1:] & free[:-1] & _solid(occupied[1:], (1, run))).sum(1)
        return np.append(right, 0), np.insert(left, 0, 0), np.append(below, 0), np.insert(above, 0, 0)

    def count(self, name: str, box: Ints) -> Ints:
        """Cells of a layer in boxes int (n, 4): top, left, bottom, right (the last two not included)."""
        s = self.sums[name]
        top, bottom = np.clip(box[:, 0], 0, s.shape[0] - 1), np.clip(box[:, 2], 0, s.shape[0] - 1)
        left, right = np.clip(box[:, 1], 0, s.shape[1] - 1), np.clip(box[:, 3], 0, s.shape[1] - 1)
        return np.asarray(s[bottom, right] - s[top, right] - s[bottom, left] + s[top, left], np.int64)


def integral(mask: Mask) -> Ints32:
    """Integral image int32 (rows + 1, cols + 1) of a mask."""
    return np.asarray(cv2.integral(np.ascontiguousarray(mask, np.uint8), sdepth=cv2.CV_32S))


def room_space(cells: Cells, thickness: int) -> Mask:
    """Bool (rows, cols): unknown cells at least a wall's thickness away from everything known."""
    unknown = (cells == UNKNOWN).astype(np.uint8)
    size = 2 * max(thickness - 1, 0) + 1
    return np.asarray(cv2.erode(unknown, np.ones((size, size), np.uint8)) > 0)


def wall_thickness(cells: Cells, resolution: float) -> int:
    """Usual thickness of the walls in cells: that of most runs without a free cell between two free ones."""
    counts = np.zeros(round(0.8 / resolution) + 1, np.int64)
    for turned in (cells, cells.T):
        lengths = run_lengths(turned != FREE)
        lengths = lengths[lengths < len(counts)]
        counts += np.bincount(lengths, minlength=len(counts))
    thinnest = max(in_cells(_THINNEST, resolution), 2)
    counts[:thinnest] = 0
    if counts.sum() * resolution < _WALLS:
        return thinnest
    slope = np.arange(in_cells(_ASTRAY, resolution)) + 1
    near = np.concatenate([slope, [len(slope) + 1], slope[::-1]])
    return max(int(np.argmax(np.convolve(counts, near, "same"))), 2)


def in_line(support: Ints, resolution: float) -> Ints:
    """Length of the walls (in cells) on each line or as little beside it as walls are astray."""
    return np.asarray(np.convolve(support, np.ones(2 * in_cells(_ASTRAY, resolution) + 1, np.int64), "same"))


def peaks(support: Ints, resolution: float) -> Mask:
    """Where the walls in line are longest nearby (`APART`), and 0.5 m long at least."""
    smooth, near = in_line(support, resolution), 2 * in_cells(APART, resolution) + 1
    highest = cv2.dilate(smooth.astype(np.float32).reshape(1, -1), np.ones((1, near), np.uint8))[0]
    return np.asarray((smooth == highest) & (smooth >= in_cells(_LINE, resolution)))


def _solid(mask: Mask, size: tuple[int, int]) -> Mask:
    """Cells of a mask that belong to a straight run of the size of a kernel, small breaks forgiven."""
    share = cv2.blur(mask.astype(np.float32), (size[1], size[0]), borderType=cv2.BORDER_CONSTANT)
    return np.asarray(mask & (share >= 0.6))


def _run_lengths(cells: Cells, resolution: float) -> Floats:
    """Metres of free space in runs along rows, by their length in cells, smoothed by 0.1 m either way."""
    lengths = run_lengths(cells == FREE)
    most = round(LARGEST / resolution) + in_cells(0.15, resolution)
    counts = np.bincount(lengths[lengths < most], minlength=most) * resolution
    return np.asarray(np.convolve(counts, np.ones(2 * in_cells(0.1, resolution) + 1), "same"))


def _moved(mask: Mask, rows: int, cols: int) -> Mask:
    """A mask moved down and right, what leaves it lost."""
    out = np.zeros_like(mask)
    height, width = mask.shape
    out[max(rows, 0) : height + min(rows, 0), max(cols, 0) : width + min(cols, 0)] = mask[
        max(-rows, 0) : height + min(-rows, 0), max(-cols, 0) : width + min(-cols, 0)
    ]
    return out
