"""Open-RMF buildings that are broken."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import pytest

from layoutexplore.errors import MapError, MapWarning
from layoutexplore.maps import load_plan
from tests.maps.formats.cases import RMF, write_rmf


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("levels:", "floors:", "needs the entry 'levels'"),
        ("name: two", "name: [two", "broken YAML"),
        ("name: two", "coordinate_system: wgs84", "coordinate_system .*wgs84.* is not read"),
        (
            "name: two",
            "coordinate_system: web_mercator",
            "web_mercator.* is not read, only reference_image and",
        ),
        ("distance: [3, 10.0]", "distance: [3, 0]", "no usable measurement"),
        ("- [0, 0, 0", "- [zero, 0, 0", "two finite numbers"),
        ("- [0, 0, 0", "- [yes, 0, 0", "two finite numbers"),
        ("distance: [3, 10.0]", "distance: [3, yes]", "no usable measurement"),
        ("    walls:", "    lanes:", "no floor in this file"),
    ],
)
def test_broken_buildings_are_named(tmp_path: Path, old: str, new: str, message: str) -> None:
    path = write_rmf(tmp_path / "two.building.yaml")
    path.write_text(RMF.replace(old, new, 1))
    with pytest.raises(MapError, match=message) as caught:
        load_plan(path)
    assert "two.building.yaml" in str(caught.value)


def test_walls_and_doors_that_are_none_are_counted(tmp_path: Path) -> None:
    path = write_rmf(tmp_path / "two.building.yaml")
    path.write_text(RMF.replace("    - [1, 6, {}]", "    - [1, 6, {}]\n    - [3, 99, {}]\n    - [2, 2, {}]"))
    with pytest.warns(MapWarning, match="2 walls without two different vertices"):
        assert len(load_plan(path).rooms) == 2


def test_a_door_within_a_room_is_told_with_the_file(tmp_path: Path) -> None:
    path = write_rmf(tmp_path / "two.building.yaml")
    more = RMF.replace("    walls:", '    - [120, 60, 0, ""]\n    - [120, 100, 0, ""]\n    walls:')
    path.write_text(more.replace("    doors:\n", "    doors:\n    - [8, 9, {}]\n"))
    with pytest.warns(MapWarning, match=f"{re.escape(str(path))}#L1: 1 of 2 doors join no two rooms"):
        assert len(load_plan(path).doors) == 1


def test_a_building_that_only_its_doors_close(tmp_path: Path) -> None:
    path = write_rmf(tmp_path / "two.building.yaml")
    without = RMF.replace("    - [5, 0, {}]\n", "")
    path.write_text(without.replace("    doors:\n", "    doors:\n    - [5, 0, {}]\n"))
    plan = load_plan(path)
    assert len(plan.rooms) == 2
    assert sorted(door.rooms for door in plan.doors) == [(0, 1), (1, 2)]


def test_y_points_up(tmp_path: Path) -> None:
    plan = load_plan(write_rmf(tmp_path / "two.building.yaml"))
    assert plan.doors[0].start == pytest.approx((5.0, -1.6)) and plan.bounds[3] == pytest.approx(0.1)


def test_metres_are_read_as_they_are(tmp_path: Path) -> None:
    path = write_rmf(tmp_path / "two.building.yaml")
    path.write_text(RMF.replace("name: two", "coordinate_system: cartesian_meters").replace("measure", "no"))
    plan = load_plan(path)
    assert plan.doors[0].start == pytest.approx((250.0, 80.0)) and plan.bounds[3] == pytest.approx(200.1)


UPPER = """
  L2:
    fiducials: [[100, 100, a], [1100, 100, b], [1100, 500, c], [7, 7, alone], [nowhere]]
    vertices: [[100, 100, 0, ""], [1100, 100, 0, ""], [1100, 500, 0, ""], [100, 500, 0, ""]]
    walls: [[0, 1], [1, 2], [2, 3], [3, 0]]
"""


def test_a_level_without_measurements_goes_by_fiducials(tmp_path: Path) -> None:
    path = tmp_path / "tower.building.yaml"
    shared = "    fiducials: [[0, 0, a], [500, 0, b], [500, 200, c]]\n"
    path.write_text(RMF + shared + UPPER)
    assert load_plan(f"{path}#L2").rooms[0].polygon.area == pytest.approx(9.8 * 3.8)
    path.write_text(RMF + shared.replace("b]", "x]").replace("c]", "y]") + UPPER)
    with pytest.raises(MapError, match=r"L2: no usable measurement.* or two fiducials"):
        load_plan(f"{path}#L2")


def test_measurements_that_contradict_each_other_are_named(tmp_path: Path) -> None:
    path, more = tmp_path / "two.building.yaml", "    - [0, 5, {distance: [3, %s]}]\n"
    path.write_text(RMF + more % 4.3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert load_plan(path).bounds[2] == pytest.approx(10.275 + 0.1, abs=0.2)
    path.write_text(RMF + more % 6.0)
    said = r"contradict each other, 0\.02 from vertex 0 to 2 and 0\.03 from vertex 0 to 5 .* 0\.025 is taken"
    with pytest.warns(MapWarning, match=said):
        load_plan(path)
