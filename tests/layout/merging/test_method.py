"""The default method: plans with a known answer, symmetries, hard inputs, and the parts it is made of."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from layoutexplore.errors import ConfigError
from layoutexplore.grids.grid import OccupancyGrid, Pose
from layoutexplore.layout.merging.method import MergingConfig
from layoutexplore.layout.pipeline import reconstruct
from layoutexplore.layout.types import Layout
from tests.layout.merging.cases import office


def check_layout(layout: Layout, grid: OccupancyGrid) -> None:
    assert layout.labels.shape == grid.shape and layout.labels.dtype == np.int32
    assert not layout.labels[grid.occupied].any()
    assert sorted(np.unique(layout.labels[layout.labels > 0])) == [room.id for room in layout.rooms]
    shapes = [room.polygon for room in layout.rooms]
    assert all(isinstance(s, shapely.Polygon) and s.is_valid and s.area > 0 for s in shapes)
    assert sum(s.area for s in shapes) == pytest.approx(
        shapely.union_all(shapes).area if shapes else 0.0, abs=1e-6
    )
    assert layout.rooms or layout.warnings


@pytest.mark.parametrize("clutter", [False, True])
def test_an_office_is_a_corridor_and_six_rooms(clutter: bool) -> None:
    grid = office(clutter)
    layout = reconstruct(grid)
    check_layout(layout, grid)
    assert len(layout.rooms) == 7
    assert layout.labels[130, 20] == layout.labels[130, 260] > 0
    again = reconstruct(grid)
    assert (again.labels == layout.labels).all()
    assert all(a.polygon.equals(b.polygon) for a, b in zip(again.rooms, layout.rooms, strict=True))


def same_partition(a: np.ndarray, b: np.ndarray) -> float:
    """Share of the cells that differ, at the best naming of the rooms."""
    table = np.zeros((a.max() + 1, b.max() + 1), int)
    np.add.at(table, (a.ravel(), b.ravel()), 1)
    return 1.0 - table.max(axis=1).sum() / a.size


@pytest.mark.parametrize("name", ["rot90", "rot180", "flip", "transpose"])
def test_turned_and_flipped_maps_give_the_same_rooms(name: str) -> None:
    moves = {
        "rot90": np.rot90,
        "rot180": lambda m: np.rot90(m, 2),
        "flip": np.fliplr,
        "transpose": np.transpose,
    }
    move, grid = moves[name], office()
    straight = reconstruct(grid)
    moved = reconstruct(OccupancyGrid(np.ascontiguousarray(move(grid.cells)), 0.05))
    assert len(moved.rooms) == len(straight.rooms)
    assert same_partition(move(straight.labels), moved.labels) < 0.01


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
    check_layout(layout, OccupancyGrid(cells, 0.05))
    assert len(layout.rooms) == 7


def hard(name: str) -> np.ndarray:
    rng = np.random.default_rng(0)
    y, x = np.mgrid[0:200, 0:200]
    radius = np.hypot(x - 100, y - 100)
    shapes = {
        "all unknown": np.full((50, 60), -1),
        "all free": np.zeros((50, 60)),
        "all occupied": np.full((50, 60), 100),
        "one free cell": np.where((x == 100) & (y == 100), 0, -1),
        "salt": np.where(rng.random((200, 200)) < 0.02, 100, 0),
        "round": np.where(radius < 80, 0, np.where(radius < 84, 100, -1)),
        "two levels": np.where(radius < 60, 0, 100),
        "tiny": np.pad(np.zeros((18, 18)), 1, constant_values=100),
        "scan": np.where((np.mod(np.arctan2(y - 100, x - 100) * 40, 1) < 0.4) & (radius < 90), 0, -1),
        "islands": np.where((x // 20 + y // 20) % 2 == 0, 0, 100),
        "line": np.zeros((1, 300)),
        "probabilities": rng.integers(-1, 101, (60, 60)),
    }
    return np.ascontiguousarray(shapes[name].astype(np.int8))


@pytest.mark.parametrize(
    "name",
    ["all unknown", "all free", "all occupied", "one free cell", "salt", "round", "two levels", "tiny", "scan",
     "islands", "line", "probabilities"],
)  # fmt: skip
def test_hard_maps_give_a_layout(name: str) -> None:
    grid = OccupancyGrid(hard(name), 0.05)
    layout = reconstruct(grid)
    check_layout(layout, grid)
    if name == "round":
        assert len(layout.rooms) == 1


@settings(max_examples=40, deadline=None)
@given(
    hnp.arrays(
        np.int8,
        st.tuples(st.integers(1, 40), st.integers(1, 40)),
        elements=st.sampled_from([-1, 0, 0, 0, 100]),
    )
)
def test_random_grids_never_break_it(cells: np.ndarray) -> None:
    grid = OccupancyGrid(cells, 0.25)
    check_layout(reconstruct(grid), grid)


def test_bad_options_are_refused() -> None:
    with pytest.raises(ConfigError, match="door_min"):
        MergingConfig(door_min=2.0, door_max=1.0)
    with pytest.raises(ConfigError, match="basin_share"):
        reconstruct(office(), config={"basin_share": 0.0})
    with pytest.raises(ConfigError, match="openings"):
        MergingConfig(reach=-1.0)
