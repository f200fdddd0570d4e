"""The seen rooms of a grid that changes, at the cost of what changed where they depend on little around them.

Doors depend on what lies within some metres of them, and cores on what is within half a metre of walls and
doors. Both are kept, and found anew only around the cells that differ from those of the last call, whatever
grid that was of; rooms then grow back from the cores around these, as they do all over the grid in
`layoutexplore.layout.doorways`, with the same result.
"""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Cells
from layoutexplore.grids.boxes import Box, grown_box
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN
from layoutexplore.grids.morphology import disc
from layoutexplore.layout.doorways import SHIPPED, Regions, find_doors, gap_type
from layoutexplore.layout.grown_components import SEED, GrownComponents
from layoutexplore.processes.threads import ByThread

_REACH = 2.0 * SHIPPED.door_max + SHIPPED.widening
"""Metres: a cell farther away than this has no say in whether a cell is of a door."""


class RegionTracker(ByThread):
    """Divides the known free space of one grid after the other into the seen parts of rooms.

    Example:
        >>> cells = np.full((20, 20), -1, np.int8)
        >>> tracker = RegionTracker()
        >>> tracker(cells, 0.1).count
        0
        >>> cells[3:17, 3:17] = 0
        >>> tracker(cells, 0.1).count
        1
    """

    def __init__(self) -> None:
        self._resolution = 0.0
        # As they were given, but for the free cells of cores: `SEED`.
        self._cells = np.empty((0, 0), np.int8)

    def __call__(self, cells: Cells, resolution: float) -> Regions:
        """The same as `doorway_regions`; its arrays are views that change with the next call.

        Args:
            cells: int8 (rows, cols), -1 unknown, 0 free, 100 occupied.
            resolution: Metres per cell.
        """
        if cells.shape != self._cells.shape or resolution != self._resolution:
            self._begin((cells.shape[0], cells.shape[1]), resolution)
        box = take_changes(np.ascontiguousarray(cells), self._cells)
        if box[0] < box[1]:
            self._find_doors(grown_box(box, self._reach, cells.shape))
            box = grown_box(box, self._reach + self._core_cells, cells.shape)
            self._find_cores(box)
            self._rooms.update(self._cells, box)
        return Regions(self._rooms.labels, self._rooms.count, self._gaps, resolution)

    def _begin(self, shape: tuple[int, int], resolution: float) -> None:
        self._resolution = resolution
        self._reach = round(_REACH / resolution) + 2
        self._core_cells = disc(SHIPPED.core / resolution, closed=True).shape[0] // 2
        self._cells = np.full(shape, UNKNOWN, np.int8)
        self._gaps = np.zeros(shape, gap_type(resolution))
        self._rooms = GrownComponents(shape)

    def _find_doors(self, box: Box) -> None:
        """Find the doors in a box anew, from what lies in it and around it."""
        # Beyond the grid all is unknown: gaps at its edge widen as they do inside.
        margin = self._reach
        seen = grown_box(box, margin, self._cells.shape)
        occupied = np.zeros((box[1] - box[0] + 2 * margin, box[3] - box[2] + 2 * margin), np.bool_)
        part = self._cells[seen[0] : seen[1], seen[2] : seen[3]] == OCCUPIED
        top, left = margin + seen[0] - box[0], margin + seen[2] - box[2]
        occupied[top : top + part.shape[0], left : left + part.shape[1]] = part
        doors = find_doors(occupied, self._resolution)
        self._gaps[box[0] : box[1], box[2] : box[3]] = doors[margin:-margin, margin:-margin]

    def _find_cores(self, box: Box) -> None:
        """Find the cores in a box anew: free cells away from walls and doors."""
        seen = grown_box(box, self._core_cells, self._cells.shape)
        around = slice(seen[0], seen[1]), slice(seen[2], seen[3])
        barred = (self._cells[around] == OCCUPIED) | (self._gaps[around] > 0)
        shut = cv2.dilate(barred.view(np.uint8), disc(SHIPPED.core / self._resolution, closed=True))
        inner = slice(box[0] - seen[0], box[1] - seen[0]), slice(box[2] - seen[2], box[3] - seen[2])
        here = self._cells[box[0] : box[1], box[2] : box[3]]
        free = (here == FREE) | (here == SEED)
        here[free] = np.where(shut[inner][free] == 0, np.int8(SEED), np.int8(FREE))


@njit(cache=True, nogil=True)
def take_changes(cells: Cells, kept: Cells) -> Box:
    """Make kept cells like others of the same shape; the half-open box around those that were not.

    Kept cells of `SEED` count as free, and stay where they are.
    """
    rows, cols = cells.shape
    row0, row1, col0, col1 = rows, 0, cols, 0
    # Most rows are as they were: eight cells are compared at once, from the word with a row's first cell to
    # the one with its last.
    words = cells.size // 8
    # Without its highest bit, `SEED` is the same as free, and no other cell is.
    value, values = np.int8(0x7F), np.uint64(0x7F7F7F7F7F7F7F7F)
    new, old = cells.ravel()[: 8 * words].view(np.uint64), kept.ravel()[: 8 * words].view(np.uint64)
    for r in range(rows):
        differs = np.uint64(0)
        for w in range(r * cols // 8, min(((r + 1) * cols + 7) // 8, words)):
            differs |= new[np.uint64(w)] ^ old[np.uint64(w)]
        # The last few cells of the grid may be in no word: their rows are looked at in any case.
        if differs & values == 0 and (r + 1) * cols <= 8 * words:
            continue
        for c in range(cols):
            if (cells[r, c] ^ kept[r, c]) & value:
                row0, row1, col0, col1 = min(row0, r), r + 1, min(col0, c), max(col1, c + 1)
                kept[r, c] = cells[r, c]
    return (row0, row1, col0, col1) if row0 < row1 else (0, 0, 0, 0)
