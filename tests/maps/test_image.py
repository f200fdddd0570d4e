"""Floor plans from occupancy maps and images."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from layoutexplore.errors import MapError
from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.grids.ros_map import save_grid
from layoutexplore.importing.building import import_building
from layoutexplore.maps import load_plan
from layoutexplore.maps.tracing import floorplan_from_ascii
from tests.calls import counted_calls


def test_a_ros_map_is_a_floor_plan(tmp_path: Path) -> None:
    grid = floorplan_from_ascii("#######\n#aaaaa#\n#aaaaa#\n#######", 0.5).rasterize(0.5, margin=0.0).grid
    save_grid(grid, tmp_path / "hall.yaml")
    plan = load_plan(tmp_path / "hall.yaml")
    assert plan.metadata["format"] == "ROS map"
    assert [room.polygon.area for room in plan.rooms] == [2.5]
    assert plan.bounds[:2] == (grid.origin.x, grid.origin.y)


@pytest.mark.parametrize("mode", ["scale", "raw"])
def test_a_ros_map_of_probabilities_is_a_floor_plan(tmp_path: Path, mode: str) -> None:
    grid = floorplan_from_ascii("#######\n#aaaaa#\n#aaaaa#\n#######", 0.5).rasterize(0.5, margin=0.0).grid
    cells = np.where(grid.occupied, 70, 10).astype(np.int8)
    save_grid(OccupancyGrid(cells, 0.5, grid.origin), tmp_path / "hall.yaml", mode=mode)
    assert [room.polygon.area for room in load_plan(tmp_path / "hall.yaml").rooms] == [2.5]


def test_plain_images_and_their_scale(tmp_path: Path) -> None:
    image = np.full((100, 100), 127, np.uint8)
    image[20:80, 20:80] = 195
    image[30:34, 30:34] = 208  # a start patch
    cv2.imwrite(str(tmp_path / "cave.png"), image)
    plan = load_plan(tmp_path / "cave.png")
    assert "assumed" in plan.metadata["scale"]
    assert plan.area == pytest.approx(9.0)
    assert load_plan(tmp_path / "cave.png", resolution=0.1).area == pytest.approx(36.0)
    with pytest.raises(MapError, match="resolution"):
        load_plan(tmp_path / "cave.png", resolution=0.0)


def test_an_image_with_an_image_of_its_rooms(tmp_path: Path) -> None:
    image, colours = np.full((80, 80), 205, np.uint8), np.zeros((80, 80, 3), np.uint8)
    image[10:70, 10:70] = 254
    image[10:70, 39:41] = 0
    image[30:50, 39:41] = 254
    colours[10:70, 10:39], colours[10:70, 41:70] = (255, 0, 0), (0, 9, 200)
    cv2.imwrite(str(tmp_path / "map.png"), image)
    cv2.imwrite(str(tmp_path / "map_gt.png"), colours)
    plan = load_plan(tmp_path / "map.png")
    assert len(plan.rooms) == 2
    assert [door.rooms for door in plan.doors] == [(1, 2)]
    cv2.imwrite(str(tmp_path / "map_gt.png"), colours[:20])
    with pytest.raises(MapError, match="do not fit"):
        load_plan(tmp_path / "map.png")


def test_an_image_of_rooms_of_16_bits(tmp_path: Path) -> None:
    image, rooms = np.full((80, 80), 205, np.uint8), np.zeros((80, 80), np.uint16)
    image[10:70, 10:70] = 254
    image[10:70, 39:41] = 0
    rooms[10:70, 10:39], rooms[10:70, 41:70] = 1, 300
    cv2.imwrite(str(tmp_path / "map.png"), image)
    cv2.imwrite(str(tmp_path / "map_rooms.png"), rooms)
    assert [room.id for room in load_plan(tmp_path / "map.png").rooms] == [1, 300]


def test_images_without_free_space(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "black.png"), np.zeros((30, 30), np.uint8))
    with pytest.raises(MapError, match="no free space"):
        load_plan(tmp_path / "black.png")


@pytest.mark.parametrize(("share", "rooms", "most"), [("corners", 2, 1_000_000), ("gaps", 4761, 350_000)])
def test_many_rooms_beside_each_other_are_traced_in_one_pass(
    tmp_path: Path, share: str, rooms: int, most: int
) -> None:
    """Two rooms that touch 180 000 times took 2.7 million calls, thousands around one gap 447 000."""
    row, col = np.indices((300, 300) if share == "corners" else (897, 897))
    ids = (row + col) % 2 + 1
    if share == "gaps":
        ids = np.where((row % 13 > 1) & (col % 13 > 1), row // 13 * 69 + col // 13 + 1, 0)
    for name, part in (("few", ids[:40, :40]), ("map", ids)):
        cv2.imwrite(str(tmp_path / f"{name}.png"), np.full(part.shape, 254, np.uint8))
        cv2.imwrite(str(tmp_path / f"{name}_rooms.png"), part.astype(np.uint16))
    load_plan(tmp_path / "few.png", resolution=1.0)  # so that what is compiled does not count
    with counted_calls() as calls:
        plan = load_plan(tmp_path / "map.png", resolution=1.0)
    assert len(plan.rooms) == rooms and calls.total() < most


def test_a_drawing_on_a_transparent_ground_is_to_be_laid_on_white(tmp_path: Path) -> None:
    pixels = np.zeros((40, 40, 4), np.uint8)
    pixels[5:35, [5, 34], 3] = pixels[[5, 34], 5:35, 3] = 255
    cv2.imwrite(str(tmp_path / "cad.png"), pixels)
    for read in (load_plan, import_building):
        with pytest.raises(MapError, match=r"cad\.png: the map shows no free space .*lay a drawing on white"):
            read(tmp_path / "cad.png")
