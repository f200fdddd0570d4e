"""Grids of probabilities."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from layoutexplore.grids.grid import OccupancyGrid, Pose
from layoutexplore.grids.ros_map import load_grid, save_grid
from layoutexplore.maps.raster import PlanRaster


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=30)
@given(arrays(np.int8, st.tuples(st.integers(1, 6), st.integers(1, 6)), elements=st.integers(-1, 100)))
def test_probabilities_are_decided_as_a_map_of_three_levels_has_them(
    tmp_path: Path, cells: NDArray[np.int8]
) -> None:
    grid = OccupancyGrid(cells, 0.05, Pose(1.0, 2.0, 0.5))
    save_grid(grid, tmp_path / "map.yaml")
    found = grid.trinary
    assert np.array_equal(found.cells, load_grid(tmp_path / "map.yaml").cells)
    assert found.cells.dtype == np.int8 and (found.resolution, found.origin) == (0.05, grid.origin)
    assert found.trinary is found


@pytest.mark.parametrize("resolution", [np.float32(0.25), np.float64(0.25), 1, np.int64(1)])
def test_a_resolution_is_a_number_of_pythons(resolution: float) -> None:
    """For one of NumPy's, and a whole one, all kernels that are given it were compiled once more."""
    grid = OccupancyGrid(np.zeros((2, 2), np.int8), resolution)
    raster = PlanRaster(np.eye(2, dtype=bool), np.zeros((2, 2), np.int16), resolution)
    for made in (grid, raster):
        assert type(made.resolution) is float and made.resolution == resolution


@pytest.mark.parametrize(
    ("percent", "cell"), [(-1, -1), (0, 0), (19, 0), (20, -1), (64, -1), (65, 100), (100, 100)]
)
def test_thresholds_of_probabilities(percent: int, cell: int) -> None:
    assert OccupancyGrid(np.array([[percent]], np.int8), 0.1).trinary.cells.tolist() == [[cell]]
