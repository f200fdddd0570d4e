"""Maps whose rooms are known as they were while being explored, and with more furniture.

A lidar that sees through free cells only looks around at places near a start; what it sees is shown as the
map has it, so that noise, furniture and the mapper's habits stay those of the building.
"""

from __future__ import annotations

import numpy as np

from layoutexplore.grids.arrays import Cells, Ints32
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, Pose, in_cells
from layoutexplore.grids.morphology import inflate, with_neighbours
from layoutexplore.sensing.lidar import Lidar, LidarConfig
from layoutexplore.sensing.mapper import Mapper
from layoutexplore.training.merging_examples import Example, make_example
from layoutexplore.training.simulated_maps import DENSITIES, choose_stops, furnish_cells

RANGES, FIELDS = (4.0, 8.0, 15.0, 30.0), (np.pi, 2 * np.pi, 2 * np.pi)
DENSE, SPARSE = (720,), (180, 360, 720)
"""Beams of a lidar: enough to see coherent areas, or as few as many real ones, which see stripes far away."""

VERSIONS = 24
"""Times a map is explored; a quarter of them with dense beams."""

FURNISHED = 6
"""Times it is furnished and, every other time, explored."""

CLEARANCE = 0.2
LEAST = 10.0
"""A version with less free space is left out [m2]."""


def explore_map(cells: Cells, resolution: float, rng: np.random.Generator, *, dense: bool) -> Cells:
    """A map as it may have been while it was explored: int8 (rows, cols), with fewer known cells.

    Args:
        cells: int8 (rows, cols), trinary.
        resolution: Metres a cell.
        rng: Source of randomness.
        dense: Whether the beams stand close, and what lies 0.1 m beside what they see is known too; else
            0.05 m.
    """
    solid = cells != FREE
    beams = int(rng.choice(DENSE if dense else SPARSE))
    sensor = LidarConfig(range_max=float(rng.choice(RANGES)), fov=float(rng.choice(FIELDS)), beams=beams)
    origin = Pose(0.0, 0.0, 0.0)
    lidar, mapper = Lidar(sensor, solid, resolution, origin), Mapper(cells.shape, resolution, origin)
    for cell in choose_stops(~inflate(solid, CLEARANCE, resolution), resolution, rng):
        x, y = mapper.grid.cell_to_world(*cell)
        mapper.observe(lidar, Pose(x, y, float(rng.uniform(0, 2 * np.pi))))
    shown = with_neighbours(mapper.grid.cells == FREE, in_cells(0.1 if dense else 0.05, resolution))
    return np.where(shown, cells, UNKNOWN).astype(np.int8)


def explored_examples(
    cells: Cells, truth: Ints32, resolution: float, *, building: str, kind: str, rng: np.random.Generator
) -> list[Example]:
    """Examples of a map: explored `VERSIONS` times, furnished `FURNISHED` times; nearly empty ones left out.

    Args:
        cells: int8 (rows, cols), trinary.
        truth: int32 (rows, cols), true room of each cell, 0 for none.
        resolution: Metres a cell.
        building: Name of the building.
        kind: Kind of map.
        rng: Source of randomness.
    """
    versions = [explore_map(cells, resolution, rng, dense=k % 4 == 0) for k in range(VERSIONS)]
    for k in range(FURNISHED):
        added = furnish_cells(cells == OCCUPIED, truth, float(rng.choice(DENSITIES[1:])), resolution, rng)
        furnished = np.where(added & (cells == FREE), OCCUPIED, cells).astype(np.int8)
        versions.append(
            explore_map(furnished, resolution, rng, dense=k % 2 == 0) if rng.random() < 0.5 else furnished
        )
    return [
        make_example(version, truth, resolution, building=building, kind=f"{kind}, explored")
        for version in versions
        if np.count_nonzero(version == FREE) * resolution**2 >= LEAST
    ]
