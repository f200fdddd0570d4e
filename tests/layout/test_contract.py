"""What layout methods have in common: an answer to every grid, twice the same; errors name the option."""

from __future__ import annotations

import dataclasses
import functools
import json
from itertools import combinations
from pathlib import Path

import cv2
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from layoutexplore.drawing.layouts import draw_layout
from layoutexplore.errors import ConfigError, UnknownNameError
from layoutexplore.grids.grid import OccupancyGrid, Pose
from layoutexplore.layout.export import layout_to_geojson
from layoutexplore.layout.pipeline import METHOD_MODULES, LayoutCache, layout_method, reconstruct
from layoutexplore.layout.types import OUTSIDE, Layout, LayoutRoom

PAGES = Path(__file__).parents[2] / "layoutexplore" / "documentation" / "pages"
LAYOUTS = (PAGES / "concepts" / "layouts.md").read_text()
EMPTY = OccupancyGrid(np.zeros((4, 4), np.int8), 0.1)


@functools.cache
def hard_inputs() -> dict[str, NDArray[np.int8]]:
    rng = np.random.default_rng(0)
    rows, cols = np.mgrid[:180, :180] - 90
    radius, angle = np.hypot(rows, cols), np.arctan2(rows, cols)
    beams = (radius < 70) & (np.sin(angle * 40) > 0)
    octagon = np.maximum(np.abs(rows), np.abs(cols)) + 0.5 * np.minimum(np.abs(rows), np.abs(cols)) < 80
    two = np.full((180, 180), 100)
    two[20:90, 20:140] = two[95:170, 20:170] = two[85:100, 70:90] = 0
    parts = np.full((180, 180), -1)
    parts[10:60, 10:60] = parts[100:170, 100:170] = 100
    parts[12:58, 12:58] = parts[102:168, 102:168] = 0
    tiny = np.full((20, 20), 100)
    tiny[2:18, 2:18] = 0
    wall = np.zeros((150, 150))
    wall[75, 20:130] = 100
    spot = np.full((60, 60), -1)
    spot[30, 30], spot[30, 31] = 0, 100
    inputs = {
        "all unknown": np.full((60, 70), -1),
        "all free": np.zeros((60, 70)),
        "all occupied": np.full((60, 70), 100),
        "single scan": np.where(beams, np.where(radius > 68, 100, 0), -1),
        "salt noise": np.where(rng.random((180, 180)) < 0.05, 100, 0),
        "no direction": np.where(cv2.GaussianBlur(rng.random((180, 180)), (0, 0), 6) > 0.51, 100, 0),
        "circular room": np.select([radius < 70, radius < 74], [0, 100], -1),
        "two levels": two,
        "many sides": np.where(octagon, 0, 100),
        "disconnected": parts,
        "chequered": np.where((rows // 20 + cols // 20) % 2 == 0, 0, 100),
        "probabilities": rng.integers(-1, 101, (60, 60)),
        "20 x 20": tiny,
        "one wall": wall,
        "one free cell": spot,
        "one row": np.zeros((1, 90)),
        "one cell": np.zeros((1, 1)),
        "diagonal": np.where(rows == cols, 0, 100),
    }
    return {name: np.ascontiguousarray(cells, np.int8) for name, cells in inputs.items()}


def check(layout: Layout, grid: OccupancyGrid) -> None:
    assert layout.labels.shape == grid.shape and layout.labels.dtype == np.int32
    assert not layout.labels[grid.occupied].any()
    ends = np.array([(*line.start, *line.end) for line in layout.lines]).reshape(-1, 2)
    size = np.hypot(*grid.shape) * grid.resolution
    assert (np.abs(ends - (grid.origin.x, grid.origin.y)) <= 2 * size + 5.0).all()  # none far off the map
    assert [room.id for room in layout.rooms] == list(range(1, len(layout.rooms) + 1))
    assert np.array_equal(np.unique(layout.labels[layout.labels > 0]), [room.id for room in layout.rooms])
    for room in layout.rooms:
        assert room.polygon.is_valid and room.area > 0 and 0 <= room.seen_share <= 1
    for room in layout.rooms:
        free = np.count_nonzero((layout.labels == room.id) & layout.clean_grid.free) * grid.resolution**2
        assert layout.free_areas[room.id] == pytest.approx(free)
    told = [
        f["properties"] for f in layout_to_geojson(layout)["features"] if f["properties"]["kind"] == "room"
    ]
    assert [one["free_area"] for one in told] == pytest.approx(list(layout.free_areas.values()), abs=1e-4)
    for a, b in combinations(layout.rooms, 2):
        assert a.polygon.intersection(b.polygon).area < 1e-6
    assert layout.rooms or layout.warnings or layout.method == "rose"
    check_room_reach(layout)


def check_room_reach(layout: Layout) -> None:
    of_rooms, reach = [face for face in layout.faces if face.room > 0], layout.room_reach
    if reach is None:
        assert not of_rooms
        return
    assert reach.labels.shape == layout.labels.shape and reach.labels.dtype == np.int32
    assert len(reach.at_border) == len(layout.rooms) + 1
    outside = {face.room for face in of_rooms if any(edge.neighbour == OUTSIDE for edge in face.edges)}
    assert set(np.flatnonzero(reach.at_border).tolist()) == outside
    cells = np.argwhere(np.ones(reach.labels.shape, np.bool_))[::5]
    centres = shapely.points(layout.clean_grid.cells_to_world(cells))
    labels = reach.labels[cells[:, 0], cells[:, 1]]
    for room in {face.room for face in of_rooms}:
        whole = shapely.union_all([face.polygon.buffer(1e-6) for face in of_rooms if face.room == room])
        away = shapely.distance(centres, whole.boundary)
        clear = away > 1e-5  # a centre on a border belongs to one of its sides
        assert np.array_equal((labels == room)[clear], shapely.contains(whole, centres)[clear])


@pytest.mark.parametrize("method", list(METHOD_MODULES))
@pytest.mark.parametrize("name", list(hard_inputs()))
def test_hard_inputs_have_an_answer_twice_the_same(method: str, name: str) -> None:
    cells = hard_inputs()[name]
    grid = OccupancyGrid(cells.copy(), 0.05, Pose(1.0, 2.0, 0.3))
    layout, again = reconstruct(grid, method), reconstruct(grid, method)
    check(layout, grid)
    assert repr(layout).startswith(
        f"Layout(method={method!r}, clean_grid=OccupancyGrid(cells=int8 {grid.shape}"
    )
    assert len(repr(layout)) < 1000 and "\n" not in repr(layout)
    assert np.array_equal(layout.labels, again.labels) and np.array_equal(layout.segments, again.segments)
    assert [room.polygon for room in layout.rooms] == [room.polygon for room in again.rooms]
    assert json.dumps(layout_to_geojson(layout)) == json.dumps(layout_to_geojson(again))
    assert draw_layout(layout, grid, panel=80).dtype == np.uint8
    assert np.array_equal(grid.cells, cells), "the grid belongs to the caller"


def test_a_corner_in_the_middle_of_a_side_of_a_face() -> None:
    occupied = np.array([[5, 5], [7, 2], [16, 4], [17, 1], [17, 10], [17, 12]])
    cells = np.zeros((35, 13), np.int8)
    cells[occupied[:, 0], occupied[:, 1]] = 100
    grid = OccupancyGrid(np.repeat(np.repeat(cells, 3, axis=0), 3, axis=1), 0.2)
    check(reconstruct(grid, "ias15"), grid)


@pytest.mark.parametrize("seed", range(4))
def test_a_face_that_holds_no_free_cell_is_no_room(seed: int) -> None:
    """Of single cells all over the map lines make slits that hold none."""
    rng = np.random.default_rng(seed)
    cells = rng.choice(np.array([-1, 0, 0, 0, 100], np.int8), rng.integers(10, 60, 2))
    grid = OccupancyGrid(np.repeat(np.repeat(cells, 3, axis=0), 3, axis=1), 0.2)
    check(reconstruct(grid, "ias15"), grid)


@pytest.mark.parametrize("method", list(METHOD_MODULES))
@given(
    hnp.arrays(
        np.int8,
        st.tuples(st.integers(1, 60), st.integers(1, 60)),
        elements=st.sampled_from([-1, 0, 0, 0, 100]),
    ),
    st.sampled_from([1, 3]),
)
@settings(max_examples=12, deadline=None)
def test_random_grids_never_break_a_method(method: str, cells: NDArray[np.int8], size: int) -> None:
    grid = OccupancyGrid(np.repeat(np.repeat(cells, size, axis=0), size, axis=1), 0.2)
    check(reconstruct(grid, method), grid)


@pytest.mark.parametrize("method", list(METHOD_MODULES))
def test_methods_are_documented_and_refuse_what_is_not_theirs(method: str) -> None:
    assert layout_method(method).summary and f"`{method}`" in LAYOUTS
    with pytest.raises(UnknownNameError, match=f"option of the {method} method"):
        reconstruct(EMPTY, method, {"nonsense": 1.0})
    other = "rose2" if method != "rose2" else "ias15"
    with pytest.raises(ConfigError, match=f"the {method} method takes a"):
        reconstruct(EMPTY, method, layout_method(other).config())


@pytest.mark.parametrize("method", list(METHOD_MODULES))
@pytest.mark.parametrize("value", ["wide", None, (1, 2, 3), float("nan"), float("inf"), [1.0]])
def test_options_that_make_no_sense_are_named(method: str, value: object) -> None:
    for option in dataclasses.fields(layout_method(method).config()):
        if value != option.default:
            with pytest.raises(ConfigError, match=f"{option.name} must be"):
                reconstruct(EMPTY, method, {option.name: value})


def test_free_areas_of_labels_of_any_kind() -> None:
    cells = np.zeros((2, 3), np.int8)
    labels = np.array([[-1, 1, 1], [-1, 2**31 - 1, 1]], np.int32)
    room = LayoutRoom(id=1, polygon=shapely.box(0, 0, 1, 1))
    layout = Layout(method="mine", clean_grid=OccupancyGrid(cells, 0.5), labels=labels, rooms=(room,))
    assert layout.free_areas == {1: 0.75}


@pytest.mark.parametrize("method", METHOD_MODULES)
def test_a_map_of_probabilities_has_the_rooms_of_what_is_likely(method: str) -> None:
    cells = hard_inputs()["disconnected"]
    likely = np.where(cells == 100, 80, np.where(cells == 0, 12, -1)).astype(np.int8)
    layout, soft = (reconstruct(OccupancyGrid(each, 0.05), method) for each in (cells, likely))
    assert np.array_equal(soft.labels, layout.labels) and soft.warnings == layout.warnings
    assert np.array_equal(soft.clean_grid.cells, layout.clean_grid.cells)
    cached = LayoutCache(method)(OccupancyGrid(likely, 0.05))
    assert np.array_equal(cached.labels, layout.labels)
