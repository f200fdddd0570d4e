"""The seen parts of rooms by any layout method, for predictors that complete and classify them."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from layoutexplore.grids.arrays import Ints32
from layoutexplore.grids.boxes import known_box
from layoutexplore.grids.components import label_components
from layoutexplore.grids.flood import grow_labels
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, Pose
from layoutexplore.layout.doorways import Regions
from layoutexplore.layout.frame import to_world
from layoutexplore.layout.pipeline import LayoutCache
from layoutexplore.layout.types import Layout
from layoutexplore.predictors.region_tracker import RegionTracker

MARGIN = 1.5
"""Metres around what is known that a method is shown: the grid's own size would tell the building's."""

DOORWAYS = "doorways"
"""The method with whose regions the models that ship have learnt."""


class SeenRegions:
    """Divides the known free space into the seen parts of rooms, as a layout method sees them.

    Args:
        method: A method of `layoutexplore.layout.pipeline.reconstruct`, with its default options.

    Raises:
        UnknownNameError: No such method.
    """

    def __init__(self, method: str = DOORWAYS) -> None:
        self._layouts, self._tracker = LayoutCache(method, exact=True), RegionTracker()

    def __call__(self, grid: OccupancyGrid) -> Regions:
        """Every free cell in one region; doors are of `doorways`. Arrays change with the next call."""
        doorways = self._tracker(grid.cells, grid.resolution)
        if self._layouts.method.name == DOORWAYS:
            return doorways
        free = grid.free
        labels = grow_labels(labels_on_grid(self._layouts(grid, lambda: known_part(grid)), grid), free)
        # What no room reaches becomes regions of its own.
        count = int(labels.max(initial=0))
        count += label_components(free & (labels == 0), labels, count)[1]
        return Regions(labels, count, doorways.gaps, grid.resolution)


def known_part(grid: OccupancyGrid, *, walls: bool = False) -> OccupancyGrid:
    """What is known of a grid, in the same world, with a margin around it that is unknown beyond the grid.

    Args:
        grid: The grid.
        walls: Only the part around occupied cells; it stays the same while these do.
    """
    known = np.where(grid.cells == OCCUPIED, grid.cells, UNKNOWN) if walls else grid.cells
    margin = round(MARGIN / grid.resolution)
    row0, row1, col0, col1 = known_box(known)
    top, left = row0 - margin, col0 - margin
    shape = row1 - row0 + 2 * margin, col1 - col0 + 2 * margin
    ((x, y),) = to_world(np.array([[left, top]]) * grid.resolution, grid.origin).tolist()
    cells = _moved(grid.cells, (-top, -left), shape, UNKNOWN)
    return OccupancyGrid(cells, grid.resolution, Pose(x, y, grid.origin.theta))


def labels_on_grid(layout: Layout, grid: OccupancyGrid) -> Ints32:
    """The rooms that a layout gives the free cells of a grid, int32 (rows, cols), 0 for none."""
    return np.where(grid.cells == FREE, placed(layout.labels, layout.clean_grid, grid), np.int32(0))


def placed(labels: Ints32, frame: OccupancyGrid, grid: OccupancyGrid) -> Ints32:
    """Labels on the cells of another grid, 0 where there are none.

    Args:
        labels: int32, of the shape of `frame`.
        frame: Where they lie: a grid of the same resolution, moved by whole cells.
        grid: Where they are wanted.
    """
    row, col = (int(at) for at in grid.world_to_cells(frame.cells_to_world([[0, 0]]))[0])
    return _moved(labels, (row, col), grid.shape, 0)


T = TypeVar("T", np.int8, np.int32)


def _moved(values: NDArray[T], at: tuple[int, int], shape: tuple[int, int], other: int) -> NDArray[T]:
    """Values at a place in an array of that shape, which has another value elsewhere."""
    out = np.full(shape, other, values.dtype)
    there, here = [], []
    for begin, size, most in zip(at, values.shape, shape, strict=True):
        there.append(slice(max(begin, 0), max(min(begin + size, most), 0)))
        here.append(slice(max(-begin, 0), max(min(size, most - begin), 0)))
    out[tuple(there)] = values[tuple(here)]
    return out
