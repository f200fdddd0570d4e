"""The seen parts of rooms by any layout method, for predictors that complete and classify them."""

from __future__ import annotations

import numpy as np

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
        """Every free cell in one region; doors, a view that changes with the next call, are of `doorways`."""
        doorways = self._tracker(grid.cells, grid.resolution)
        if self._layouts.method.name == DOORWAYS:
            return doorways
        free = grid.free
        labels = grow_labels(labels_on_grid(self._layouts(known_part(grid)), grid), free)
        # What no room reaches becomes regions of its own.
        parts, _ = label_components(free & (labels == 0))
        labels = np.where(parts > 0, parts + labels.max(initial=0), labels).astype(np.int32)
        return Regions(labels, int(labels.max(initial=0)), doorways.door_width)


def known_part(grid: OccupancyGrid, *, walls: bool = False) -> OccupancyGrid:
    """What is known of a grid, in the same world, with a margin around it that is unknown beyond the grid.

    Args:
        grid: The grid.
        walls: Only the part around occupied cells; it stays the same while these do.
    """
    known = np.where(grid.cells == OCCUPIED, grid.cells, UNKNOWN) if walls else grid.cells
    margin = round(MARGIN / grid.resolution)
    row0, row1, col0, col1 = known_box(known)
    padded = np.pad(grid.cells, margin, constant_values=UNKNOWN)
    cells = np.ascontiguousarray(padded[row0 : row1 + 2 * margin, col0 : col1 + 2 * margin])
    corner = np.array([[col0 - margin, row0 - margin]]) * grid.resolution
    ((x, y),) = to_world(corner, grid.origin).tolist()
    return OccupancyGrid(cells, grid.resolution, Pose(x, y, grid.origin.theta))


def labels_on_grid(layout: Layout, grid: OccupancyGrid) -> Ints32:
    """The rooms that a layout gives the free cells of a grid, int32 (rows, cols), 0 for none."""
    labels = np.zeros(grid.shape, np.int32)
    rows, cols = np.nonzero(grid.cells == FREE)
    at = layout.clean_grid.world_to_cells(grid.cells_to_world(np.stack([rows, cols], axis=1)))
    inside = ((at >= 0) & (at < layout.labels.shape)).all(axis=1)
    labels[rows[inside], cols[inside]] = layout.labels[at[inside, 0], at[inside, 1]]
    return labels
