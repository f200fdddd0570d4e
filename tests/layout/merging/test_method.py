"""The default method: plans with a known answer, symmetries, hard inputs, and the parts it is made of."""

from __future__ import annotations

import numpy as np
import pytest

from layoutexplore.errors import ConfigError
from layoutexplore.grids.grid import OccupancyGrid, Pose
from layoutexplore.layout.merging.method import MergingConfig
from layoutexplore.layout.pipeline import reconstruct
from layoutexplore.metrics.segmentation import score_segmentation
from tests.layout.merging.cases import office, pentagon


@pytest.mark.parametrize("clutter", [False, True])
def test_an_office_is_a_corridor_and_six_rooms(clutter: bool) -> None:
    grid = office(clutter)
    layout = reconstruct(grid)
    assert len(layout.rooms) == 7
    assert layout.labels[130, 20] == layout.labels[130, 260] > 0


def test_resolution_and_grid_scaled_together_leave_the_rooms_in_place() -> None:
    grid = office()
    coarse = reconstruct(OccupancyGrid(grid.cells[::2, ::2], 0.1))
    fine = reconstruct(grid)
    assert len(coarse.rooms) == len(fine.rooms)
    for room in fine.rooms:
        best = max(room.polygon.intersection(other.polygon).area / room.area for other in coarse.rooms)
        assert best > 0.9


def test_a_turned_origin_moves_the_rooms_with_the_grid() -> None:
    grid = office()
    placed = OccupancyGrid(grid.cells, 0.05, Pose(10.0, -3.0, np.pi / 2))
    here, there = reconstruct(grid), reconstruct(placed)
    assert (here.labels == there.labels).all()
    x, y = here.rooms[0].polygon.centroid.coords[0]
    assert there.rooms[0].polygon.centroid.coords[0] == pytest.approx((10.0 - y, -3.0 + x))
    assert np.sort(there.directions) == pytest.approx(
        np.sort(np.mod(here.directions + np.pi / 2, np.pi)), abs=1e-6
    )


def test_walls_askew_are_turned_first() -> None:
    grid = office()
    rows, cols = np.mgrid[0:380, 0:380]
    c, s = np.cos(0.3), np.sin(0.3)
    x, y = (
        np.rint(c * (cols - 190) + s * (rows - 190) + 140).astype(int),
        np.rint(c * (rows - 190) - s * (cols - 190) + 130).astype(int),
    )
    inside = (x >= 0) & (x < 280) & (y >= 0) & (y < 260)
    cells = np.where(inside, grid.cells[np.clip(y, 0, 259), np.clip(x, 0, 279)], -1).astype(np.int8)
    layout = reconstruct(OccupancyGrid(cells, 0.05))
    assert len(layout.rooms) == 7


@pytest.mark.parametrize("seed", range(3))
def test_rooms_of_a_furnished_pentagon_are_found_in_all_its_directions(seed: int) -> None:
    grid, truth = pentagon(seed)
    layout = reconstruct(grid)
    assert score_segmentation(layout.labels, truth, grid.free, protocol="rose2").one_to_one > 0.85


def test_bad_options_are_refused() -> None:
    with pytest.raises(ConfigError, match="door_min"):
        MergingConfig(door_min=2.0, door_max=1.0)
    with pytest.raises(ConfigError, match="basin_share"):
        reconstruct(office(), config={"basin_share": 0.0})
    with pytest.raises(ConfigError, match="openings"):
        MergingConfig(reach=-1.0)
    for name in ("sliver_area", "pair_weight", "wall_half"):
        with pytest.raises(ConfigError, match=f"{name} must be a finite number, 0 or more"):
            MergingConfig(**{name: -1.0})
