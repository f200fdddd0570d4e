"""Doors that thick walls have narrowed are widened."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from shapely.geometry import box
from typer.testing import CliRunner

from layoutexplore.cli import app
from layoutexplore.errors import ConfigError, MapWarning
from layoutexplore.grids.polygons import Point
from layoutexplore.importing.doors import through_walls, widen_doors
from layoutexplore.maps import load_plan
from layoutexplore.maps.floorplan import Door, FloorPlan, Room
from layoutexplore.maps.geojson import save_plan


def door_at(start: Point, end: Point, rooms: tuple[int, int]) -> Door:
    """An open door."""
    return Door(start=start, end=end, rooms=rooms)


def three_rooms(*doors: Door) -> FloorPlan:
    """A hall below of 6 x 3 m, two rooms of 3 m above, and walls of 0.3 m between them."""
    shapes = box(0, 0, 6, 3), box(0, 3.3, 2.85, 6), box(3.15, 3.3, 6, 6)
    rooms = [Room(id=number, polygon=shape) for number, shape in enumerate(shapes, start=1)]
    walls = box(-0.3, -0.3, 6.3, 6.3)
    for room in rooms:
        walls = walls.difference(room.polygon)
    plan = FloorPlan(name="rooms", building="rooms", rooms=tuple(rooms), doors=doors, walls=walls)
    for door in doors:
        walls = walls.difference(plan.opening(door))
    return FloorPlan(name="rooms", building="rooms", rooms=tuple(rooms), doors=doors, walls=walls)


def test_doors_grow_at_both_ends_and_the_floor_with_them() -> None:
    plan = three_rooms(door_at((1.2, 3.15), (1.7, 3.15), (1, 2)))
    wide = widen_doors(plan, 0.9)
    (door,) = wide.doors
    assert door.width == pytest.approx(0.9) and door.start[0] == pytest.approx(1.0)
    assert wide.area == pytest.approx(plan.area + 0.4 * 0.3) and wide.rooms == plan.rooms
    assert plan.walls.area - wide.walls.area == pytest.approx(0.4 * 0.3)
    free = [np.count_nonzero(p.rasterize(0.05).free) for p in (plan, wide)]
    assert free[1] - free[0] == pytest.approx(0.4 * 0.3 / 0.05**2, abs=12)


def test_doors_keep_away_from_other_rooms() -> None:
    beside = door_at((2.3, 3.15), (2.8, 3.15), (1, 2))
    (door,) = widen_doors(three_rooms(beside), 0.9).doors
    assert door.width == pytest.approx(0.9) and door.end[0] < 3.15 - 0.06
    above = door_at((3.0, 3.4), (3.0, 3.9), (2, 3))
    (door,) = widen_doors(three_rooms(above), 0.9).doors
    assert door.width == pytest.approx(0.9) and 3.06 < door.start[1] < 3.4
    walled_in = door_at((2.95, 3.15), (3.35, 3.15), (1, 3))
    (door,) = widen_doors(three_rooms(walled_in), 0.9).doors
    assert door.width == pytest.approx(0.9) and door.start[0] > 2.85 + 0.06


def test_gaps_and_wide_doors_stay() -> None:
    gap, wide = door_at((1.0, 3.15), (1.2, 3.15), (1, 2)), door_at((4.0, 3.15), (5.2, 3.15), (1, 3))
    assert widen_doors(three_rooms(gap, wide), 0.9).doors == (gap, wide)
    with pytest.raises(ConfigError, match=r"doors are widened to 0\.35 to 3\.0 m, got 9"):
        widen_doors(three_rooms(gap), 9.0)


def test_the_command_widens_doors(tmp_path: Path) -> None:
    save_plan(three_rooms(door_at((1.2, 3.15), (1.7, 3.15), (1, 2))), tmp_path / "narrow.geojson")
    words = ["maps", "import", str(tmp_path / "narrow.geojson"), "--out", str(tmp_path / "wide.geojson")]
    result = CliRunner().invoke(app, [*words, "--doors", "0.9"])
    assert result.exit_code == 0, result.output
    (door,) = load_plan(tmp_path / "wide.geojson").doors
    assert door.width == pytest.approx(0.9)
    refused = CliRunner().invoke(app, [*words, "--doors", "0.9", "--robot", str(tmp_path / "robot")])
    assert refused.exit_code != 0 and not (tmp_path / "robot").exists()


def test_a_door_that_somebody_has_drawn_is_cut_through_the_walls(tmp_path: Path) -> None:
    drawn = door_at((4.0, 3.15), (5.0, 3.15), (1, 3))
    plan = three_rooms(door_at((1.2, 3.15), (2.0, 3.15), (1, 2)))
    shut = replace(door_at((2.2, 3.15), (2.8, 3.15), (1, 2)), is_open=False)
    plan = replace(plan, doors=(*plan.doors, drawn, shut))
    with pytest.warns(MapWarning, match="1 door had no gap as wide in the walls"):
        mended = through_walls(plan)
    assert plan.walls.area - mended.walls.area == pytest.approx(1.0 * 0.3)
    assert through_walls(mended) is mended
    longer = replace(mended, doors=(plan.doors[0], replace(drawn, end=(5.4, 3.15)), shut))
    with pytest.warns(MapWarning, match="1 door had no gap as wide"):
        assert mended.walls.area - through_walls(longer).walls.area == pytest.approx(0.4 * 0.3)
    save_plan(plan, tmp_path / "plan.geojson")
    words = ["maps", "import", str(tmp_path / "plan.geojson"), "--out", str(tmp_path / "plan.geojson")]
    with pytest.warns(MapWarning, match=r"plan\.geojson: 1 door had no gap"):
        done = CliRunner().invoke(app, words)
    assert done.exit_code == 0 and "out of reach" not in done.output, done.output
    assert load_plan(tmp_path / "plan.geojson").walls.area == pytest.approx(mended.walls.area)
