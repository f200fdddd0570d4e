"""The line methods on a clean building, the configuration of methods, and the layout that is kept."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
import shapely

from layoutexplore.errors import ConfigError, MapError, UnknownNameError
from layoutexplore.grids.grid import OccupancyGrid, Pose
from layoutexplore.layout.lines.ias15 import Ias15Config
from layoutexplore.layout.lines.rose2 import Rose2Config
from layoutexplore.layout.merging.method import MergingConfig
from layoutexplore.layout.pipeline import LayoutCache, reconstruct, register_layout
from layoutexplore.layout.types import BORDER, FaceKind


def building(resolution=0.05, unknown=1.0):
    """Three rooms of 4 x 4 m on either side of a corridor of 2 m, walls of 0.1 m, doors of 0.9 m to it."""
    scale = 1 / resolution
    pad = round(unknown * scale)
    rows, cols = round(10 * scale), round(12 * scale)
    cells = np.zeros((rows, cols), np.int8)
    wall = round(0.1 * scale)
    for y in (0.0, 4.0, 6.0, 9.9):
        cells[round(y * scale) : round(y * scale) + wall] = 100
    for x in (0.0, 4.0, 8.0, 11.9):
        for low, high in ((0.0, 4.0), (6.0, 10.0)):
            cells[round(low * scale) : round(high * scale), round(x * scale) : round(x * scale) + wall] = 100
    cells[:, :wall] = cells[:, -wall:] = 100
    for y, x in itertools.product((4.0, 6.0), (1.5, 5.5, 9.5)):
        cells[round(y * scale) : round(y * scale) + wall, round(x * scale) : round((x + 0.9) * scale)] = 0
    return OccupancyGrid(np.pad(cells, pad, constant_values=-1), resolution)


@pytest.mark.parametrize("method", ["rose2", "ias15"])
def test_a_clean_building_has_its_rooms(method):
    grid = building()
    layout = reconstruct(grid, method)
    assert len(layout.rooms) == 7
    areas = sorted(r.area for r in layout.rooms)
    assert areas[:6] == pytest.approx([16] * 6, rel=0.1)
    assert areas[6] == pytest.approx(24, rel=0.1)
    assert all(r.is_closed and not r.is_partial and r.seen_share > 0.95 for r in layout.rooms)
    assert np.count_nonzero(layout.labels) > 0.97 * grid.free.sum()
    assert np.degrees(layout.directions) % 90 == pytest.approx([0, 0], abs=0.5) or np.allclose(
        np.abs(np.mod(np.degrees(layout.directions) + 45, 90) - 45), 0, atol=0.5
    )


@pytest.mark.parametrize("method", ["rose2", "ias15"])
def test_resolution_and_origin_leave_the_rooms_where_they_are(method):
    coarse, fine = (reconstruct(building(resolution), method) for resolution in (0.1, 0.05))
    assert len(coarse.rooms) == len(fine.rooms) == 7
    for room in coarse.rooms:
        other = max(fine.rooms, key=lambda r: r.polygon.intersection(room.polygon).area)
        assert room.polygon.intersection(other.polygon).area / room.polygon.union(other.polygon).area > 0.85
    grid = building(0.1)
    moved = reconstruct(OccupancyGrid(grid.cells, 0.1, Pose(5.0, -3.0, np.pi / 2)), method)
    for room, other in zip(coarse.rooms, moved.rooms, strict=True):
        turned = shapely.transform(room.polygon, lambda p: np.stack((5.0 - p[:, 1], p[:, 0] - 3.0), axis=1))
        assert turned.symmetric_difference(other.polygon).area < 1e-6


def test_faces_know_their_neighbours_and_rooms():
    layout = reconstruct(building(), "rose2")
    faces = layout.faces
    assert {f.kind for f in faces} >= {FaceKind.INTERNAL, FaceKind.EXTERNAL}
    for face in faces:
        for edge in face.edges:
            assert 0 <= edge.weight <= 1
            assert edge.line == BORDER or not layout.lines[edge.line].is_border
        for neighbour in face.neighbours:
            assert face.id in faces[neighbour].neighbours
    for room in layout.rooms:
        union = shapely.union_all([faces[i].polygon for i in room.faces])
        assert union.symmetric_difference(room.polygon).area < 1e-6
        assert all(faces[i].room == room.id for i in room.faces)
    assert sum(line.is_border for line in layout.lines) == 4
    for wall in layout.walls:
        assert wall.length > 0
        assert not layout.lines[wall.line].is_border


def test_half_of_a_building_has_partial_and_open_rooms():
    grid = building()
    cells = grid.cells.copy()
    cells[:, 130:] = -1
    layout = reconstruct(OccupancyGrid(cells, grid.resolution), "rose2")
    assert any(r.is_partial for r in layout.rooms)
    assert any(not r.is_closed for r in layout.rooms)


def test_rooms_that_are_apart_are_split():
    cells = np.full((120, 260), -1, np.int8)
    cells[20:100, 20:240] = 0
    cells[[20, 99], 20:240] = 100
    cells[20:100, [20, 239]] = 100
    cells[20:100, 105:155] = -1  # never seen: two rooms, or one with an unseen middle
    cells[[20, 99], 105:155] = 100
    grid = OccupancyGrid(cells, 0.05)
    assert len(reconstruct(grid, "rose2", {"split": False}).rooms) == 1
    assert len(reconstruct(grid, "rose2").rooms) == 2


def test_labels_follow_the_growing_grid():
    grid = building()
    layout = reconstruct(grid, "rose2")
    later = OccupancyGrid(np.where(grid.cells == 0, 100, grid.cells).astype(np.int8), grid.resolution)
    assert not layout.room_labels(later).any()
    assert layout.room_labels() is layout.labels
    with pytest.raises(MapError, match="layout is of a grid"):
        layout.room_labels(building(0.1))


def test_configuration():
    grid = building(0.1)
    assert len(reconstruct(grid, "rose2", Rose2Config(split=False)).rooms) == 7
    with pytest.raises(UnknownNameError, match="line_distance"):
        reconstruct(grid, "rose2", {"line_distanc": 1.0})
    with pytest.raises(UnknownNameError, match="rose2"):
        reconstruct(grid, "rose3")
    with pytest.raises(ConfigError, match="Rose2Config"):
        reconstruct(grid, "rose2", Ias15Config())
    for bad in (
        {"level": 0},
        {"sigma": 0},
        {"votes": 0},
        {"split_area": -1},
        {"inside_share": 2},
        {"margin": -1},
        {"deviation": 0},
    ):
        with pytest.raises(ConfigError):
            Rose2Config(**bad)
    with pytest.raises(ConfigError):
        Ias15Config(bandwidth=0)


def test_rose_cleans_and_keeps_the_walls():
    grid = building()
    cells = grid.cells.copy()
    rng = np.random.default_rng(0)
    for row, col in rng.integers(30, 200, (40, 2)):
        cells[row : row + 3, col : col + 3] = np.where(
            cells[row : row + 3, col : col + 3] == 0, 100, cells[row : row + 3, col : col + 3]
        )
    cluttered = OccupancyGrid(cells, grid.resolution)
    layout = reconstruct(cluttered, "rose")
    kept = layout.clean_grid.occupied
    assert (kept & grid.occupied).sum() / kept.sum() > 0.95
    assert (layout.clean_grid.cells[cluttered.occupied & ~kept] == 0).all()
    assert layout.structure_score < 0.2


def test_manhattan_option_drops_other_directions():
    cells = building().cells.copy()
    for k in range(60):
        cells[120 - k, 40 + k] = cells[121 - k, 40 + k] = 100
    grid = OccupancyGrid(cells, 0.05)
    free, axes = (reconstruct(grid, "ias15", {"manhattan": option}) for option in (False, True))
    assert len(free.directions) > len(axes.directions) == 2


def test_cache_keeps_the_layout_while_the_walls_stay():
    grid = building(0.1)
    cache, exact = LayoutCache("rose2"), LayoutCache("rose2", exact=True)
    layouts = cache(grid), exact(grid)
    assert (cache(grid), exact(grid)) == layouts
    grid.cells[0, 0] = 0  # the mapper writes into the same array
    assert cache(grid) is layouts[0]
    assert exact(grid) is not layouts[1]
    grid.cells[0, 0] = 100
    assert cache(grid) is not layouts[0]
    assert cache(OccupancyGrid(grid.cells, 0.2)).clean_grid.resolution == 0.2


@pytest.mark.parametrize("method", ["default", "rose2"])
def test_rooms_of_the_cache_are_those_of_the_map_that_it_was_shown(method):
    """They are made when they are looked at, when the map may have grown."""
    grid = building(0.1)
    grid.cells[12:30, 60:90][grid.cells[12:30, 60:90] == 0] = -1
    wanted = [(room.seen_share, room.is_partial) for room in reconstruct(grid, method).rooms]
    layout = LayoutCache(method)(grid)
    grid.cells[grid.cells == -1] = 0
    assert [(room.seen_share, room.is_partial) for room in layout.rooms] == wanted


def test_cache_keeps_the_layout_while_the_walls_have_hardly_grown():
    grid = building(0.1)
    cache = LayoutCache("rose2", growth=0.01)
    shown: list[OccupancyGrid] = []

    def part() -> OccupancyGrid:
        shown.append(grid)
        return grid

    first, walls = cache(grid, part), np.argwhere(grid.cells == 100)
    few = len(walls) // 100
    grid.cells[tuple(walls[:few].T)] = 0
    assert cache(grid, part) is first and len(shown) == 1
    assert cache(OccupancyGrid(grid.cells.copy(), 0.1), part) is not first and len(shown) == 2
    second = cache(grid, part)
    grid.cells[tuple(walls[few : 2 * few + 1].T)] = 0
    assert cache(grid, part) is not second and len(shown) == 3
    with pytest.raises(ConfigError, match="growth"):
        LayoutCache("rose2", growth=1.0)


@pytest.mark.parametrize(
    ("method", "options"),
    [
        ("morphological", {"depth": 0.0}),
        ("morphological", {"area_min": 50.0}),
        ("distance", {"area_max": -1.0}),
        ("voronoi", {"neighbourhood": 0}),
        ("voronoi", {"spacing": -0.1}),
    ],
)
def test_the_classic_methods_refuse_lengths_and_areas_that_cannot_be(method, options):
    with pytest.raises(ConfigError, match=next(iter(options))):
        reconstruct(OccupancyGrid(np.zeros((4, 4), np.int8), 0.1), method, options)


def test_numbers_of_every_kind_are_taken_and_flags_are_no_numbers():
    grid = OccupancyGrid(np.zeros((30, 30), np.int8), 0.1)
    config = {"room_area": 2, "chink": np.float32(0.25)}
    assert reconstruct(grid, "default", config).rooms[0].area == reconstruct(grid).rooms[0].area
    for method, options in (
        ("rose2", {"split": 1}),
        ("rose2", {"split_rounds": 1.5}),
        ("default", {"chink": True}),
    ):
        with pytest.raises(ConfigError, match=next(iter(options))):
            reconstruct(grid, method, options)
    with pytest.raises(ConfigError, match="chink"):
        reconstruct(grid, "default", dataclasses.replace(MergingConfig(), chink=float("nan")))


def test_ids_of_a_method_of_one_s_own_may_be_high_but_not_below_zero():
    grid = building(0.1)
    rooms = np.where(grid.free, 1 + (np.arange(grid.shape[1]) > grid.shape[1] // 2), 0).astype(np.int64)
    plain = reconstruct(grid, own_method(rooms))
    assert len(plain.rooms) == 2
    for high in (2**31, 2**32, 2**40):
        assert np.array_equal(reconstruct(grid, own_method(rooms * high)).labels, plain.labels)
    with pytest.raises(ConfigError, match="0 for none and above, got -2"):
        reconstruct(grid, own_method(-rooms))
    for odd in (rooms / 2, rooms[1:], (rooms, 2), None):
        with pytest.raises(ConfigError, match="gives no Layout: the room of each cell is a whole number"):
            reconstruct(grid, own_method(odd))


def test_a_method_of_one_s_own_may_change_the_grid_that_it_is_given():
    def walled_up(grid):
        grid.cells[:, :10] = 100
        return grid.free

    grid, name = building(0.1), f"own-{next(_NUMBERS)}"
    register_layout(name, "Shuts a strip.", lambda grid: walled_up(grid).astype(int))
    assert reconstruct(grid, name).rooms
    assert np.array_equal(grid.cells, building(0.1).cells)


def own_method(labels):
    """The name of a method that gives these labels, whatever the grid."""
    name = f"own-{next(_NUMBERS)}"
    register_layout(name, "Labels that are given.", lambda grid: labels)
    return name


_NUMBERS = itertools.count()
