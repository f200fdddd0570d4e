"""The method `doorways`: with the doorways shut, the free space falls into cores, and these grow back.

A doorway is a short gap in a wall behind which the space widens on both sides. With the doorways shut, what
lies further than `core` from walls and doorways falls into cores (an erosion), and every free cell goes to
the core with the shortest path to it. Shadows do not matter: the distance is measured to walls alone, not to
what is unknown. So it holds on maps that grow, and the predictors that learn from explorations stand on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError, checks_arguments, checks_calls
from layoutexplore.grids.arrays import (
    ZERO,
    Cells,
    Floats,
    Floats32,
    Ints,
    Ints32,
    Labels,
    Mask,
    shows_shapes,
    small_labels,
)
from layoutexplore.grids.boxes import known_box
from layoutexplore.grids.components import label_components
from layoutexplore.grids.flood import spread_in_place
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, check_resolution
from layoutexplore.grids.morphology import dilate_by_disc
from layoutexplore.grids.runs import run_end
from layoutexplore.layout.canonical import in_canonical_orientation
from layoutexplore.layout.merging.door_gaps import GAP, LONGEST, DoorGapConfig, list_gaps
from layoutexplore.layout.outlines import layout_of_labels
from layoutexplore.layout.pipeline import register_method
from layoutexplore.layout.timing import StageTimer
from layoutexplore.layout.types import Layout, empty_layout, has_free_space


@checks_calls
@dataclass(frozen=True, kw_only=True)
class DoorwaysConfig(DoorGapConfig):
    """Options of the method; lengths in metres.

    Doors are narrower than those of merging, and walls step aside by one cell only.

    Attributes:
        core: Two regions are one where the passage between them is wider than twice this.
        room_area: Smallest room [m2]; what is smaller joins a room that it opens to, or is none. Predictors
            keep all regions: the rest of a hardly seen room may be large.
    """

    door_max: float = 2.2
    slack: float = 0.0
    core: float = 0.5
    room_area: float = 1.5

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.core <= LONGEST or self.room_area < 0:
            raise ConfigError(f"core must be above 0 and at most {LONGEST:g} m, and room_area at least 0")


Gaps: TypeAlias = NDArray[np.unsignedinteger[Any]]
"""Widths of gaps in cells."""

SHIPPED = DoorwaysConfig()
"""With these the models that ship have learnt."""


@shows_shapes
@dataclass(frozen=True, eq=False)
class Regions:
    """The seen parts of the rooms of a grid.

    Attributes:
        labels: (rows, cols), region of each known free cell, from 1; 0 elsewhere. int16 where the numbers
            fit, else int32.
        count: Number of regions.
        gaps: uint8, or wider where that is too small, (rows, cols): width in cells of the gap that may be a
            door and that a cell lies in, 0 elsewhere.
        resolution: Metres per cell.
    """

    labels: Labels
    count: int
    gaps: Gaps
    resolution: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "labels", small_labels(self.labels, self.count))

    @property
    def door_width(self) -> Floats32:
        """float32 (rows, cols), width in metres of the gap that a cell lies in, 0 elsewhere."""
        return np.asarray(self.gaps * np.float64(self.resolution), np.float32)

    @property
    def boxes(self) -> Ints:
        """int64 (count + 1, 5): number of cells, and their half-open box (row0, col0, row1, col1)."""
        return self._sums[0]

    @property
    def doors(self) -> Floats:
        """float64 (count + 1,): cells of doors in each region, each divided by its door's width in metres."""
        return self._sums[1]

    @cached_property
    def _sums(self) -> tuple[Ints, Floats]:
        return _sum_up(self.labels, self.gaps, self.count, self.resolution)


@checks_arguments
def doorway_regions(cells: Cells, resolution: float, config: DoorwaysConfig = SHIPPED) -> Regions:
    """Divide the known free space into the seen parts of rooms.

    Args:
        cells: int8 (rows, cols), -1 unknown, 0 free, 100 occupied.
        resolution: Metres per cell.
        config: The options.

    Raises:
        MapError: The cells are no occupancy grid, or the resolution is unusable.

    Example:
        >>> rows = ["#########", "#...#...#", "#.......#", "#...#...#", "#########"]
        >>> cells = np.array([[100 if c == "#" else 0 for c in row] for row in rows], np.int8)
        >>> regions = doorway_regions(np.kron(cells, np.ones((8, 8), np.int8)), 0.1)
        >>> regions.count, round(float(regions.door_width.max()), 1)
        (2, 0.8)
    """
    cells = OccupancyGrid(cells, resolution).cells
    row0, row1, col0, col1 = known_box(cells)
    box = slice(row0, row1), slice(col0, col1)
    margin = round((config.door_max + config.widening) / resolution) + 1
    inner = slice(margin, -margin), slice(margin, -margin)
    part = np.full((row1 - row0 + 2 * margin, col1 - col0 + 2 * margin), UNKNOWN, np.int8)
    part[inner] = cells[box]
    occupied, free = part == OCCUPIED, part == FREE
    doors = find_doors(occupied, resolution, config)
    shut = dilate_by_disc(occupied | (doors > 0), config.core / resolution)
    grown, count = label_components(free & ~shut)
    if spread_in_place(grown, free, backwards=True):  # What no core reaches becomes regions of its own.
        count += label_components(free & (grown == 0), grown, count)[1]
    labels, gaps = np.zeros(cells.shape, np.int32), np.zeros(cells.shape, doors.dtype)
    labels[box], gaps[box] = grown[inner], doors[inner]
    return Regions(labels, count, gaps, resolution)


@checks_arguments
def gap_type(resolution: float, config: DoorGapConfig = SHIPPED) -> np.dtype[np.unsignedinteger[Any]]:
    """The smallest type that holds the width of a door in cells."""
    check_resolution(resolution)
    return np.min_scalar_type(int(config.door_max / resolution) + 2)


@checks_arguments
def find_doors(occupied: Mask, resolution: float, config: DoorGapConfig = SHIPPED) -> Gaps:
    """Gaps along rows and columns that may be doors, of `gap_type` (rows, cols): width in cells, 0 elsewhere.

    Where two gaps cross, the narrower one counts.
    """
    check_resolution(resolution)
    along_rows, along_cols = list_gaps(occupied, resolution, config, longest=config.door_run)
    width = np.zeros(occupied.shape, gap_type(resolution, config))
    _paint(along_rows, width)
    _paint(along_cols, width.T)
    return width


@njit(cache=True, nogil=True)
def _paint(gaps: Ints32, width: Gaps) -> None:
    """Write the width of gaps in cells where none is or a wider one."""
    for k in range(len(gaps)):
        row, col, n = gaps[k, GAP.line], gaps[k, GAP.begin], gaps[k, GAP.width]
        for c in range(col, col + n):
            if width[row, c] == 0 or width[row, c] > n:
                width[row, c] = n


@njit(cache=True, nogil=True)
def _sum_up(labels: Labels, gaps: Gaps, count: int, resolution: float) -> tuple[Ints, Floats]:
    """Boxes and doors of all regions."""
    boxes, doors = np.zeros((count + 1, 5), np.int64), np.zeros(count + 1)
    cols = labels.shape[1]
    for r in range(labels.shape[0]):
        row, widths, c = labels[r], gaps[r], ZERO
        while c < cols:
            label, begin = row[c], c
            c = run_end(row, c, label)
            if label == 0:
                continue
            # few runs have a door: it is looked for without a branch a cell
            some = False
            for k in range(begin, c):
                some |= widths[np.uint64(k)] > 0
            if some:
                for k in range(begin, c):
                    if widths[k] > 0:
                        doors[label] += 1.0 / np.float32(widths[k] * resolution)
            box = boxes[label]
            if box[0] == 0:
                box[1], box[2] = r, begin
            box[0] += c - begin
            box[2] = min(box[2], begin)
            box[3], box[4] = r + 1, max(box[4], c)
    return boxes, doors


@in_canonical_orientation
def run_doorways(grid: OccupancyGrid, config: DoorwaysConfig) -> Layout:
    """Rooms of a complete or partial grid."""
    if not has_free_space(grid):
        return empty_layout("doorways", grid, "the grid has no free cell")
    timer = StageTimer()
    with timer("segmentation"):
        labels = doorway_regions(grid.cells, grid.resolution, config).labels.astype(np.int32)
        small = np.bincount(labels.reshape(-1)) * grid.resolution**2 < config.room_area
        labels[small[labels]] = 0
        spread_in_place(labels, np.ascontiguousarray(grid.free), backwards=True)
    return layout_of_labels("doorways", grid, labels, timer)


register_method(
    "doorways", "Doorways shut, the free space eroded, its cores grown back", run_doorways, DoorwaysConfig
)
