"""Walls and doors of rooms that share their outlines."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
import shapely.affinity
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.errors import MapError, MapWarning
from layoutexplore.grids.polygons import polygons_of
from layoutexplore.maps.shared_walls import (
    WALL_REACH,
    Opening,
    floors_between,
    plan_from_outlines,
    walls_along,
)
from tests.maps.cases import share_reached


@settings(deadline=None, max_examples=20)
@given(
    st.lists(st.floats(2.0, 8.0), min_size=2, max_size=4),
    st.floats(0.7, 1.4),
    st.floats(0.25, 0.75),
    st.floats(0.0, 0.3),
)
def test_a_row_of_rooms_can_be_walked_through_its_doors(
    sides: list[float], width: float, share: float, slit: float
) -> None:
    """Whatever the sizes, the place of the door and a slit between the outlines."""
    outlines, openings, left = {}, [], 0.0
    for number, side in enumerate(sides, start=1):
        outlines[number] = shapely.box(left, 0.0, left + side, 4.0)
        left += side + slit
        openings.append(Opening((left - slit / 2, 4.0 * share), width))
    plan = plan_from_outlines(outlines, {}, openings[:-1], name="row")
    assert [door.rooms for door in plan.doors] == [(k, k + 1) for k in range(1, len(sides))]
    assert all(door.width == pytest.approx(width) for door in plan.doors)
    assert share_reached(plan) > 0.99
    shut = plan.with_doors_closed(range(len(plan.doors)))
    assert share_reached(shut) < 0.99


@settings(deadline=None, max_examples=20)
@given(
    st.floats(2.0, 4.0),
    st.lists(st.floats(3.0, 6.0), min_size=1, max_size=3),
    st.floats(0.3, 0.7),
    st.just(0.0) | st.floats(0.01, 0.3),
    st.sampled_from([0.0, 17.0, 45.0, 80.0]),
)
def test_a_corridor_round_a_core_has_doors_to_the_rooms_in_it(
    wide: float, sides: list[float], share: float, slit: float, turned: float
) -> None:
    """Whatever the sizes, where the doors are and how the floor is turned; none leads outside."""
    hole = shapely.box(0, 0, sum(sides), 5.0)
    outlines, places, left = {1: shapely.box(-wide, -wide, sum(sides) + wide, 5.0 + wide) - hole}, [], 0.0
    for number, side in enumerate(sides, start=2):
        outlines[number] = shapely.box(left + slit / 2, slit / 2, left + side - slit / 2, 5.0 - slit / 2)
        places.append(shapely.Point(left + share * side, 0.0 if number % 2 else 5.0))
        left += side
    outlines = {k: shapely.affinity.rotate(v, turned, origin=(0, 0)) for k, v in outlines.items()}
    places = [shapely.affinity.rotate(place, turned, origin=(0, 0)) for place in places]
    plan = plan_from_outlines(outlines, {}, [Opening((p.x, p.y)) for p in places], name="core")
    assert [door.rooms for door in plan.doors] == [(1, number) for number in range(2, len(sides) + 2)]
    middles = [shapely.Point(np.mean([door.start, door.end], axis=0)) for door in plan.doors]
    assert all(middle.distance(place) < 0.5 for middle, place in zip(middles, places, strict=True))
    assert share_reached(plan) > 0.98


def test_holes_have_walls_and_no_edge_lies_between_rings() -> None:
    """The hole of a courtyard is as much a wall as the outside, and the way from ring to ring is none."""
    yard = shapely.box(0, 0, 30, 30) - shapely.box(10, 10, 20, 20) - shapely.box(22, 22, 26, 26)
    walls = walls_along([yard], "yard")
    along = shapely.union_all([shapely.LineString(ring.coords) for ring in (yard.exterior, *yard.interiors)])
    assert walls.hausdorff_distance(along) < 0.15
    with pytest.warns(MapWarning, match="1 of 2 doors"):
        plan = plan_from_outlines({1: yard}, {}, [Opening((15.0, 10.2)), Opening((5.0, 5.0))], name="yard")
    (door,) = plan.doors
    assert door.rooms == (0, 1) and {round(y, 6) for _, y in (door.start, door.end)} == {10.0}


def test_doors_to_the_outside_and_doors_on_no_wall() -> None:
    room = {5: shapely.box(0, 0, 6, 4)}
    with pytest.warns(MapWarning, match="1 of 2 doors lie on no wall"):
        plan = plan_from_outlines(room, {5: "hall"}, [Opening((3.0, 0.1)), Opening((3.0, 2.0))], name="hall")
    (door,) = plan.doors
    assert door.rooms == (0, 5) and {round(v, 6) for v in (door.start[1], door.end[1])} == {0.0}
    with pytest.raises(MapError, match="no room"):
        plan_from_outlines({}, {}, [], name="nothing")


@pytest.mark.parametrize(
    ("opening", "rooms"),
    [
        (Opening((3.45, 0.0)), (0, 1)),  # an entrance beside the wall between two rooms
        (Opening((3.9, 0.0)), (1, 2)),  # no entrance of 0.9 m fits so near to that wall
        (Opening((2.0, 2.0)), (1, 3)),  # of a room that is drawn over another
        (Opening((1.0, 0.0), rooms=(1, 4)), (0, 1)),  # the file names a room that is far away
        (Opening((4.0, 1.0), rooms=(0, 4)), (1, 2)),
    ],
)
def test_doors_join_what_lies_across_their_wall(opening: Opening, rooms: tuple[int, int]) -> None:
    shapes = [(0, 0, 4, 9), (4, 0, 8, 9), (1, 2, 3, 5), (50, 0, 54, 3)]
    outlines = {number: shapely.box(*shape) for number, shape in enumerate(shapes, start=1)}
    (door,) = plan_from_outlines(outlines, {}, [opening], name="pair").doors
    assert door.rooms == rooms
    assert math.dist(opening.place, np.mean([door.start, door.end], axis=0)) < 1.0


def test_floors_are_those_that_all_walls_leave() -> None:
    """Rooms cut out of the walls near them are those cut out of all walls; doors join the nearest rooms."""
    rng = np.random.default_rng(3)
    outlines, openings = {}, []
    for number in range(1, 50):
        row, col = divmod(number - 1, 7)
        x, y = 4.1 * col + rng.uniform(-0.1, 0.1), 4.1 * row + rng.uniform(-0.1, 0.1)
        outlines[number] = shapely.affinity.rotate(shapely.box(x, y, x + 3.7, y + 3.8), 0.3, origin=(0, 0))
        place = shapely.affinity.rotate(shapely.Point(x + 3.9, y + 2.0), 0.3, origin=(0, 0))
        openings.append(Opening((place.x, place.y)))
    walls = walls_along(list(outlines.values()), "grid")
    rooms, scraps = floors_between(outlines, walls, dict.fromkeys(outlines, ""))
    left_over = []
    for room in rooms:
        parts = sorted(polygons_of(outlines[room.id].difference(walls)), key=lambda part: -part.area)
        assert shapely.to_wkb(room.polygon) == shapely.to_wkb(parts[0])
        left_over += parts[1:]
    assert shapely.to_wkb(scraps) == shapely.to_wkb(shapely.union_all(left_over))
    doors = plan_from_outlines(outlines, {}, openings, name="grid").doors
    for opening, door in zip(openings, doors, strict=True):
        away = {k: outline.exterior.distance(shapely.Point(opening.place)) for k, outline in outlines.items()}
        nearest = sorted(away, key=lambda k: away[k])[:2]
        joined = sorted(k for k in nearest if away[k] <= WALL_REACH)
        assert door.rooms == (tuple(joined) if len(joined) == 2 else (0, *joined))


def test_doors_look_at_the_edges_near_them_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """A file of a megabyte has a room of ten thousand corners and thousands of doors."""
    made = 0
    linestrings = shapely.linestrings

    def counted(ends: np.ndarray) -> object:
        nonlocal made
        made += len(ends)
        return linestrings(ends)

    monkeypatch.setattr(shapely, "linestrings", counted)
    across = np.linspace(0.0, 20.0, 2001)
    border = list(zip(across.tolist(), (0.01 * np.sin(50 * across)).tolist(), strict=True))
    a = shapely.Polygon([*border, (20.0, 5.0), (0.0, 5.0)])
    b = shapely.Polygon([*border, (20.0, -5.0), (0.0, -5.0)])
    doors = [Opening((2.0 + 4.0 * k, 0.0)) for k in range(5)]
    plan = plan_from_outlines({1: a, 2: b}, {}, doors, name="wavy")
    assert [door.rooms for door in plan.doors] == [(1, 2)] * 5
    assert made < 5 * 2 * 100
    assert all(shapely.is_prepared(room) for room in (a, b))  # places are looked up, not compared with all


def test_outlines_closer_to_each_other_than_walls_are_thick_are_refused() -> None:
    zigzag = shapely.Polygon([*((0.01 * k, 20.0 * (k % 2)) for k in range(9000)), (90, 30), (0, 30)])
    with pytest.raises(MapError, match=r"50000 pairs of edges lie within 0.2 m of each other"):
        plan_from_outlines({1: zigzag}, {}, [], name="comb")


def test_corners_along_a_curve_are_no_crowd() -> None:
    angle = np.linspace(0.0, 2 * np.pi, 20_000)
    disc = shapely.Polygon(np.stack([9 * np.cos(angle), 9 * np.sin(angle)], axis=1))
    assert plan_from_outlines({1: disc}, {}, [Opening((9.0, 0.0))], name="disc").doors[0].rooms == (0, 1)


def test_many_houses_apart_are_read() -> None:
    houses = {
        k: shapely.box(9 * (k % 40), 9 * (k // 40), 9 * (k % 40) + 5, 9 * (k // 40) + 5)
        for k in range(1, 1600)
    }
    plan = plan_from_outlines(houses, {}, [], name="village")
    assert len(plan.rooms) == len(houses)


def test_rooms_around_each_other_are_cut_or_refused() -> None:
    def nested(count: int) -> dict[int, shapely.Polygon]:
        return {k + 1: shapely.box(k, k, 1800 - k, 1800 - k) for k in range(count)}

    plan = plan_from_outlines(nested(150), {}, [], name="onion")
    areas = [room.polygon.area for room in plan.rooms]
    assert areas[0] == pytest.approx(1799.8**2 - 1798.2**2) and areas[-1] == pytest.approx(1501.8**2)
    assert shapely.union_all([room.polygon for room in plan.rooms]).area == pytest.approx(sum(areas))
    for count, said in (
        (250, "31125 pairs of them, and at most 20000"),
        (800, "319600 pairs of rooms of which"),
    ):
        with pytest.raises(MapError, match=f"onion: .*{said}"):
            plan_from_outlines(nested(count), {}, [], name="onion")


def test_an_outline_of_which_rooms_leave_nothing_but_walls_is_no_room() -> None:
    """Rooms up to the faces of walls of 0.3 m, the building around them, and a hall around a room."""
    rooms = {k: shapely.box(4 * k + 0.3, 0.3, 4 * k + 4, 3.7) for k in range(1, 4)}
    building, hall = shapely.box(4, 0, 16.3, 4), shapely.box(30, 0, 40, 10)
    outlines = {9: building, **rooms, 5: hall, 6: shapely.box(31, 1, 39, 9)}
    with pytest.warns(MapWarning, match="house: 1 of 6 rooms are the sum of others"):
        plan = plan_from_outlines(outlines, {}, [Opening((8.15, 2.0))], name="house")
    assert [room.id for room in plan.rooms] == [1, 2, 3, 5, 6]
    assert [door.rooms for door in plan.doors] == [(1, 2)]
