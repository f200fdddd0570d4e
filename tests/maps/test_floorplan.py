"""Floor plans and their rasters."""

from __future__ import annotations

import dataclasses
import math
import pickle

import cv2
import numpy as np
import pytest
import shapely
from shapely import LineString, Polygon

from layoutexplore.errors import MapError
from layoutexplore.grids.grid import Pose
from layoutexplore.maps.floorplan import Door, FloorPlan, PlanRaster, Room
from layoutexplore.maps.tracing import floorplan_from_ascii
from tests.maps.cases import two_rooms
from tests.plans import TWO_ROOMS

with np.errstate(invalid="ignore"):
    NOT_FINITE = Polygon([(0, 0), (math.nan, 2), (2, 0)])


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
    assert raster.room_ids.dtype == np.int16
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


SPIKE = shapely.Polygon(
    [
        (37.08073343332953, -44.344119456944),
        (37.126879985133144, -44.344119456944),
        (37.11300295791095, -44.888885042883004),
        (37.125606315542, -44.394119456944004),
        (37.03073343332952, -44.394119456944004),
        (37.03073343332952, -42.54000230760359),
        (37.08073343332953, -42.54000230760359),
    ]
)
"""A valid outline with a spike whose sides cross once its corners are rounded elsewhere."""


@pytest.mark.parametrize("several", [False, True])
def test_an_outline_that_rounding_crosses_is_mended(several: bool) -> None:
    passages = shapely.MultiPolygon([SPIKE, shapely.box(30, -44, 31, -43)]) if several else SPIKE
    room = Room(id=3, polygon=SPIKE)
    x, y = 1.06744229382271, 0.8572109666688612
    plan = FloorPlan(name="spiked", rooms=(room,), passages=passages).stretched(x, y)
    assert not shapely.transform(SPIKE, lambda points: points * [x, y]).is_valid
    assert plan.passages.area == pytest.approx(passages.area * x * y, rel=1e-6)
    assert plan.rooms[0].polygon.area == pytest.approx(SPIKE.area * x * y, rel=1e-6)


@pytest.mark.parametrize("factors", [(0.0, 1.0), (1.0, -1.0), (math.nan, 1.0), (1.0, math.inf)])
def test_senseless_factors(factors: tuple[float, float]) -> None:
    with pytest.raises(MapError, match="'two' can be stretched by finite factors above 0"):
        two_rooms().stretched(*factors)


@pytest.mark.parametrize("degrees", [0.0, 17.0, 90.0, -150.0])
def test_turned_plans_are_the_same_building(degrees: float) -> None:
    plan = two_rooms(furniture=shapely.box(1, 1, 2, 2))
    turned = plan.turned(math.radians(degrees))
    assert [room.polygon.area for room in turned.rooms] == pytest.approx([12.0, 12.0])
    assert turned.doors[0].width == pytest.approx(0.9) and turned.furniture.area == pytest.approx(1.0)
    raster = turned.rasterize(0.05)
    assert cv2.connectedComponents(raster.free.astype(np.uint8), connectivity=4)[0] == 2
    assert raster.free.sum() == pytest.approx(plan.rasterize(0.05).free.sum(), rel=0.03)
    back = turned.turned(-math.radians(degrees))
    assert back.bounds == pytest.approx(plan.bounds, abs=1e-9)


def test_what_cannot_be_turned() -> None:
    with pytest.raises(MapError, match="'two' can be turned by a finite angle"):
        two_rooms().turned(math.inf)
    image = two_rooms(source=two_rooms().rasterize(0.1))
    with pytest.raises(MapError, match="unless it is an image"):
        image.turned(0.1)


def test_content_hash_sees_geometry_and_only_geometry() -> None:
    plan = two_rooms()
    assert plan.content_hash == two_rooms().content_hash
    assert plan.content_hash == two_rooms(name="other", metadata={"a": "b"}, building="x").content_hash
    changed = [two_rooms(gap=1.0), two_rooms(furniture=shapely.box(1, 1, 2, 2)), plan.with_doors_closed([0])]
    drawn = [floorplan_from_ascii(TWO_ROOMS, resolution) for resolution in (0.5, 1.0)]
    assert len({p.content_hash for p in [plan, *changed, *drawn]}) == 6


def test_raster_hash_sees_ids_and_the_rooms_of_doors() -> None:
    """How deep an opening cuts depends on them: where a wall is thick, whether it leads through."""
    a, b = shapely.box(0, 0, 3, 3), shapely.box(3.4, 0, 6.4, 3)
    walls = shapely.box(3, 0, 3.4, 3).difference(shapely.box(3, 1, 3.4, 2))

    def plan(ids: tuple[int, int], rooms: tuple[int, int]) -> FloorPlan:
        door = Door(start=(3.2, 1), end=(3.2, 2), rooms=rooms)
        both = Room(id=ids[0], polygon=a), Room(id=ids[1], polygon=b)
        return FloorPlan(name="p", rooms=both, doors=(door,), walls=walls)

    plans = [plan((1, 2), (1, 2)), plan((1, 2), (0, 0)), plan((3, 7), (3, 7))]
    assert (
        len({p.content_hash for p in plans}) == 1 and len({p.rasterize(0.1).free.sum() for p in plans}) == 2
    )
    assert len({p.raster_hash for p in [*plans, plan((1, 2), (2, 1))]}) == 3
    drawn = plans[0].rasterize(0.1)
    sources = [
        drawn,
        *(
            dataclasses.replace(drawn, **c)
            for c in ({"room_ids": 2 * drawn.room_ids}, {"origin": Pose(1, 0, 0)})
        ),
    ]
    assert len({dataclasses.replace(plans[0], source=source).raster_hash for source in sources}) == 3


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
        (
            {"rooms": (Room(id=1, polygon=shapely.box(0, 0, 1e-300, 1e-300)),)},
            "room 1: the polygon has no area",
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
    far = (Room(id=1, polygon=shapely.box(0, 0, 5, 5)), Room(id=2, polygon=shapely.box(9e7, 0, 9e7 + 5, 5)))
    with pytest.raises(MapError, match=r"reaches over 9e\+07 x 5 m, .* a part lies astray"):
        FloorPlan(name="far", rooms=far).rasterize(0.05)


def test_no_free_space() -> None:
    with pytest.raises(MapError, match="no free space"):
        two_rooms(walls=shapely.box(-1, -1, 10, 10)).rasterize(0.1)
    with pytest.raises(MapError, match="no free space"):
        PlanRaster(np.ones((3, 3), np.bool_), np.zeros((3, 3), np.int32), 0.1)
    with pytest.raises(MapError, match="empty"):
        floorplan_from_ascii("\n")


def test_outlines_too_dense_for_the_cells_are_refused() -> None:
    comb = shapely.Polygon([*((0.002 * k, 190.0 * (k % 2)) for k in range(40_000)), (80, 200), (0, 200)])
    with pytest.raises(MapError, match="outlines are too dense for cells"):
        FloorPlan(name="comb", rooms=(Room(id=1, polygon=comb),)).rasterize(0.05)
    nested = [Room(id=k, polygon=shapely.box(0, 0, 100, 90 + 0.01 * k)) for k in range(1, 1000)]
    with pytest.raises(MapError, match="or too many lie over each other"):
        FloorPlan(name="nested", rooms=tuple(nested)).rasterize(0.05)
    long = [Door(start=(0.0, 0.01 * k), end=(600.0, 0.01 * k)) for k in range(4900)]
    hall = Room(id=1, polygon=shapely.box(0, 0, 600, 50))
    with pytest.raises(MapError, match="or too many lie over each other"):
        FloorPlan(name="doors", rooms=(hall,), doors=tuple(long)).rasterize(0.05)
