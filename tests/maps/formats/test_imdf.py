"""IMDF folders that are broken."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from shapely import Point, Polygon, box

from layoutexplore.errors import MapError, MapWarning
from layoutexplore.maps import load_plan
from layoutexplore.maps.formats.imdf import imdf_levels
from tests.maps.formats.cases import LEFT, feature, write_collection, write_imdf


def test_broken_parts_are_named(tmp_path: Path) -> None:
    path = write_imdf(tmp_path / "school")
    (path / "unit.geojson").write_text("{")
    with pytest.raises(MapError, match=r"unit\.geojson: broken JSON"):
        load_plan(f"{path}#0")
    (path / "unit.geojson").write_text('{"features": [1]}')
    with pytest.raises(MapError, match=r"unit\.geojson: features\[0\] must be a table"):
        load_plan(f"{path}#0")
    write_collection(path / "unit.geojson", feature(box(0, 0, 1, 1), level_id="b9", category="room"))
    with pytest.raises(MapError, match="none of its units has the level_id"):
        load_plan(f"{path}#0")


def test_what_is_left_out_is_counted(tmp_path: Path) -> None:
    path = write_imdf(tmp_path / "school")
    bow = Polygon([(0, 0), (4, 4), (4, 0), (0, 4)])
    write_collection(
        path / "unit.geojson",
        feature(bow, level_id="a0", category="room"),
        feature(box(5, 0, 9, 4), level_id="a0", category="room"),
        feature(None, level_id="a0", category="room"),
    )
    write_collection(path / "opening.geojson", feature(Point(5, 1), level_id="a0"))
    with pytest.warns(MapWarning) as caught:
        plan = load_plan(f"{path}#0")
    said = " ".join(str(warning.message) for warning in caught)
    assert "crossed themselves" in said and "without area" in said and "no line are left out" in said
    assert len(plan.rooms) == 3  # Both halves of the bow are rooms.


def test_a_folder_without_openings_has_no_doors(tmp_path: Path) -> None:
    path = write_imdf(tmp_path / "school")
    (path / "opening.geojson").unlink()
    assert load_plan(f"{path}#0").doors == ()


@pytest.mark.parametrize("part", ["unit", "opening"])
def test_units_and_openings_are_counted_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, part: str
) -> None:
    monkeypatch.setenv("LAYOUTEXPLORE_LIMITS", "rooms=25")
    folder = write_imdf(tmp_path / "home")
    write_collection(folder / f"{part}.geojson", *[feature(LEFT, level_id="a0")] * 30)
    with pytest.raises(MapError, match=f"#0: 30 {part}s, and the limit rooms is 25"):
        load_plan(f"{folder}#0")


def test_floors_of_one_name_and_height_are_all_there(tmp_path: Path) -> None:
    """The ids of two buildings may begin alike; numbers as ids, and floors without a name, are read."""
    homes = ("00000000-a", "00000000-b")
    floors = {number: homes[number % 2] for number in range(3)}
    write_collection(
        tmp_path / "level.geojson",
        *(
            feature(None, name={"en": None}, ordinal=1, building_ids=[home]) | {"id": number}
            for number, home in floors.items()
        ),
    )
    write_collection(
        tmp_path / "unit.geojson",
        *(feature(box(0, 0, 9 + number, 9), level_id=number, category="room") for number in floors),
    )
    names = imdf_levels(tmp_path)
    assert names == ["1", "1 (2)", "1 (3)"]
    widths = [load_plan(f"{tmp_path}#{name}").bounds[2] for name in names]
    assert widths == pytest.approx([9.1, 10.1, 11.1], abs=0.02)


def test_levels_without_units_are_no_floors(tmp_path: Path) -> None:
    """Those of the ground outside and of roofs are of no building; a GIS puts ids among the properties."""
    path = write_imdf(tmp_path / "school")
    levels = [feature(None, id=key, ordinal=0, short_name={"en": key}, building_ids=[]) for key in ("x", "y")]
    inside = feature(None, ordinal=0, short_name={"en": "G"}, building_ids=["a"])
    inside["properties"]["id"] = "a0"
    write_collection(path / "level.geojson", *levels, inside)
    assert imdf_levels(path) == ["G"] and len(load_plan(path).rooms) == 2


@pytest.mark.parametrize("value", [True, "13.7", [13.7]])
def test_a_unit_whose_coordinates_are_no_numbers_is_left_out(tmp_path: Path, value: Any) -> None:
    path = write_imdf(tmp_path / "school")
    units = json.loads((path / "unit.geojson").read_text())
    ring = [list(corner) for corner in units["features"][0]["geometry"]["coordinates"][0]]
    ring[0][0] = value
    units["features"][0]["geometry"]["coordinates"] = [ring]
    (path / "unit.geojson").write_text(json.dumps(units))
    with pytest.warns(MapWarning, match="1 polygons without area are left out"):
        assert len(load_plan(f"{path}#0").rooms) == 1
