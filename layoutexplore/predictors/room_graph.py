"""Rooms of a true floor plan and the doors between them: how many doors lie between a robot and a room.

Cells that belong to no room are the gaps of doors where they are few, and a passage, which counts as a room,
where they are many. Rooms that touch without a gap have an opening between them, which counts as a door.
"""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit

from layoutexplore.errors import checks_making
from layoutexplore.frontiers.classes import ENTRANCE_SHARE
from layoutexplore.grids.arrays import Cells, Floats, Ints, Ints32, Mask
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, Cell
from layoutexplore.grids.morphology import with_neighbours
from layoutexplore.maps.raster import PlanRaster

PASSAGE_AREA = 4.0
"""Square metres from which connected floor without a room is a passage, and no gap of a door."""


@checks_making
class RoomGraph:
    """Rooms, passages and gaps of doors of a floor plan, and which of them touch.

    Args:
        raster: The floor plan.

    Attributes:
        parts: int32 (rows, cols), the part that each cell belongs to, 0 for what is solid.
        is_gap: bool (parts + 1,), gaps of doors; entry 0 is none.
        touching: int64 (k, 2), pairs of parts that share an edge of a cell, each pair once.
    """

    def __init__(self, raster: PlanRaster) -> None:
        rooms = np.where(raster.free, raster.room_ids, 0)
        between = (raster.free & (rooms == 0)).astype(np.uint8)
        _, pieces = cv2.connectedComponents(between, connectivity=4, ltype=cv2.CV_32S)
        highest = int(rooms.max())
        self.parts = np.where(pieces > 0, pieces + highest, rooms).astype(np.int32)
        self._sizes = np.bincount(self.parts.ravel(), minlength=highest + int(pieces.max()) + 1)
        self.is_gap: Mask = np.arange(len(self._sizes)) > highest
        self.is_gap &= self._sizes * raster.resolution**2 < PASSAGE_AREA
        self.touching = _touching(self.parts)

    def doors_to(self, known: Cells, here: Cell) -> Floats:
        """Doors between what has been seen and each part.

        Args:
            known: int8 (rows, cols), what the robot knows.
            here: Where it stands: that part is seen.

        Returns:
            float64 (parts + 1,): 0 for parts that have been looked into; a gap is as far as the nearer room
            that it belongs to; inf for what is solid or not connected.
        """
        seen = np.bincount(self.parts[known == FREE], minlength=len(self._sizes))
        doors = np.full(len(self._sizes), np.inf)
        doors[(seen >= ENTRANCE_SHARE * self._sizes) & (seen > 0) & ~self.is_gap] = 0.0
        doors[self.parts[here]] = 0.0
        doors[0] = np.inf
        _spread(doors, self.is_gap, self.touching)
        return doors


def cells_ahead(parts: Ints32, foreseen: Mask) -> Cells:
    """Free and solid cells of the foreseen parts, as a `Foresight` has them.

    Args:
        parts: int32 (rows, cols), as a `RoomGraph` has them.
        foreseen: bool (parts + 1,), which of them are foreseen.

    Returns:
        int8 (rows, cols): 0 in a foreseen part, 100 in what is solid and touches one, -1 elsewhere.
    """
    free = foreseen[parts]
    cells = np.where(with_neighbours(free) & (parts == 0), OCCUPIED, UNKNOWN)
    cells[free] = FREE
    return cells.astype(np.int8)


def _touching(parts: Ints32) -> Ints:
    """Pairs int64 (k, 2) of parts that share an edge of a cell."""
    pairs = []
    for a, b in ((parts[:, :-1], parts[:, 1:]), (parts[:-1], parts[1:])):
        border = (a != b) & (a > 0) & (b > 0)
        pairs.append(np.sort(np.stack([a[border], b[border]], axis=1), axis=1))
    return np.unique(np.concatenate(pairs).astype(np.int64), axis=0)


@njit(cache=True, nogil=True)
def _spread(doors: Floats, is_gap: Mask, touching: Ints) -> None:
    """Lower every entry to what its neighbours allow: into a gap costs nothing, into anything else a door."""
    changed = True
    while changed:
        changed = False
        for k in range(len(touching)):
            a, b = touching[k]
            for _ in range(2):
                reached = doors[a] + (0.0 if is_gap[b] else 1.0)
                if reached < doors[b]:
                    doors[b] = reached
                    changed = True
                a, b = b, a
