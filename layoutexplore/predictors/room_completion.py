"""Seen regions and the shapes they are thought to have, made into a map of rooms.

A shape is a mask over a window of the grid. Unknown cells of a region's shape become part of the room where a
flood from the region's own free cells reaches them: not through walls, and not through cells of other
regions. A cell that several rooms claim goes to the one that reaches it first. Nothing that is seen is ever
taken from a room.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numba import njit

from layoutexplore.grids.arrays import Cells, Ints, Ints32, Mask
from layoutexplore.grids.grid import OCCUPIED, UNKNOWN
from layoutexplore.grids.morphology import with_neighbours
from layoutexplore.layout.doorways import Regions
from layoutexplore.predictors.protocol import RoomLabels


@dataclass(frozen=True, eq=False)
class Shape:
    """Where a room is thought to reach.

    Attributes:
        row: First row of the window.
        col: First column of the window.
        mask: bool (rows, cols) of the window.
    """

    row: int
    col: int
    mask: Mask


def complete_regions(cells: Cells, regions: Regions, shapes: Mapping[int, Shape]) -> RoomLabels:
    """The rooms that regions and their shapes make.

    What no room claims is one more room of its own, the unseen rest of the building; between it and what is
    claimed there are walls, a cell thick.

    Args:
        cells: int8 (rows, cols), what is known.
        regions: The seen rooms.
        shapes: By region; a region without one is left as it is seen.
    """
    starts = np.zeros(regions.count + 2, np.int64)
    windows = np.zeros((regions.count + 1, 4), np.int64)
    flat = []
    for region in range(1, regions.count + 1):
        shape = shapes.get(region)
        if shape is not None and shape.mask.size:
            windows[region] = shape.row, shape.col, *shape.mask.shape
            flat.append(shape.mask.ravel())
        starts[region + 1] = starts[region] + windows[region, 2] * windows[region, 3]
    masks = np.concatenate(flat) if flat else np.zeros(0, np.bool_)
    rooms = _spread_shapes(cells, regions.labels.astype(np.int32), windows, masks, starts)
    return walled_rooms(cells, rooms, regions.count + 1)


def complete_within(cells: Cells, seen: Ints32, reach: Ints32, rest: int) -> RoomLabels:
    """The rooms that seen parts make with what they reach: `complete_regions` where no two shapes overlap.

    Args:
        cells: int8 (rows, cols), what is known.
        seen: int32 (rows, cols), the seen rooms, 0 for none.
        reach: int32 (rows, cols), the one room that may have a cell, 0 for none.
        rest: The id of the unseen rest of the building.
    """
    return walled_rooms(cells, _spread_within(cells, seen, reach), rest)


def walled_rooms(cells: Cells, rooms: Ints32, rest: int) -> RoomLabels:
    """Rooms with walls, a cell thick, between what they claim of the unknown and the unseen rest.

    Args:
        cells: int8 (rows, cols), what is known.
        rooms: int32 (rows, cols), the room of each cell, 0 for none; the rest is written into it.
        rest: The id of the unseen rest of the building: of unknown cells that no room claims.
    """
    unknown = cells == UNKNOWN
    claimed = unknown & (rooms > 0)
    wall = unknown & ~claimed & with_neighbours(claimed)
    rooms[unknown & (rooms == 0) & ~wall] = rest
    return RoomLabels(rooms, (cells != OCCUPIED) & ~wall, rest)


@njit(cache=True, nogil=True)
def _spread_shapes(cells: Cells, labels: Ints32, windows: Ints, masks: Mask, starts: Ints) -> Ints32:
    """Flood the unknown cells of all shapes at once, each from its region: labels int32 (rows, cols)."""
    # Not `grids.flood.spread_in_place`: which cells are open differs from label to label.
    rows, cols = cells.shape
    out = labels.copy()
    queue = np.empty((rows * cols, 2), np.int32)
    last = 0
    for r in range(rows):
        for c in range(cols):
            label = labels[r, c]
            # A region without a shape has a window of no rows. Only cells beside the unknown begin.
            if label and windows[label, 2]:
                for step in range(4):
                    row, col = r + (step == 0) - (step == 1), c + (step == 2) - (step == 3)
                    if 0 <= row < rows and 0 <= col < cols and cells[row, col] == UNKNOWN:
                        queue[last] = r, c
                        last += 1
                        break
    first = 0
    while first < last:
        r, c = queue[first]
        first += 1
        label = out[r, c]  # the first to come has the cell: the queue goes in rings of all regions at once
        for step in range(4):
            row, col = r + (step == 0) - (step == 1), c + (step == 2) - (step == 3)
            if not (0 <= row < rows and 0 <= col < cols) or cells[row, col] != UNKNOWN or out[row, col]:
                continue
            i, j = row - windows[label, 0], col - windows[label, 1]
            if (
                0 <= i < windows[label, 2]
                and 0 <= j < windows[label, 3]
                and masks[starts[label] + i * windows[label, 3] + j]
            ):
                out[row, col] = label
                queue[last] = row, col
                last += 1
    return out


@njit(cache=True, nogil=True)
def _spread_within(cells: Cells, labels: Ints32, reach: Ints32) -> Ints32:
    """Labels int32 (rows, cols), and unknown cells reached from them through those of the same reach."""
    # Not `grids.flood.spread_in_place`: which cells are open differs from label to label. No two labels may
    # have one cell, so the order in which they spread does not matter.
    rows, cols = cells.shape
    out = labels.copy()
    stack = np.empty((rows * cols, 2), np.int32)
    for r in range(rows):
        for c in range(cols):
            label = reach[r, c]
            if label == 0 or cells[r, c] != UNKNOWN or out[r, c]:
                continue
            # an unknown cell beside one of its room, seen or reached: all that is reached from it follows
            if not (
                (r > 0 and out[r - 1, c] == label)
                or (c > 0 and out[r, c - 1] == label)
                or (c + 1 < cols and out[r, c + 1] == label)
                or (r + 1 < rows and out[r + 1, c] == label)
            ):
                continue
            out[r, c] = label
            stack[0, 0], stack[0, 1] = r, c
            count = 1
            while count:
                count -= 1
                row0, col0 = stack[count, 0], stack[count, 1]
                for step in range(4):
                    row, col = row0 + (step == 0) - (step == 1), col0 + (step == 2) - (step == 3)
                    if not (0 <= row < rows and 0 <= col < cols) or cells[row, col] != UNKNOWN:
                        continue
                    if out[row, col] == 0 and reach[row, col] == label:
                        out[row, col] = label
                        stack[count, 0], stack[count, 1] = row, col
                        count += 1
    return out
