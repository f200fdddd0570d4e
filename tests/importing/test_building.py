"""Rooms and doors of a map."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from layoutexplore.errors import MapError, MapWarning, UnknownNameError
from layoutexplore.grids.grid import OccupancyGrid, Pose
from layoutexplore.grids.image_map import grid_from_image
from layoutexplore.importing.building import building_from_grid, building_of_plan, import_building
from layoutexplore.importing.layout_files import layout_with_doors
from layoutexplore.importing.pictures import PictureConfig
from layoutexplore.layout.pipeline import reconstruct
from layoutexplore.maps import load_plan
from tests.importing.cases import office, write_ros_map


def test_an_office_has_its_rooms_and_doors(tmp_path: Path) -> None:
    with pytest.warns(MapWarning):
        building = import_building(write_ros_map(tmp_path, office()))
    plan = building.plan
    assert len(plan.rooms) == 4 and len(plan.doors) == 3
    assert sorted(round(room.polygon.area, 1) for room in plan.rooms)[:3] == pytest.approx(
        [14.8] * 3, abs=0.4
    )
    assert [door.width for door in plan.doors] == pytest.approx([0.9] * 3, abs=0.06)
    corridor = max(plan.rooms, key=lambda room: room.polygon.area).id
    assert all(corridor in door.rooms for door in plan.doors)
    assert plan.bounds[:2] == (-3.0, -2.0)
    assert np.array_equal(np.unique(building.room_ids[building.room_ids > 0]), [r.id for r in plan.rooms])


def test_doors_of_a_turned_building_lie_along_its_walls() -> None:
    matrix = cv2.getRotationMatrix2D((160, 100), 30, 1.0)
    turned = cv2.warpAffine(office(), matrix, (420, 420), flags=cv2.INTER_NEAREST, borderValue=205)
    doors = building_from_grid(grid_from_image(turned, 0.05), name="turned").plan.doors
    angles = [np.degrees(np.arctan2(d.end[1] - d.start[1], d.end[0] - d.start[0])) for d in doors]
    assert angles == pytest.approx([30.0] * 3, abs=12.0)
    assert [door.width for door in doors] == pytest.approx([0.9] * 3, abs=0.2)


def test_lines_beside_a_wall_make_no_doors_in_it() -> None:
    """The lines of `ias15` run a cell beside the walls here; behind them is a strip of the wrong room."""
    cells = np.full((200, 260), -1, np.int8)
    cells[20:180, 20:240] = 100
    for rows, cols in ((slice(21, 100), slice(21, 120)), (slice(101, 179), slice(21, 120))):
        cells[rows, cols] = 0
    cells[21:179, 121:239] = 0
    cells[90:110, 120] = cells[100, 60:80] = 0
    grid = OccupancyGrid(cells, 0.05)
    plan = building_from_grid(grid, name="three", method="ias15").plan
    drawn = layout_with_doors(reconstruct(grid, "ias15"))["features"]
    doors = [part for part in drawn if part["properties"]["kind"] == "door"]
    assert len(plan.doors) == len(doors) == 3
    assert max(door.width for door in plan.doors) < 1.1


def test_without_a_method_each_separate_area_is_a_room() -> None:
    grid = grid_from_image(office(), 0.05)
    assert len(building_from_grid(grid, name="office", method="none").plan.rooms) == 1


def test_a_map_with_a_yaw_is_said_to_be_turned() -> None:
    grid = replace(grid_from_image(office(), 0.05), origin=Pose(1.0, 2.0, 0.3))
    building = building_from_grid(grid, name="office")
    assert "-0.3 rad" in building.plan.metadata["frame"] and building.grid.origin == grid.origin


def test_a_plan_is_a_building() -> None:
    plan = load_plan("office-01")
    building = building_of_plan(plan)
    assert building.plan is plan and building.room_ids.shape == building.grid.shape


def test_maps_without_rooms_and_methods_that_do_not_exist(tmp_path: Path) -> None:
    with pytest.raises(MapError, match="no free space"):
        import_building(write_ros_map(tmp_path, np.zeros((30, 30), np.uint8)), PictureConfig())
    grid = OccupancyGrid(np.pad(np.zeros((4, 4), np.int8), 20, constant_values=-1), 0.05)
    with pytest.raises(MapError, match="finds no room"):
        building_from_grid(grid, name="speck")
    with pytest.raises(UnknownNameError):
        building_from_grid(grid, name="speck", method="rosetta")


@pytest.mark.parametrize(
    ("name", "blueprint", "rooms", "doors"),
    [
        ("blueprints/fire-escape-plan.png", True, 17, 18),
        ("blueprints/escape-plan.png", True, 10, 8),
        ("blueprints/library-fire-evacuation-plan.png", True, 14, 14),
        ("partial/battle_creekhs_1160.png", False, 20, 19),
    ],
)
def test_real_plans_and_maps(data_dir: Path, name: str, blueprint: bool, rooms: int, doors: int) -> None:
    building = import_building(data_dir / name, PictureConfig(blueprint=blueprint))
    assert rooms <= len(building.plan.rooms) <= rooms + 8
    assert doors <= len(building.plan.doors) <= doors + 10
    assert building.grid.unknown[0].mean() > 0.5
