"""Any grid has a layout: noise, stripes, meshes and strips, of any size and resolution."""

from __future__ import annotations

import dataclasses
import warnings

import numpy as np
import pytest
import shapely

from layoutexplore.closed_doors.prediction import predict_closed_rooms
from layoutexplore.errors import ConfigError
from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.layout.doorways import DoorwaysConfig
from layoutexplore.layout.limits import cells_at_most, most_lines
from layoutexplore.layout.lines.face_clusters import MANY, FaceGraph, merge_small
from layoutexplore.layout.outlines import label_polygons
from layoutexplore.layout.pipeline import method_names, reconstruct
from layoutexplore.layout.types import Layout

METHODS = ("default", "rose2", "ias15", "rose", "morphological", "distance", "voronoi")


def stripes(rows: int, cols: int, step: int) -> np.ndarray:
    return np.where(np.arange(rows)[:, None] % step == 0, 100, np.zeros((rows, cols), int))


def mesh(rows: int, cols: int, step: int) -> np.ndarray:
    return np.maximum(stripes(rows, cols, step), stripes(cols, rows, step).T)


def dots(rows: int, cols: int, step: int) -> np.ndarray:
    return np.minimum(stripes(rows, cols, step), stripes(cols, rows, step).T)


def checkerboard(rows: int, cols: int, step: int) -> np.ndarray:
    r, c = np.indices((rows, cols)) // step
    return (r + c) % 2 * 100


def rings(rows: int, cols: int, step: int) -> np.ndarray:
    r, c = np.indices((rows, cols))
    return (np.hypot(r - rows / 2, c - cols / 2).astype(int) % step == 0) * 100


def spiral(rows: int, cols: int, step: int) -> np.ndarray:
    cells = np.zeros((rows, cols), int)
    for k in range(0, min(rows, cols) // 2, max(step, 2)):
        cells[k, k : cols - k] = cells[rows - 1 - k, k : cols - k] = 100
        cells[k : rows - k, k] = cells[k : rows - k, cols - 1 - k] = 100
        cells[k + 1 : k + max(step, 2), k] = 0
    return cells


PATTERNS = (stripes, mesh, dots, checkerboard, rings, spiral)


def random_grid(rng: np.random.Generator, largest: int) -> OccupancyGrid:
    """Noise or a pattern, partly unknown, perhaps one or two cells wide."""
    rows, cols = (int(n) for n in np.exp(rng.uniform(0, np.log(largest), 2)).round())
    if rng.random() < 0.5:
        cells = (rng.random((rows, cols)) < rng.choice([0, 0.001, 0.02, 0.2, 0.5, 0.9, 1])) * 100
    else:
        cells = PATTERNS[rng.integers(len(PATTERNS))](rows, cols, int(rng.integers(1, 12)))
    if rng.random() < 0.3:
        cells = 100 - cells
    hidden = rng.random((rows, cols)) < rng.choice([0, 0, 0.01, 0.3, 0.99, 1])
    cells = np.where(hidden, -1, cells).astype(np.int8)
    resolution = float(rng.choice([0.01, 0.02, 0.05, 0.05, 0.1, 0.25, 1.0, 10.0]))
    return OccupancyGrid(cells[:: rng.choice([-1, 1])].copy(), resolution)


def check(layout: Layout, grid: OccupancyGrid) -> None:
    """Everything a layout promises of its labels, polygons and details."""
    assert layout.labels.shape == layout.clean_grid.shape == grid.shape
    assert layout.rooms or layout.warnings or layout.method == "rose"
    names = [room.id for room in layout.rooms]
    assert names == sorted(names) and set(np.unique(layout.labels)) - {0} <= set(names)
    polygons = np.array([room.polygon for room in layout.rooms], object)
    assert shapely.is_valid(polygons).all() and (shapely.area(polygons) > 0).all()
    assert not layout.lines or len(layout.lines) <= most_lines(grid.shape) + 4
    assert all(0 <= face.room <= max(names, default=0) for face in layout.faces)


def run_grids(seed: int, count: int, largest: int) -> None:
    """Layouts of random grids; NumPy's warnings about numbers that are none are errors."""
    rng = np.random.default_rng(seed)
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        for k in range(count):
            grid = random_grid(rng, largest)
            check(reconstruct(grid, METHODS[k % len(METHODS)]), grid)
            if k % 5 == 0:
                closed = predict_closed_rooms(grid)
                assert closed.rooms.shape == grid.shape and not (closed.rooms & (grid.cells >= 0)).any()


def test_lines_that_miss_the_box_cover_nothing() -> None:
    cells = np.zeros((1, 38), np.int8)
    cells[0, [1, 3, 4, 7, 14, 18, 20, 21, 22, 24, 25, 28, 32]] = 100
    cells[0, [5, 8, 10, 11, 13, 15, 16, 23]] = -1
    layout = reconstruct(OccupancyGrid(cells, 1.0))
    assert len(layout.lines) > 4 and all(0 <= line.weight <= 1 for line in layout.lines)


def test_any_grid_has_a_layout() -> None:
    assert set(METHODS) <= set(method_names())
    run_grids(0, 140, 50)


@pytest.mark.slow
def test_twenty_thousand_grids_have_layouts() -> None:
    run_grids(1, 20_000, 300)


@pytest.mark.parametrize("method", METHODS)
def test_a_long_corridor_needs_no_square(method: str) -> None:
    cells = np.zeros((3, 20_000), np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    check(reconstruct(OccupancyGrid(cells, 0.05), method), OccupancyGrid(cells, 0.05))


def test_a_checkerboard_of_large_cells_needs_no_table_of_all_pairs() -> None:
    grid = OccupancyGrid(checkerboard(192, 246, 1).astype(np.int8), 1.0)
    layout = reconstruct(grid)
    check(layout, grid)
    assert any("left out" in warning for warning in layout.warnings)


def test_lines_beyond_the_limit_are_left_out_with_a_warning() -> None:
    rng = np.random.default_rng(0)
    grid = OccupancyGrid(((rng.random((90, 400)) < 0.5) * 100).astype(np.int8), 1.0)
    for method in ("default", "rose2", "ias15"):
        layout = reconstruct(grid, method)
        told = [text for text in layout.warnings if text.startswith("the weakest wall lines were left out")]
        assert len(told) == 1 and len(layout.segments) > most_lines(grid.shape)
        assert most_lines(grid.shape) <= len(layout.lines) <= most_lines(grid.shape) + 4


def test_a_length_in_cells_has_a_limit() -> None:
    assert [cells_at_most(0.3, r, 50) for r in (0.1, 1e-9, 5.0)] == [3, 50, 1]


def test_a_room_of_many_holes_keeps_its_cells() -> None:
    rng = np.random.default_rng(0)
    labels = (rng.random((120, 120)) > 0.15).astype(np.int32)
    polygon = label_polygons(labels)[1]
    assert polygon.is_valid and len(polygon.interiors) > 1000
    rows, cols = np.nonzero(
        shapely.contains_xy(polygon, *(np.indices(labels.shape)[::-1].reshape(2, -1) + 0.5)).reshape(
            labels.shape
        )
    )
    assert labels[rows, cols].all() and polygon.area == len(rows)


def test_many_small_rooms_merge_at_once() -> None:
    count = 3 * MANY
    chain = np.arange(count - 1)
    graph = FaceGraph(first=chain, second=chain + 1, length=np.ones(count - 1), covered=np.zeros(count - 1))
    room = merge_small(np.arange(count), graph, np.ones(count), 5.0)
    assert (np.bincount(room) >= 5).all() and room.min() == 0
    apart = FaceGraph(first=chain, second=chain + 1, length=np.ones(count - 1), covered=np.ones(count - 1))
    assert (merge_small(np.arange(count), apart, np.ones(count), 5.0) == -1).all()


@pytest.mark.parametrize(
    "spec",
    [
        "default:basin_wide=1e300", "rose2:level_step=1e-300", "rose2:wall_gap=1e300", "ias15:wall_gap=1e300",
        "voronoi:neighbourhood=99999999999999999999", "voronoi:iterations=99999999999999999999",
        "doorways:core=1e6", "doorways:door_max=1e6", "doorways:widening=1e9",
    ],
)  # fmt: skip
def test_options_for_which_no_memory_or_time_is_enough_are_refused(spec: str) -> None:
    name, _, option = spec.partition(":")
    with pytest.raises(ConfigError, match=r"at most|or more"):
        if name == "doorways":
            key, _, value = option.partition("=")
            DoorwaysConfig(**{key: float(value)})
        reconstruct(OccupancyGrid(np.zeros((9, 9), np.int8), 0.1), spec)


@pytest.mark.parametrize("name", ["rooms", "walls", "warnings"])
def test_a_layout_holds_rooms_and_walls_alone(name: str) -> None:
    whole = reconstruct(OccupancyGrid(np.zeros((9, 9), np.int8), 0.1), "morphological")
    with pytest.raises(ConfigError, match=f"each of {name} must be"):
        dataclasses.replace(whole, **{name: [None]})  # type: ignore[arg-type]
