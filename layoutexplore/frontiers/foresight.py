"""Foresight: what is expected of space that no scan has reached yet, in the frame of the robot's grid.

A predictor that knows more than the map tells (a plan on the wall, the truth in a study) hangs it on a
`Decision`; whoever plans ways through unseen rooms reads it there. What the robot has seen always wins.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np
from numba import njit

from layoutexplore.errors import MapError
from layoutexplore.frontiers.detection import FrontierClusters
from layoutexplore.grids.arrays import Cells, Floats, Ints, Ints32, Mask, shows_shapes
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN
from layoutexplore.options import POSITIVE, SHARE, check, check_kind


@shows_shapes
@dataclass(frozen=True, eq=False, kw_only=True)
class Foresight:
    """Space that is foreseen at a decision; arrays are shared, so nobody writes into them.

    Attributes:
        cells: int8 (rows, cols), the shape and frame of the decision's grid: 0 foreseen free, 100 foreseen
            wall, -1 nothing foreseen. It may repeat or contradict what is known: see `completed`.
        room_ids: int32 (rows, cols), the foreseen room of each cell, 0 for none; seen rooms may have ids too.
        confidence: Probability 0..1 that space is as it is foreseen. Who foresees decides from where on it is
            worth telling; planners may ask for more.
        predictor: Name of the predictor that it came from.
        resolution: Side of a cell in metres.

    Raises:
        MapError: The arrays have different shapes or other kinds of numbers, a cell has another value, or a
            room an id below 0.
        ConfigError: The confidence lies outside 0..1, or the resolution is not above 0.

    Example:
        A room of two cells is foreseen behind a door; the door's cell is known to be shut:

        >>> cells = np.array([[100, 100, 100, 100], [0, 0, 0, 0]], np.int8)
        >>> rooms = np.array([[0, 0, 0, 0], [0, 0, 7, 7]], np.int32)
        >>> foresight = Foresight(cells=cells, room_ids=rooms, confidence=0.9, predictor="x", resolution=0.5)
        >>> known = np.array([[-1, 100, -1, -1], [0, 100, -1, -1]], np.int8)
        >>> foresight.completed(known).tolist()
        [[100, 100, 100, 100], [0, 100, 0, 0]]
        >>> foresight.areas.tolist()[7], int(foresight.hidden(known).sum())
        (0.5, 2)
    """

    cells: Cells
    room_ids: Ints32
    confidence: float
    predictor: str
    resolution: float

    def __post_init__(self) -> None:
        check_kind("cells", self.cells, np.ndarray)
        check_kind("room_ids", self.room_ids, np.ndarray)
        check_kind("predictor", self.predictor, str)
        if self.cells.dtype != np.int8 or self.room_ids.dtype != np.int32:
            raise MapError(
                f"foresight of {self.predictor!r} needs int8 cells and int32 room ids, "
                f"got {self.cells.dtype} and {self.room_ids.dtype}"
            )
        if self.cells.ndim != 2 or self.cells.shape != self.room_ids.shape:
            raise MapError(
                f"foresight of {self.predictor!r}: cells {self.cells.shape} and room ids "
                f"{self.room_ids.shape} must be one two-dimensional shape"
            )
        if self.room_ids.min(initial=0) < 0:
            raise MapError(
                f"foresight of {self.predictor!r}: rooms count from 1, and 0 is none: "
                f"got the id {self.room_ids.min()}"
            )
        said = np.equal(self.cells, FREE) | np.equal(self.cells, OCCUPIED) | np.equal(self.cells, UNKNOWN)
        if not said.all():
            raise MapError(
                f"foresight of {self.predictor!r}: cells are {FREE} (free), {OCCUPIED} (wall) or {UNKNOWN} "
                f"(nothing foreseen), got {self.cells[~said][0]}"
            )
        check(self, f"foresight of {self.predictor!r}: ", confidence=SHARE, resolution=POSITIVE)

    @cached_property
    def areas(self) -> Floats:
        """float64 (highest id + 1,): foreseen free square metres of each room; entry 0 lies in no room."""
        counts = np.bincount(
            self.room_ids[self.cells == FREE], minlength=int(self.room_ids.max(initial=0)) + 1
        )
        return np.asarray(counts * self.resolution**2, np.float64)

    def completed(self, known: Cells) -> Cells:
        """int8 (rows, cols): what is known (int8, same shape), and where that is unknown what is foreseen."""
        return np.where(known == UNKNOWN, self.cells, known)

    def within(self, metres: float, known: Cells) -> Foresight:
        """What is foreseen less than so many metres from floor that is known (int8, same shape)."""
        if metres > math.hypot(*known.shape) * self.resolution:
            return self
        unseen = np.not_equal(known, FREE).view(np.uint8)
        near = cv2.distanceTransform(unseen, cv2.DIST_L2, cv2.DIST_MASK_5) * self.resolution < metres
        cells = np.where(near, self.cells, np.int8(UNKNOWN))
        return dataclasses.replace(self, cells=cells, room_ids=np.where(near, self.room_ids, np.int32(0)))

    def hidden(self, known: Cells) -> Mask:
        """Bool (rows, cols): cells that are foreseen free and not known yet."""
        return np.equal(known, UNKNOWN) & np.equal(self.cells, FREE)

    def contradicted(self, known: Cells) -> Mask:
        """Bool (rows, cols): cells known to be otherwise than foreseen."""
        shut = np.equal(self.cells, FREE) & np.equal(known, OCCUPIED)
        return shut | (np.equal(self.cells, OCCUPIED) & np.equal(known, FREE))

    def beside(self, known: Cells, clusters: FrontierClusters) -> Beside:
        """What is foreseen beside frontiers, where they border on unknown cells.

        Args:
            known: int8 (rows, cols), what is known.
            clusters: The cells of k frontiers.
        """
        return Beside(*_shares_beside(known, self.cells, clusters.cells, clusters.offsets))


TOLD = 0.3
"""Share of a frontier's cells beside which floor is foreseen, from which on it is told what is behind."""


class Beside(NamedTuple):
    """Shares of the cells of frontiers; where neither is foreseen beside a cell, a wall is.

    Attributes:
        floor: float64 (k,), of each frontier the share of cells beside which unseen floor is foreseen.
        nothing: float64 (k,), the share of those beside which nothing is.
    """

    floor: Floats
    nothing: Floats

    @property
    def is_told(self) -> Mask:
        """Bool (k,): whether foresight tells what is behind each frontier: floor, not a wall or nothing."""
        told: Mask = self.floor >= TOLD
        return told


@njit(cache=True, nogil=True)
def _shares_beside(known: Cells, foreseen: Cells, members: Ints32, offsets: Ints) -> Floats:
    """float64 (2, k): shares of the cells of each frontier beside which floor, and nothing, is foreseen."""
    shares = np.zeros((2, len(offsets) - 1))
    for k in range(len(offsets) - 1):
        for n in range(offsets[k], offsets[k + 1]):
            floor = nothing = False
            for step in range(4):
                r = members[n, 0] + (step == 0) - (step == 1)
                c = members[n, 1] + (step == 2) - (step == 3)
                if 0 <= r < known.shape[0] and 0 <= c < known.shape[1] and known[r, c] == UNKNOWN:
                    floor |= foreseen[r, c] == FREE
                    nothing |= foreseen[r, c] == UNKNOWN
            shares[0, k] += floor
            shares[1, k] += nothing
        shares[:, k] /= max(1, offsets[k + 1] - offsets[k])
    return shares
