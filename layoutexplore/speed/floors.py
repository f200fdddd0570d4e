"""The floors that speed is measured on: generated ones, so that everybody measures the same."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from layoutexplore.grids.arrays import Cells, Mask
from layoutexplore.grids.grid import Cell, Pose
from layoutexplore.grids.morphology import inflate
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.generator import PlanConfig, generate
from layoutexplore.maps.library import load_plan
from layoutexplore.planning.shortest_paths import geodesic_distances
from layoutexplore.sensing.lidar import Lidar, LidarConfig
from layoutexplore.sensing.mapper import Mapper

PLAN = "office:1"
RESOLUTION = 0.1
"""Metres that a cell counts as, whatever size the plan is drawn to."""


@lru_cache(maxsize=1)
def plan() -> FloorPlan:
    """The office that everything is measured on."""
    return load_plan(PLAN)


@lru_cache(maxsize=4)
def plan_of(area: float) -> FloorPlan:
    """An office of about this floor area in square metres."""
    return generate("office", 1, PlanConfig(area=area))


@lru_cache(maxsize=4)
def floor(rows: int, cols: int) -> Mask:
    """Occupied cells bool (rows, cols) of the plan, drawn as large as it fits, in one corner.

    The rest is solid.
    """
    x0, y0, x1, y1 = plan().bounds
    margin = 1.0
    resolution = max((x1 - x0 + 2 * margin) / cols, (y1 - y0 + 2 * margin) / rows)
    drawn = plan().rasterize(resolution, margin=margin / 2).occupied[:rows, :cols]
    occupied = np.ones((rows, cols), np.bool_)
    occupied[: drawn.shape[0], : drawn.shape[1]] = drawn
    return occupied


def poses(occupied: Mask, count: int) -> list[Pose]:
    """Poses scattered over the largest area that a robot of 0.2 m can reach, off the cells' centres.

    Always the same.
    """
    rng = np.random.default_rng(0)
    open_cells = ~inflate(occupied, 0.2, RESOLUTION)
    for row, col in rng.permutation(np.argwhere(open_cells)):
        distances = geodesic_distances(open_cells, Cell(int(row), int(col)), RESOLUTION)
        reached = np.argwhere(np.isfinite(distances))
        if 2 * len(reached) > np.count_nonzero(open_cells):
            break
    cells = reached[rng.integers(len(reached), size=count)] + rng.random((count, 2))
    headings = rng.uniform(-math.pi, math.pi, count)
    return [
        Pose(c * RESOLUTION, r * RESOLUTION, a)
        for (r, c), a in zip(cells.tolist(), headings.tolist(), strict=True)
    ]


def lidar(occupied: Mask, beams: int, reach: int) -> Lidar:
    """A lidar all around with a range in cells."""
    config = LidarConfig(range_max=reach * RESOLUTION, fov=2 * math.pi, beams=beams)
    return Lidar(config, occupied, RESOLUTION, Pose(0.0, 0.0))


@lru_cache(maxsize=2)
def half_explored(rows: int, cols: int) -> Cells:
    """Cells int8 (rows, cols) of a map that knows about half of the floor."""
    occupied = floor(rows, cols)
    sensor = lidar(occupied, 720, 80)
    mapper = Mapper(occupied.shape, RESOLUTION, Pose(0.0, 0.0))
    for pose in poses(occupied, 1000):
        mapper.observe(sensor, pose)
        if 2 * mapper.known_free >= np.count_nonzero(~occupied):
            break
    return mapper.grid.cells
