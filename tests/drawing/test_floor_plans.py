"""Floor plans as sheets, and the numbered places of findings on them."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from layoutexplore.drawing import palette
from layoutexplore.drawing.findings import RADIUS, circle_places, draw_findings
from layoutexplore.drawing.floor_plans import CLOSED_DOOR, OPEN_DOOR, draw_sheet
from layoutexplore.importing.findings import Finding, find_faults
from layoutexplore.maps.floorplan import FloorPlan, Room
from layoutexplore.maps.library import load_plan
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.maps.tracing import floorplan_from_ascii
from tests.plans import SIX_ROOMS, SUITE


def count(image: NDArray[np.uint8], colour: palette.Colour) -> int:
    return int((image == np.array(colour, np.uint8)).all(axis=-1).sum())


def in_corner(plan: FloorPlan) -> FloorPlan:
    """The plan in the corner of an image that is ten times as wide and high."""
    source = plan.source
    assert source is not None
    rows, cols = source.shape
    margin = ((0, 9 * rows), (9 * cols, 0))
    occupied = np.pad(source.occupied, margin, constant_values=True)
    raster = PlanRaster(occupied, np.pad(source.room_ids, margin), source.resolution, source.origin)
    return FloorPlan(name="corner", rooms=plan.rooms, source=raster)


def test_the_building_fills_the_sheet_wherever_its_map_is_empty() -> None:
    image = draw_sheet(in_corner(floorplan_from_ascii(SIX_ROOMS, resolution=0.5))).image
    drawn = ~(image == np.array(palette.CANVAS, np.uint8)).all(axis=-1)
    cols = np.nonzero(drawn)[1]
    assert cols.min() < 60 and cols.max() > image.shape[1] - 60
    assert 1200 < max(image.shape) < 2500


@pytest.mark.parametrize("name", ["office-01", "apartment-01"])
def test_the_number_of_a_room_stands_inside_it_where_it_fits(name: str) -> None:
    plan = load_plan(name)
    sheet = draw_sheet(plan)
    rooms = shapely.MultiPolygon([room.polygon for room in plan.rooms])
    assert len(sheet.numbers) >= 0.8 * len(plan.rooms)
    for left, top, right, bottom in sheet.numbers:
        x0, x1 = (sheet.left + x / sheet.metre for x in (left, right))
        y0, y1 = (sheet.top - y / sheet.metre for y in (bottom, top))
        assert rooms.buffer(0.05).contains(shapely.box(x0, y0, x1, y1))
        number = sheet.image[int(top) : int(bottom) + 1, int(left) : int(right) + 1]
        assert (number.astype(int).sum(axis=-1) < 450).any()
    for first, box in enumerate(sheet.numbers):
        assert not any(shapely.box(*box).intersects(shapely.box(*b)) for b in sheet.numbers[:first])


def test_a_room_too_small_for_its_number_has_none() -> None:
    rooms = (
        Room(id=1, polygon=shapely.box(0, 0, 40, 30)),
        Room(id=2, polygon=shapely.box(40.2, 0, 40.35, 1)),
    )
    assert len(draw_sheet(FloorPlan(name="cupboard", rooms=rooms)).numbers) == 1


def test_closed_doors_have_a_colour_of_their_own() -> None:
    plan = floorplan_from_ascii(SUITE, resolution=0.5)
    legend_only = count(draw_sheet(plan.with_doors_closed(range(len(plan.doors)))).image, OPEN_DOOR)
    half = plan.with_doors_closed([0])
    image = draw_sheet(half).image
    assert legend_only == 0 and count(draw_sheet(plan).image, CLOSED_DOOR) == 0
    assert count(image, OPEN_DOOR) > 100 and count(image, CLOSED_DOOR) > 100
    sheet = draw_sheet(half, 0.25)
    for door in half.doors:
        x, y = sheet.pixel(((door.start[0] + door.end[0]) / 2, (door.start[1] + door.end[1]) / 2))
        assert tuple(sheet.image[round(y), round(x)]) == (OPEN_DOOR if door.is_open else CLOSED_DOOR)


def test_the_scale_bar_is_as_long_as_it_says() -> None:
    sheet = draw_sheet(FloorPlan(name="hall", rooms=(Room(id=1, polygon=shapely.box(0, 0, 60, 40)),)))
    bar = (sheet.image[-34:] == np.array(palette.INK, np.uint8)).all(axis=-1)
    row = bar[bar.sum(axis=1).argmax()]
    length = int(np.flatnonzero(np.diff(np.flatnonzero(row)) > 1).min(initial=int(row.sum()) - 1)) + 1
    assert length == pytest.approx(5.0 * sheet.metre, abs=4)


def test_circles_of_findings_do_not_cover_each_other_or_numbers() -> None:
    places = [(100.0, 100.0), (104.0, 100.0), (100.0, 104.0), (3.0, 3.0), (298.0, 100.0)] * 4
    numbers = [(90.0, 60.0, 110.0, 70.0)]
    centres = circle_places(places, numbers, (300, 200))
    for k, (x, y) in enumerate(centres):
        assert RADIUS < x < 300 - RADIUS and RADIUS < y < 200 - RADIUS
        assert all(math.dist((x, y), other) > 2 * RADIUS for other in centres[:k])
    assert circle_places(places, numbers, (300, 200)) == centres
    x, y = circle_places([(100.0, 65.0)], numbers, (300, 200))[0]
    assert abs(x - 100) > 10 + RADIUS or abs(y - 65) > 5 + RADIUS


def test_more_circles_than_there_is_room_for_are_drawn_all_the_same() -> None:
    assert len(circle_places([(20.0, 20.0)] * 30, [], (60, 60))) == 30


def test_findings_are_drawn_with_their_numbers() -> None:
    plan = load_plan("apartment-01")
    assert not find_faults(plan)
    x, y = plan.rooms[0].polygon.representative_point().coords[0]
    bare = draw_findings(plan)
    image = draw_findings(plan, [Finding("tiny room", "room 1", x, y)] * 3)
    assert image.shape == bare.shape and count(bare, palette.VERMILLION) == 0
    assert count(image, palette.VERMILLION) > 3 * 0.5 * math.pi * RADIUS**2
