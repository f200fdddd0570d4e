"""Random grids, and a decision about any grid, that the tests of predictors share."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from layoutexplore.frontiers.decision import Decision, KnownDistances
from layoutexplore.frontiers.detection import find_frontiers
from layoutexplore.frontiers.table import Frontier
from layoutexplore.grids.grid import Cell, OccupancyGrid, Pose
from layoutexplore.layout.doorways import Regions
from layoutexplore.sensing.lidar import LidarConfig

grids = hnp.arrays(
    np.int8, st.tuples(st.integers(3, 24), st.integers(3, 24)), elements=st.sampled_from([-1, 0, 0, 100])
)


wide = st.builds(
    lambda coarse, size: coarse.repeat(size, axis=0).repeat(size, axis=1),
    hnp.arrays(
        np.int8,
        st.tuples(st.integers(2, 5), st.integers(2, 8)),
        elements=st.sampled_from([-1, -1, -1, 0, 0, 100]),
    ),
    st.integers(3, 6),
)
"""Grids with long stretches without walls."""


def nothing_seen(shape: tuple[int, int]) -> Regions:
    return Regions(np.zeros(shape, np.int32), 0, np.zeros(shape, np.uint8), 0.1)


def decide(grid: OccupancyGrid) -> Decision:
    """A decision about all frontiers of a grid, each a metre away."""
    clusters = find_frontiers(grid.cells)
    frontiers = []
    for k in range(len(clusters)):
        cells = clusters.cluster(k)
        row, col = cells[0].tolist()
        x, y = grid.cell_to_world(row, col)
        frontiers.append(Frontier(cells, len(cells) * 0.1, (x, y), Cell(row, col), 1.0, 1.0, 1.0))
    field = KnownDistances(np.ones(grid.shape, np.float32))
    sensor = LidarConfig(range_max=8.0, fov=6.28, beams=8)
    return Decision(0, grid, Pose(0.0, 0.0), tuple(frontiers), field, 0.0, sensor, 0.2)
