"""Prior plans: scales, doors that are assumed, and plans that tell nothing."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
import shapely
import shapely.affinity

from layoutexplore.errors import ConfigError, MapError
from layoutexplore.maps.floorplan import Door, FloorPlan, Room
from layoutexplore.priors.plan import (
    PriorHints,
    PriorPlan,
    expected_scale,
    prior_of_plan,
    prior_of_rooms,
    with_doors_to_all,
    with_expected_scale,
)
from tests.priors.cases import office


def parts(prior: PriorPlan) -> int:
    return int(cv2.connectedComponents(prior.free.astype(np.uint8), connectivity=4)[0]) - 1


def test_a_plan_keeps_its_metres() -> None:
    prior = prior_of_plan(office())
    assert prior.rooms == 11 and not prior.unused and prior.resolution == pytest.approx(0.1)
    assert prior.size[0] == pytest.approx(31.0, abs=0.5)


def test_a_told_scale_stretches_it() -> None:
    prior = prior_of_plan(office(), PriorHints(scale=2.0))
    assert prior.size[0] == pytest.approx(62.0, abs=1.0)
    assert prior.scale_spread < prior_of_plan(office()).scale_spread


@pytest.mark.parametrize("factor", [0.02, 1.0, 30.0])
def test_the_expected_scale_does_not_depend_on_the_unit(factor: float) -> None:
    prior = prior_of_plan(office())
    rescaled = with_expected_scale(prior.rescaled(factor, 0.3))
    assert rescaled.resolution == pytest.approx(with_expected_scale(prior).resolution, rel=1e-6)
    assert 0.7 < expected_scale(prior)[0] < 1.4


def test_the_expected_scale_does_not_depend_on_the_numbers_of_the_rooms() -> None:
    prior = prior_of_plan(office())
    apart = replace(prior, room_ids=3 * prior.room_ids)
    assert expected_scale(apart) == expected_scale(prior)


def test_rooms_alone_get_doors_and_a_scale() -> None:
    polygons = [shapely.affinity.scale(room.polygon, 40, 40, origin=(0, 0)) for room in office().rooms]
    prior = prior_of_rooms(polygons)
    assert prior.rooms == 11 and parts(prior) == 1
    assert 20 < prior.size[0] < 45


def test_a_room_without_a_door_opens_to_its_neighbour() -> None:
    closed = FloorPlan(name="closed", rooms=office().rooms)
    assert parts(prior_of_plan(closed)) == 1


def test_a_courtyard_stays_shut() -> None:
    court = Room(id=99, polygon=shapely.box(40.0, 0.0, 60.0, 11.0))
    prior = prior_of_plan(FloorPlan(name="court", rooms=(*office().rooms, court), doors=office().doors))
    assert parts(prior) == 2


def in_unit(plan: FloorPlan, unit: float) -> FloorPlan:
    """The plan with lengths in another unit, `unit` of them a metre."""
    return FloorPlan(
        name=plan.name,
        rooms=tuple(
            Room(id=room.id, polygon=shapely.transform(room.polygon, lambda points: points * unit))
            for room in plan.rooms
        ),
        doors=tuple(
            Door(
                start=(door.start[0] * unit, door.start[1] * unit),
                end=(door.end[0] * unit, door.end[1] * unit),
                rooms=door.rooms,
            )
            for door in plan.doors
        ),
    )


def test_rooms_whose_scale_is_told_are_believed() -> None:
    halls = [shapely.box(x, 0.0, x + 0.4, 0.4) for x in (0.0, 0.41, 0.82)]
    assert not prior_of_rooms(halls, hints=PriorHints(scale=100.0)).unused
    assert (
        "tell its scale"
        in prior_of_rooms(
            [shapely.affinity.scale(h, 100, 100, origin=(0, 0)) for h in halls], metric=True
        ).unused
    )


def test_a_start_among_rooms_is_told_in_their_unit() -> None:
    rooms = [room.polygon for room in office().rooms]
    feet = [shapely.affinity.scale(room, 3.281, 3.281, origin=(0, 0)) for room in rooms]
    metres = prior_of_rooms(rooms, hints=PriorHints(here=(21.0, 6.0)), metric=True)
    told = prior_of_rooms(feet, hints=PriorHints(here=(68.901, 19.686), scale=1 / 3.281))
    assert metres.hints.here == pytest.approx(told.hints.here)
    plan = prior_of_plan(office(), PriorHints(here=(21.0, 6.0)))
    assert metres.hints.here == pytest.approx(plan.hints.here)


def test_a_plan_of_one_room_is_not_used_and_says_why() -> None:
    prior = prior_of_plan(FloorPlan(name="hall", rooms=(Room(id=1, polygon=shapely.box(0, 0, 20, 10)),)))
    assert "1 room" in prior.unused


def test_a_plan_longer_than_any_building_is_not_used_and_says_why() -> None:
    far = Room(id=99, polygon=shapely.box(0.0, 2496.0, 4.0, 2500.0))
    prior = prior_of_plan(replace(office(), rooms=(*office().rooms, far)), PriorHints(scale=1.0))
    assert "2.5e+03 m long" in prior.unused
    assert prior.rescaled(0.5, 0.04).unused == ""


@pytest.mark.parametrize(("factor", "what"), [(1e-3, "m2 of floor in all"), (1e3, "m2 of floor: check")])
def test_a_plan_in_another_unit_is_not_used_and_says_why(factor: float, what: str) -> None:
    prior = prior_of_plan(office()).rescaled(factor, 0.04)
    assert what in prior.unused and "unit" in prior.unused


@pytest.mark.parametrize(
    ("unit", "what"), [(3.281, "doors are"), (39.4, "check its unit"), (0.2, "check its unit")]
)
def test_a_floor_plan_in_feet_or_inches_is_not_used_unless_its_scale_is_told(unit: float, what: str) -> None:
    plan = in_unit(office(), unit)
    assert what in prior_of_plan(plan).unused and "tell its scale" in prior_of_plan(plan).unused
    told = prior_of_plan(plan, PriorHints(scale=1 / unit))
    assert not told.unused and told.rooms == len(office().rooms)


@pytest.mark.parametrize("unit", [0.001, 0.01, 0.1, 1 / 0.3048, 39.37, 1000.0])
def test_a_floor_plan_of_any_unit_is_that_in_metres_when_its_scale_is_told(unit: float) -> None:
    """Drawn at 1:100 or in kilometres, cells of 0.1 were as large as rooms; in inches, doors were walls."""
    true = prior_of_plan(office(), PriorHints(here=(15.0, 6.0)))
    told = prior_of_plan(in_unit(office(), unit), PriorHints(scale=1 / unit, here=(15.0 * unit, 6.0 * unit)))
    assert told.resolution == pytest.approx(true.resolution) and told.doors_missing == 0.0
    assert told.hints.here == pytest.approx(true.hints.here) and told.hints.scale == 1 / unit
    assert told.free.shape == true.free.shape and (told.free != true.free).mean() < 0.02


def test_nonsense_is_refused() -> None:
    with pytest.raises(ConfigError, match="hint scale"):
        PriorHints(scale=-1.0)
    with pytest.raises(MapError, match="valid polygons"):
        prior_of_rooms([])
    with pytest.raises(MapError, match="must be one"):
        PriorPlan(
            name="x", free=np.ones((2, 2), np.bool_), room_ids=np.ones((3, 2), np.int32), resolution=0.1
        )


@pytest.mark.parametrize("shape", [(0, 0), (0, 5), (5, 0)])
def test_a_plan_has_cells(shape: tuple[int, int]) -> None:
    with pytest.raises(MapError, match="with cells"):
        PriorPlan(name="x", free=np.ones(shape, np.bool_), room_ids=np.ones(shape, np.int32), resolution=0.1)


def test_thousands_of_rooms_that_are_cut_off_are_opened_soon() -> None:
    tiles, cells = np.zeros((1200, 1200), np.int32), np.zeros(12, bool)
    cells[:10] = True
    free = np.tile(cells[:, None] & cells, (100, 100))
    tiles[:] = np.arange(10_000).reshape(100, 100).repeat(12, 0).repeat(12, 1) + 1
    prior = PriorPlan(name="tiles", free=free, room_ids=np.where(free, tiles, 0), resolution=0.2)
    opened = with_doors_to_all(prior)
    assert parts(opened) < 10_000 and not prior.free[10].any()
