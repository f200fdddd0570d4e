"""Plans from rasters and drawings: rooms, doors, walls."""

from __future__ import annotations

import cv2
import numpy as np

from layoutexplore.maps.tracing import floorplan_from_ascii
from tests.plans import TWO_ROOMS


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


def test_a_plan_of_an_image_closes_its_doors() -> None:
    plan = floorplan_from_ascii(TWO_ROOMS, 0.5)
    closed = plan.with_doors_closed([0]).rasterize(0.1)
    assert cv2.connectedComponents(closed.free.astype(np.uint8), connectivity=8)[0] == 3
