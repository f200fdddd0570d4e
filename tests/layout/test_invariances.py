"""What must not matter: how a map is turned, mirrored, sampled, or lies in memory."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from layoutexplore.grids.boxes import known_box
from layoutexplore.grids.grid import OccupancyGrid, Pose
from layoutexplore.grids.ros_map import load_grid
from layoutexplore.layout.canonical import Orientation, canonical_orientation
from layoutexplore.layout.frame import to_world
from layoutexplore.layout.pipeline import METHOD_MODULES, reconstruct
from layoutexplore.maps.library import load_plan
from layoutexplore.speed.floors import half_explored

Move = Callable[[NDArray[np.generic]], NDArray[np.generic]]
MOVES: dict[str, tuple[Move, Move]] = {
    "quarter": (np.rot90, lambda a: np.rot90(a, -1)),
    "half": (lambda a: np.rot90(a, 2), lambda a: np.rot90(a, 2)),
    "left-right": (np.fliplr, np.fliplr),
    "up-down": (np.flipud, np.flipud),
    "transpose": (np.transpose, np.transpose),
}


@functools.cache
def generated(furniture: int = 0) -> OccupancyGrid:
    """A generated apartment, with boxes of furniture."""
    raster = load_plan("apartment:5").rasterize(0.1, margin=0.5)
    cells = np.select([raster.occupied, raster.free], [100, 0], -1).astype(np.int8)
    rng = np.random.default_rng(1)
    for row, col in np.argwhere(cells == 0)[rng.integers(0, (cells == 0).sum(), furniture)]:
        height, width = rng.integers(2, 9, 2)
        box = cells[row : row + height, col : col + width]
        box[box == 0] = 100
    cells.flags.writeable = False  # tests share it
    return OccupancyGrid(cells, 0.1)


@functools.cache
def noisy() -> OccupancyGrid:
    """The apartment as a bad sensor draws it: walls with holes and bumps, specks, unseen patches."""
    grid, rng = generated(10), np.random.default_rng(2)
    cells = grid.cells.copy()
    near = cv2.dilate(grid.occupied.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    cells[near & (rng.random(grid.shape) < 0.15)] = 100
    cells[grid.occupied & (rng.random(grid.shape) < 0.1)] = 0
    cells[rng.random(grid.shape) < 0.01] = -1
    cells.flags.writeable = False
    return OccupancyGrid(cells, grid.resolution)


MAPS: dict[str, Callable[[], OccupancyGrid]] = {
    "clean": generated,
    "furnished": lambda: generated(25),
    "noisy": noisy,
    "half explored": lambda: OccupancyGrid(half_explored(160, 180).copy(), 0.4),
}


def strays(a: NDArray[np.int32], b: NDArray[np.int32], steps: int = 2) -> int:
    """Cells of rooms farther than so many cells from the room's best match in the other labelling."""
    table = np.zeros((int(a.max()) + 1, int(b.max()) + 1), int)
    np.add.at(table, (a.ravel(), b.ravel()), 1)
    table[0] = table[:, 0] = 0
    pairs = {(i, j) for i, j in zip(*linear_sum_assignment(table, maximize=True), strict=True) if table[i, j]}
    kernel, count = np.ones((2 * steps + 1, 2 * steps + 1), np.uint8), 0
    for one, other, match in ((a, b, dict(pairs)), (b, a, {j: i for i, j in pairs})):
        for room in range(1, int(one.max()) + 1):
            near = cv2.dilate((other == match.get(room, -1)).astype(np.uint8), kernel) > 0
            count += int(((one == room) & ~near).sum())
    return count


def moved_labels(grid: OccupancyGrid, method: str, move: str) -> NDArray[np.int32]:
    """The labels of the moved map, moved back."""
    there, back = MOVES[move]
    turned = OccupancyGrid(np.ascontiguousarray(there(grid.cells)), grid.resolution)
    return np.ascontiguousarray(back(reconstruct(turned, method).labels))


ROOM_METHODS = [method for method in METHOD_MODULES if method != "rose"]


@pytest.mark.parametrize("method", ROOM_METHODS)
@pytest.mark.parametrize("name", list(MAPS))
def test_turned_and_mirrored_maps_give_the_same_rooms(name: str, method: str) -> None:
    grid = MAPS[name]()
    labels = reconstruct(grid, method).labels
    assert labels.max() >= 1
    for move in MOVES:
        assert strays(labels, moved_labels(grid, method, move)) == 0


@pytest.mark.parametrize("method", ["default", "rose2", "voronoi"])
@pytest.mark.parametrize("map_name", ["fr79_incremental/map5", "cluttered/intel_map"])
def test_scanned_maps_give_the_same_rooms_however_they_lie(
    data_dir: Path, map_name: str, method: str
) -> None:
    grid = load_grid(data_dir / "gridmaps" / f"{map_name}.png", resolution=0.05)
    labels = reconstruct(grid, method).labels
    assert labels.max() >= 1
    for move in ("quarter", "left-right"):
        assert strays(labels, moved_labels(grid, method, move)) == 0


@pytest.mark.parametrize("method", list(METHOD_MODULES))
@pytest.mark.parametrize("name", ["furnished", "noisy"])
def test_unknown_rows_and_columns_around_a_map_change_nothing(name: str, method: str) -> None:
    grid = MAPS[name]()
    row0, row1, col0, col1 = known_box(grid.cells)
    tight = np.ascontiguousarray(grid.cells[row0:row1, col0:col1])
    found = reconstruct(OccupancyGrid(tight, 0.1, Pose(3.0, -2.0, 0.4)), method)
    for low, high, left, right in ((1, 0, 0, 0), (0, 4, 3, 7), (40, 40, 40, 40)):
        cells = np.pad(tight, ((low, high), (left, right)), constant_values=-1)
        origin = to_world(np.array([(-0.1 * left, -0.1 * low)]), Pose(3.0, -2.0, 0.4))[0]
        wide = reconstruct(OccupancyGrid(cells, 0.1, Pose(*origin, 0.4)), method)
        inner = np.s_[low : low + len(tight), left : left + tight.shape[1]]
        assert (wide.labels[inner] == found.labels).all()
        assert (wide.clean_grid.cells[inner] == found.clean_grid.cells).all()
        np.testing.assert_allclose(wide.directions, found.directions)
        for one, other in zip(wide.rooms, found.rooms, strict=True):
            assert one.polygon.symmetric_difference(other.polygon).area < 1e-6


@pytest.mark.parametrize("method", ["rose2", "ias15", "distance"])
@pytest.mark.parametrize("move", list(MOVES))
def test_everything_found_lies_where_the_map_does(method: str, move: str) -> None:
    cells = np.ascontiguousarray(MOVES[move][0](generated().cells))
    layout = reconstruct(OccupancyGrid(cells, 0.1, Pose(3.0, -2.0, 0.4)), method)
    rows, cols = np.nonzero(layout.labels)
    centres = to_world(np.stack((cols + 0.5, rows + 0.5), axis=1) * 0.1, layout.clean_grid.origin)
    polygons = np.array([None, *(room.polygon for room in layout.rooms)])
    assert shapely.distance(polygons[layout.labels[rows, cols]], shapely.points(centres)).max() < 0.1
    assert all(shapely.is_ccw(room.polygon.exterior) for room in layout.rooms)
    assert (layout.directions == np.sort(layout.directions)).all()
    for side in (*layout.walls, *(line for line in layout.lines if not line.is_border)):
        along = np.subtract(side.end, side.start)
        assert side.angle == pytest.approx(layout.directions[side.direction])
        assert abs(np.cross(np.append(along, 0), (np.cos(side.angle), np.sin(side.angle), 0))[2]) < 1e-6
    occupied = shapely.MultiPoint(
        to_world((np.argwhere(cells == 100)[:, ::-1] + 0.5) * 0.1, layout.clean_grid.origin)
    )
    for x0, y0, x1, y1 in layout.segments:
        assert occupied.distance(shapely.Point((x0 + x1) / 2, (y0 + y1) / 2)) < 0.2
    for face in layout.faces:
        assert shapely.is_ccw(face.polygon.exterior)
        for edge in face.edges:
            middle = np.add(edge.start, edge.end) / 2
            inward = (
                np.subtract(edge.end, edge.start)[::-1]
                * (-1, 1)
                / max(np.hypot(*np.subtract(edge.end, edge.start)), 1e-9)
            )
            assert face.polygon.boundary.distance(shapely.Point(middle)) < 1e-6
            assert face.polygon.covers(shapely.Point(middle + 1e-4 * inward))
            if edge.neighbour >= 0:
                assert layout.faces[edge.neighbour].polygon.distance(shapely.Point(middle)) < 1e-6


@pytest.mark.parametrize("method", ["default", "rose2", "ias15", "rose"])
@pytest.mark.parametrize("theta", [0.0, np.pi / 2, 2.9, -1e-17, -np.pi])
def test_directions_rise_from_zero_to_pi_whatever_the_origin(method: str, theta: float) -> None:
    for move in (np.asarray, *(there for there, _ in MOVES.values())):
        cells = np.ascontiguousarray(move(generated().cells))
        layout = reconstruct(OccupancyGrid(cells, 0.1, Pose(1.0, 2.0, theta)), method)
        angles = layout.directions
        assert len(angles) and (angles == np.sort(angles)).all()
        for side in (*layout.walls, *layout.lines):
            angles = np.append(angles, side.angle)
            if side.direction >= 0:
                assert side.angle == layout.directions[side.direction]
        assert ((angles >= 0) & (angles < np.pi)).all()


@pytest.mark.parametrize("method", list(METHOD_MODULES))
def test_it_does_not_matter_how_the_cells_lie_in_memory(method: str) -> None:
    for cells in (generated().cells, np.ascontiguousarray(np.rot90(generated().cells))):
        layout = reconstruct(OccupancyGrid(cells, 0.1), method)
        frozen = cells.copy()
        frozen.flags.writeable = False
        part = np.pad(cells, 3)[3:-3, 3:-3]
        for same in (
            np.asfortranarray(cells),
            np.ascontiguousarray(cells[::-1, ::-1])[::-1, ::-1],
            frozen,
            part,
            cells.astype(int),
        ):
            again = reconstruct(OccupancyGrid(same, 0.1), method)
            assert np.array_equal(again.labels, layout.labels)
            assert np.array_equal(again.clean_grid.cells, layout.clean_grid.cells)
            assert [room.polygon for room in again.rooms] == [room.polygon for room in layout.rooms]


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(list(MOVES)), st.sampled_from(ROOM_METHODS))
def test_plans_of_random_boxes_give_the_same_rooms(seed: int, move: str, method: str) -> None:
    rng = np.random.default_rng(seed)
    cells = np.full((60, 75), -1, np.int8)
    for _ in range(6):
        row, col, height, width = *rng.integers(0, 45, 2), *rng.integers(8, 30, 2)
        cells[row : row + height, col : col + width] = 100
        cells[row + 1 : row + height - 1, col + 1 : col + width - 1] = 0
    grid = OccupancyGrid(cells, 0.1)
    assert strays(reconstruct(grid, method).labels, moved_labels(grid, method, move)) == 0


@settings(max_examples=60, deadline=None)
@given(
    hnp.arrays(
        np.int8, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.sampled_from([-1, 0, 100])
    )
)
def test_a_map_lies_the_same_way_however_it_came(cells: np.ndarray) -> None:
    orientation = canonical_orientation(cells)
    oriented = orientation.apply(cells)
    assert oriented.shape[0] <= oriented.shape[1]
    assert orientation.invert(oriented).tolist() == cells.tolist()
    assert canonical_orientation(oriented) == Orientation()
    free = np.argwhere(oriented == 0)
    if (
        len(free)
        and not (2 * free == np.array(oriented.shape) - 1).all()
        and oriented.shape[0] != oriented.shape[1]
    ):
        off_centre = (2 * free - np.array(oriented.shape) + 1).sum(axis=0)
        if off_centre.all():
            for there, _ in MOVES.values():
                other = np.ascontiguousarray(there(cells))
                assert canonical_orientation(other).apply(other).tolist() == oriented.tolist()


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("mirror", [(False, False), (True, False), (False, True), (True, True)])
def test_directions_are_brought_back_with_the_map(swap: bool, mirror: tuple[bool, bool]) -> None:
    orientation = Orientation(mirror_rows=mirror[0], mirror_cols=mirror[1], swap=swap)
    cells = np.zeros((40, 41), np.int8)
    for k in range(24):  # a line that rises by one in two
        cells[5 + k // 2, 8 + k] = 1
    rows, cols = np.nonzero(orientation.apply(cells))
    oriented = np.mod(np.arctan2(*(np.polyfit(cols, rows, 1)[0], 1.0)), np.pi)
    assert orientation.invert_angles(np.array([oriented]))[0] == pytest.approx(np.arctan(0.5), abs=0.06)


@pytest.mark.parametrize(("name", "share"), [("clean", 0.02), ("furnished", 0.1)])
def test_twice_the_cells_of_half_the_size_leave_the_rooms(name: str, share: float) -> None:
    grid = MAPS[name]()
    fine = OccupancyGrid(np.repeat(np.repeat(grid.cells, 2, axis=0), 2, axis=1), grid.resolution / 2)
    labels, again = reconstruct(grid).labels, reconstruct(fine).labels[::2, ::2]
    assert strays(labels, np.ascontiguousarray(again)) <= share * (labels > 0).sum()
