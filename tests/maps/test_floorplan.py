"""Floor plans and their rasters."""

from __future__ import annotations

import dataclasses
import math
import pickle

import cv2
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from shapely import LineString, Polygon

from layoutexplore.errors import MapError
from layoutexplore.grids.grid import Cell, Pose
from layoutexplore.grids.morphology import grow
from layoutexplore.maps.floorplan import Door, FloorPlan, PlanRaster, Room
from layoutexplore.maps.tracing import floorplan_from_ascii
from tests.plans import TWO_ROOMS

with np.errstate(invalid="ignore"):
    NOT_FINITE = Polygon([(0, 0), (math.nan, 2), (2, 0)])


def two_rooms(*, gap: float = 0.9, thickness: float = 0.2, **changes: object) -> FloorPlan:
    """Two rooms of 4 x 3 m with a door in the wall between them."""
    a, b = shapely.box(0.0, 0.0, 4.0, 3.0), shapely.box(4.0 + thickness, 0.0, 8.0 + thickness, 3.0)
    hull = shapely.box(-0.2, -0.2, 8.2 + thickness, 3.2)
    middle = 4.0 + thickness / 2
    door = Door(start=(middle, 1.0), end=(middle, 1.0 + gap), rooms=(1, 2))
    walls = hull.difference(a.union(b)).difference(shapely.box(3.9, 1.0, 4.1 + thickness, 1.0 + gap))
    plan = FloorPlan(
        name="two",
        rooms=(Room(id=1, polygon=a, label="office"), Room(id=2, polygon=b)),
        doors=(door,),
        walls=walls,
    )
    return dataclasses.replace(plan, **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize("resolution", [0.05, 0.1, 0.2, 0.25])
@pytest.mark.parametrize("thickness", [0.02, 0.1, 0.2, 0.37])
def test_a_door_joins_two_rooms_and_closes(resolution: float, thickness: float) -> None:
    plan = two_rooms(thickness=thickness)
    opened, closed = plan.rasterize(resolution), plan.with_doors_closed([0]).rasterize(resolution)
    assert set(np.unique(opened.room_ids[opened.reachable(0.2)])) >= {1, 2}
    assert len(set(np.unique(closed.room_ids[closed.reachable(0.2)])) & {1, 2}) == 1
    assert cv2.connectedComponents(closed.free.astype(np.uint8), connectivity=8)[0] == 3


def test_free_area_is_that_of_the_rooms() -> None:
    raster = two_rooms().rasterize(0.05)
    assert raster.free.sum() * 0.05**2 == pytest.approx(24.0 + 0.9 * 0.2, abs=0.05)
    assert (raster.room_ids == 1).sum() * 0.05**2 == pytest.approx(12.0, abs=0.02)
    assert not raster.room_ids[raster.occupied].any()
    assert raster.room_ids.dtype == np.int32
    assert raster.occupied.flags.c_contiguous


def test_everything_outside_is_solid_and_the_border_is_closed() -> None:
    raster = two_rooms().rasterize(0.1, margin=0.0)
    for edge in (raster.occupied[0], raster.occupied[-1], raster.occupied[:, 0], raster.occupied[:, -1]):
        assert edge.all()


def test_the_margin_is_solid() -> None:
    raster = two_rooms().rasterize(0.1, margin=1.0)
    x, y = raster.cell_to_world(0, 0)
    assert x < -1.1
    assert y < -1.1
    assert raster.occupied[:10].all()


def test_cells_and_world_agree_with_the_grid() -> None:
    raster = two_rooms().rasterize(0.1)
    cell = raster.world_to_cell(2.0, 1.5)
    assert raster.room_ids[cell] == 1
    assert raster.world_to_cell(*raster.cell_to_world(*cell)) == cell
    assert raster.grid.cells[cell] == 0
    assert raster.grid.origin == raster.origin


def test_rasters_are_shared() -> None:
    plan = two_rooms()
    assert plan.rasterize(0.1) is plan.rasterize(0.1)
    assert plan.rasterize(0.1).blocked(0.2) is plan.rasterize(0.1).blocked(0.2)
    assert plan.rasterize(0.1) is not plan.rasterize(0.1, margin=1.0)


def test_furniture_is_solid_and_keeps_its_room_number_off() -> None:
    table = shapely.box(1.0, 1.0, 2.0, 2.0)
    raster = two_rooms(furniture=table).rasterize(0.1)
    cell = raster.world_to_cell(1.5, 1.5)
    assert raster.occupied[cell]
    assert raster.room_ids[cell] == 0


def test_a_smaller_room_lies_on_top_of_a_larger_one() -> None:
    rooms = (Room(id=1, polygon=shapely.box(1, 1, 2, 2)), Room(id=2, polygon=shapely.box(0, 0, 5, 5)))
    raster = FloorPlan(name="nested", rooms=rooms).rasterize(0.5)
    assert raster.room_ids[raster.world_to_cell(1.5, 1.5)] == 1


def test_passages_are_free_and_no_room() -> None:
    raster = two_rooms(passages=shapely.box(8.0, 1.0, 12.0, 2.0)).rasterize(0.1)
    cell = raster.world_to_cell(10.0, 1.5)
    assert not raster.occupied[cell]
    assert raster.room_ids[cell] == 0


def test_an_outside_door_opens_only_its_wall() -> None:
    door = Door(start=(0.0, 1.0), end=(0.0, 2.0), rooms=(0, 1))
    plan = two_rooms(doors=(door,))
    assert plan.rasterize(0.1).free.sum() == pytest.approx(
        two_rooms(doors=()).rasterize(0.1).free.sum(), abs=12
    )


def test_reachable_from_a_start() -> None:
    raster = two_rooms().with_doors_closed([0]).rasterize(0.1)
    left, right = raster.world_to_cell(1.0, 1.0), raster.world_to_cell(6.0, 1.0)
    assert raster.reachable(0.2, left)[left]
    assert not raster.reachable(0.2, left)[right]
    assert not raster.reachable(0.2, Cell(0, 0)).any()
    assert not raster.reachable(0.2, Cell(-1, 5)).any()
    assert not raster.coverage_target(0.2, left)[right]
    assert raster.coverage_target(0.2, left)[left]


def test_a_robot_that_fits_nowhere() -> None:
    with pytest.raises(MapError, match="fits nowhere"):
        two_rooms().rasterize(0.1).reachable(5.0)


def test_the_target_reaches_0_8_m_beyond_the_robot() -> None:
    """A slot that is too narrow for the robot counts for 0.8 m beyond the last place it can be."""
    plan = floorplan_from_ascii(
        "#" * 42 + "\n" + ("#" + "a" * 10 + "#" * 31 + "\n") * 4 + "#" + "a" * 40 + "#\n" + "#" * 42, 0.1
    )
    raster = plan.rasterize(0.1, margin=0.0)
    row = raster.world_to_cell(3.0, 0.15).row
    target, reachable = raster.coverage_target(0.2), raster.reachable(0.2)
    seen = np.flatnonzero(target[row])
    assert not reachable[row].any()
    last = np.argwhere(reachable)[:, 1].max()
    assert 0.6 < (seen.max() - last) * 0.1 <= 0.8


@settings(deadline=None, max_examples=40)
@given(arrays(np.bool_, (9, 9)), arrays(np.bool_, (9, 9)), st.floats(0.5, 6.0))
def test_grow_is_a_bounded_geodesic(free: NDArray[np.bool_], seeds: NDArray[np.bool_], limit: float) -> None:
    distance = np.where(seeds & free, 0.0, np.inf)
    for _ in range(81):  # relax every step until nothing changes
        before = distance.copy()
        for r, c in np.argwhere(free):
            for dr, dc in ((0, 1), (1, 0), (1, 1), (1, -1), (0, -1), (-1, 0), (-1, -1), (-1, 1)):
                rr, cc = r + dr, c + dc
                if 0 <= rr < 9 and 0 <= cc < 9 and free[rr, cc] and free[r, cc] and free[rr, c]:
                    distance[rr, cc] = min(distance[rr, cc], distance[r, c] + math.hypot(dr, dc))
        if np.array_equal(before, distance):
            break
    clear = np.abs(distance - limit) > 1e-3
    assert np.array_equal(grow(seeds, free, limit)[clear], (distance <= limit)[clear])


def test_ascii_rooms_doors_and_walls() -> None:
    plan = floorplan_from_ascii(TWO_ROOMS, 0.5, name="drawn")
    assert [(room.id, room.label, room.polygon.area) for room in plan.rooms] == [(1, "a", 3.0), (2, "b", 3.0)]
    (door,) = plan.doors
    assert (door.start, door.end, door.rooms) == ((2.75, 1.0), (2.75, 1.5), (1, 2))
    raster = plan.rasterize(0.5, margin=0.5)
    assert raster.shape == (7, 13)
    assert raster.free.sum() == 25


def test_ascii_separate_areas_of_a_letter_are_separate_rooms() -> None:
    plan = floorplan_from_ascii("#####\n#a#a#\n#####", 1.0)
    assert [room.label for room in plan.rooms] == ["a", "a"]


def test_rooms_that_touch_have_a_door_between_them() -> None:
    plan = floorplan_from_ascii("######\n#aabb#\n#aabb#\n######", 1.0)
    (door,) = plan.doors
    assert (door.start, door.end, door.rooms) == ((3.0, 1.0), (3.0, 3.0), (1, 2))


def test_the_top_line_of_a_drawing_is_the_highest_y() -> None:
    plan = floorplan_from_ascii("aaa\n###\nbbb", 1.0)
    high, low = (next(room for room in plan.rooms if room.label == label) for label in "ab")
    assert high.polygon.bounds[1] == 2.0
    assert low.polygon.bounds[1] == 0.0


@pytest.mark.parametrize("resolution", [0.1, 0.2, 0.25, 0.05, 0.13])
def test_a_thin_wall_of_an_image_stays_closed_at_any_resolution(resolution: float) -> None:
    occupied = np.zeros((81, 81), np.bool_)
    occupied[[0, -1]] = occupied[:, [0, -1]] = True
    occupied[np.arange(81), np.arange(81)] = True
    occupied[np.arange(80), np.arange(1, 81)] = True  # a diagonal, 4-connected wall of 1 cell
    occupied[40, :40] = True
    plan = FloorPlan(name="thin", source=PlanRaster(occupied, np.zeros((81, 81), np.int32), 0.05))
    raster = plan.rasterize(resolution)
    assert cv2.connectedComponents(raster.free.astype(np.uint8), connectivity=8)[0] == 4


def test_a_plan_of_an_image_closes_its_doors() -> None:
    plan = floorplan_from_ascii(TWO_ROOMS, 0.5)
    closed = plan.with_doors_closed([0]).rasterize(0.1)
    assert cv2.connectedComponents(closed.free.astype(np.uint8), connectivity=8)[0] == 3


@pytest.mark.parametrize(("x", "y"), [(1.25, 0.8), (0.87, 1.13), (2.0, 2.0)])
def test_stretched_shapes_keep_their_rooms_and_doors(x: float, y: float) -> None:
    plan = two_rooms(furniture=shapely.box(1, 1, 2, 2)).stretched(x, y)
    assert [room.polygon.area for room in plan.rooms] == pytest.approx([12.0 * x * y] * 2)
    assert plan.furniture.area == pytest.approx(x * y) and plan.doors[0].width == pytest.approx(0.9 * y)
    raster = plan.rasterize(0.05)
    assert cv2.connectedComponents(raster.free.astype(np.uint8), connectivity=4)[0] == 2
    assert raster.free.sum() * 0.05**2 == pytest.approx(
        two_rooms().rasterize(0.05).free.sum() * 0.05**2 * x * y - x * y, rel=0.02
    )


@pytest.mark.parametrize(("x", "y"), [(1.25, 0.8), (0.87, 1.13), (0.5, 1.0)])
def test_a_stretched_image_keeps_its_thin_walls_and_its_rooms(x: float, y: float) -> None:
    occupied, rooms = np.zeros((61, 81), np.bool_), np.ones((61, 81), np.int32)
    occupied[[0, -1]] = occupied[:, [0, -1]] = True
    occupied[:, 37] = occupied[23, 37:] = True  # walls of one cell
    rooms[:, 38:] = 2
    rooms[24:, 38:] = 3
    rooms[occupied] = 0
    plan = FloorPlan(name="image", source=PlanRaster(occupied, rooms, 0.05, Pose(2.0, -4.0, 0.0))).stretched(
        x, y
    )
    assert plan.source is not None and plan.source.shape == (round(61 * y), round(81 * x))
    assert plan.bounds[:2] == (2.0 * x, -4.0 * y)
    count, parts = cv2.connectedComponents(plan.source.free.astype(np.uint8), connectivity=8)
    assert count == 4
    for part in range(1, count):
        assert len(np.unique(plan.source.room_ids[parts == part])) == 1
    areas = np.bincount(plan.source.room_ids.ravel())[1:] / (x * y)
    np.testing.assert_allclose(areas, np.bincount(rooms.ravel())[1:], rtol=0.1)


@pytest.mark.parametrize("factors", [(0.0, 1.0), (1.0, -1.0), (math.nan, 1.0), (1.0, math.inf)])
def test_senseless_factors(factors: tuple[float, float]) -> None:
    with pytest.raises(MapError, match="'two' can be stretched by finite factors above 0"):
        two_rooms().stretched(*factors)


def test_content_hash_sees_geometry_and_only_geometry() -> None:
    plan = two_rooms()
    assert plan.content_hash == two_rooms().content_hash
    assert plan.content_hash == two_rooms(name="other", metadata={"a": "b"}, building="x").content_hash
    changed = [two_rooms(gap=1.0), two_rooms(furniture=shapely.box(1, 1, 2, 2)), plan.with_doors_closed([0])]
    drawn = [floorplan_from_ascii(TWO_ROOMS, resolution) for resolution in (0.5, 1.0)]
    assert len({p.content_hash for p in [plan, *changed, *drawn]}) == 6


def test_bounds_and_area() -> None:
    assert two_rooms().bounds == pytest.approx((-0.2, -0.2, 8.4, 3.2))
    assert two_rooms().area == pytest.approx(24.0)


def test_plans_travel_to_other_processes() -> None:
    plan = two_rooms()
    copy = pickle.loads(pickle.dumps(plan))
    assert copy.content_hash == plan.content_hash
    assert np.array_equal(copy.rasterize(0.1).occupied, plan.rasterize(0.1).occupied)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rooms": (), "doors": ()}, "no free space"),
        ({"name": ""}, "needs a name"),
        ({"rooms": (Room(id=1, polygon=shapely.box(0, 0, 1, 1)),) * 2}, "room ids"),
        ({"rooms": (Room(id=0, polygon=shapely.box(0, 0, 1, 1)),)}, "room ids"),
        (
            {"rooms": (Room(id=1, polygon=Polygon()), Room(id=2, polygon=shapely.box(0, 0, 1, 1)))},
            "room 1: the polygon is empty",
        ),
        ({"walls": Polygon([(0, 0), (2, 2), (2, 0), (0, 2)])}, "walls: Self-intersection"),
        ({"furniture": LineString([(0, 0), (1, 1)])}, "furniture: must be polygons"),
        ({"walls": NOT_FINITE}, "walls: a coordinate is not a finite number"),
        ({"doors": (Door(start=(0, 0), end=(1, 0), rooms=(1, 7)),)}, "door 0: there is no room 7"),
        (
            {"doors": (Door(start=(0, 0), end=(0, 0), rooms=(1, 2)),)},
            "door 0: needs two different finite ends",
        ),
        (
            {"doors": (Door(start=(0, math.inf), end=(0, 0), rooms=(1, 2)),)},
            "door 0: needs two different finite ends",
        ),
    ],
)
def test_contradictions_are_named(change: dict[str, object], message: str) -> None:
    with pytest.raises(MapError, match=message):
        two_rooms(**change)


@pytest.mark.parametrize("resolution", [0.0, -0.1, math.nan, math.inf])
def test_bad_resolutions(resolution: float) -> None:
    with pytest.raises(MapError, match="resolution"):
        two_rooms().rasterize(resolution)


def test_bad_margins_and_doors_and_sizes() -> None:
    with pytest.raises(MapError, match="margin"):
        two_rooms().rasterize(0.1, margin=-1.0)
    with pytest.raises(MapError, match="no door 3"):
        two_rooms().with_doors_closed([3])
    with pytest.raises(MapError, match="coarser"):
        two_rooms().rasterize(1e-5)


def test_no_free_space() -> None:
    with pytest.raises(MapError, match="no free space"):
        two_rooms(walls=shapely.box(-1, -1, 10, 10)).rasterize(0.1)
    with pytest.raises(MapError, match="no free space"):
        PlanRaster(np.ones((3, 3), np.bool_), np.zeros((3, 3), np.int32), 0.1)
    with pytest.raises(MapError, match="empty"):
        floorplan_from_ascii("\n")


def test_raster_shapes_must_fit() -> None:
    with pytest.raises(MapError, match="equal"):
        PlanRaster(np.zeros((3, 3), np.bool_), np.zeros((3, 4), np.int32), 0.1)


def test_a_turned_source_keeps_its_origin() -> None:
    source = PlanRaster(np.zeros((4, 6), np.bool_), np.ones((4, 6), np.int32), 0.5, Pose(1.0, 2.0, 0.0))
    raster = FloorPlan(
        name="moved", source=source, rooms=(Room(id=1, polygon=shapely.box(1, 2, 4, 4)),)
    ).rasterize(0.5)
    assert raster.room_ids[raster.world_to_cell(1.1, 2.1)] == 1
    assert raster.occupied[raster.world_to_cell(0.9, 2.1)]
