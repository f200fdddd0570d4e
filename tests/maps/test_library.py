"""Plans by name, split, seed, file and folder."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import shapely

from layoutexplore.errors import MapError, MapWarning, UnknownNameError
from layoutexplore.grids.ros_map import save_grid
from layoutexplore.maps import expand_plans, load_plan, plan_names, splits
from layoutexplore.maps.floorplan import FloorPlan, Room
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.library import cached_plan
from layoutexplore.maps.tracing import floorplan_from_ascii
from tests.maps.cases import share_reached, write_houseexpo, write_kth
from tests.maps.formats.cases import write_imdf
from tests.plans import FLAT, TWO_ROOMS


@pytest.mark.parametrize("folder", ["houseexpo", "dungeons"])
def test_other_real_plans_can_be_walked(data_dir: Path, folder: str) -> None:
    sources = expand_plans(data_dir / "floorplans" / folder)
    assert len(sources) == 5
    for source in sources:
        assert share_reached(load_plan(source)) >= 0.99, source


def test_a_folder_gives_each_plan_once(tmp_path: Path, data_dir: Path) -> None:
    assert len(expand_plans(data_dir / "floorplans")) == 28 + 7 + 5 + 5
    write_kth(tmp_path)
    write_houseexpo(tmp_path)
    save_plan(load_plan("apartment-03"), tmp_path / "own.geojson")
    save_grid(floorplan_from_ascii("###\n#a#\n###").rasterize(1.0).grid, tmp_path / "ros.yaml")
    (tmp_path / "notes.txt").write_text("not a plan")
    (tmp_path / "meta.json").write_text("{}")
    names = [Path(source).name for source in expand_plans(tmp_path)]
    assert names == ["50_PLAN1_occ.png", "house.json", "own.geojson", "ros.yaml"]
    for source in expand_plans(tmp_path):
        assert load_plan(source).rooms


def test_paths_to_walk_are_no_floor_plan(tmp_path: Path) -> None:
    line = {"type": "LineString", "coordinates": [[0, 0], [5, 0]]}
    area = {"type": "Polygon", "coordinates": [[[0, 0], [5, 0], [5, 4], [0, 0]]]}
    for name, shape in (("floor-paths", line), ("floor", area)):
        features = [{"type": "Feature", "properties": {"type": name}, "geometry": shape}]
        text = json.dumps({"type": "FeatureCollection", "features": features})
        (tmp_path / f"{name}.geojson").write_text(text)
    (tmp_path / "damaged.geojson").write_text("{")
    with pytest.warns(MapWarning, match="floor-paths.geojson: left out: its features are lines or points"):
        names = [Path(source).name for source in expand_plans(tmp_path)]
    assert names == ["damaged.geojson", "floor.geojson"], "who loads a damaged one is told what is wrong"


def test_names_splits_and_seeds() -> None:
    for split, names in splits().items():
        assert expand_plans(split) == list(names)
        assert set(names) <= set(plan_names())
    assert expand_plans("office:3") == ["office:3"]
    assert expand_plans("office:3-5") == ["office:3", "office:4", "office:5"]
    with pytest.raises(UnknownNameError, match="did you mean 'office'"):
        expand_plans("ofice:1-2")
    with pytest.raises(MapError, match="last seed"):
        expand_plans("office:3-1")
    with pytest.raises(UnknownNameError, match="split"):
        plan_names("trian")


@pytest.mark.parametrize("load", [load_plan, cached_plan])
def test_several_plans_are_not_one(load: Callable[[Any], object]) -> None:
    for split, names in splits().items():
        with pytest.raises(MapError, match=rf"^{split}: is a split of {len(names)} .* as {names[0]}, "):
            load(split)
    with pytest.raises(MapError, match=r"office:0-3: is a range of 4 .* one of them, as office:0, office:1"):
        load("office:0-3")
    with pytest.raises(UnknownNameError, match="did you mean 'office'"):
        load("ofice:0-3")


@pytest.mark.parametrize("load", [load_plan, expand_plans])
def test_unknown_names_and_files(tmp_path: Path, load: Callable[[Any], object]) -> None:
    with pytest.raises(UnknownNameError, match="office:SEED"):
        load("ofice:SED")
    with pytest.raises(MapError, match="no such file"):
        load(tmp_path / "absent.geojson")
    with pytest.raises(MapError, match="no such file"):
        load("absent.xml")
    with pytest.raises(MapError, match="no such file") as raised:
        load(f"maps/{'f' * 5000}.xml")
    assert len(str(raised.value)) < 500, "a message that can be read"
    with pytest.raises(MapError, match="folder"):
        load(tmp_path)


@pytest.mark.parametrize("name", ["x" * 300, "y" * 5000, "home.osm#" + "1" * 300, "a\0b.xml", "a\0b#1"])
@pytest.mark.parametrize("load", [load_plan, expand_plans, cached_plan])
def test_a_name_that_no_file_can_have(name: str, load: Callable[[Any], object]) -> None:
    with pytest.raises((MapError, UnknownNameError)):
        load(name)


def test_a_text_file_is_no_plan(tmp_path: Path) -> None:
    (tmp_path / "plan.txt").write_text("four walls")
    with pytest.raises(MapError, match="known endings"):
        load_plan(tmp_path / "plan.txt")


def test_json_that_is_no_plan_is_told(tmp_path: Path) -> None:
    (tmp_path / "main.json").write_text('{"id": "house", "levels": []}')
    with pytest.raises(MapError, match=r"main\.json: is no floor plan: JSON is read as.*Overpass save"):
        load_plan(tmp_path / "main.json")


def test_plans_are_kept_until_their_file_changes(tmp_path: Path) -> None:
    path = tmp_path / "plan.geojson"
    save_plan(floorplan_from_ascii(TWO_ROOMS, name="plan"), path)
    first = cached_plan(path)
    assert cached_plan(str(path)) is first and cached_plan("office-01") is cached_plan("office-01")
    changed = path.stat().st_mtime_ns + 10**9
    save_plan(floorplan_from_ascii(FLAT, name="plan"), path)
    os.utime(path, ns=(changed, changed))
    assert len(cached_plan(path).rooms) == 5 and cached_plan(path) is not first


def test_kept_plans_follow_the_files_beside_theirs(tmp_path: Path) -> None:
    """Of KTH, of HouseExpo and of an IMDF folder; an image of rooms may be written later."""
    kth, house, imdf = write_kth(tmp_path), write_houseexpo(tmp_path), write_imdf(tmp_path / "imdf")
    beside = {
        str(kth): kth.with_name("50_PLAN1_rooms.png"),
        str(house): house.with_name("house.label_data.json"),
        f"{imdf}#0": imdf / "unit.geojson",
    }
    for source, other in beside.items():
        first = cached_plan(source)
        assert cached_plan(source) is first
        os.utime(other, ns=(1, 1))
        assert cached_plan(source) is not first, other
    image = cv2.imread(str(kth), cv2.IMREAD_GRAYSCALE)
    cv2.imwrite(str(tmp_path / "map.png"), image)
    for rooms in (1, 2):
        ids = np.zeros_like(image)
        ids[22:98, 22:98], ids[22:98, 104:178] = 1, rooms
        cv2.imwrite(str(tmp_path / "map_rooms.png"), ids)
        os.utime(tmp_path / "map_rooms.png", ns=(rooms, rooms))
        assert len(cached_plan(tmp_path / "map.png").rooms) == rooms


def test_a_large_file_is_parsed_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """GeoJSON, our own and that of others, whatever its ending."""
    save_plan(load_plan("apartment-01"), tmp_path / "own.json")
    square = {"type": "Polygon", "coordinates": [[[0, 0], [4, 0], [4, 4], [0, 4], [0, 0]]]}
    feature = {"type": "Feature", "properties": {}, "geometry": square}
    other = json.dumps({"type": "FeatureCollection", "features": [feature]})
    (tmp_path / "other.geojson").write_text(other)
    parsed: list[int] = []
    loads = json.loads
    monkeypatch.setattr(json, "loads", lambda text: (parsed.append(len(text)), loads(text))[1])
    assert len(load_plan(tmp_path / "own.json").rooms) > 1 and len(parsed) == 1
    assert len(load_plan(tmp_path / "other.geojson").rooms) == 1 and len(parsed) == 2


def test_a_folder_of_too_many_files_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for k in range(4):
        save_plan(floorplan_from_ascii(TWO_ROOMS), tmp_path / f"{k}.geojson")
    monkeypatch.setenv("LAYOUTEXPLORE_LIMITS", "files=4")
    assert len(expand_plans(tmp_path)) == 4
    monkeypatch.setenv("LAYOUTEXPLORE_LIMITS", "files=3")
    with pytest.raises(MapError, match="more than 3 files"):
        expand_plans(tmp_path)


def test_a_file_without_floors_is_an_error_and_in_a_folder_left_out(tmp_path: Path) -> None:
    save_plan(load_plan("apartment-03"), tmp_path / "own.geojson")
    streets = tmp_path / "streets.osm"
    streets.write_text('<osm version="0.6"><node id="1" lat="51" lon="13"/></osm>')
    for source in expand_plans(streets):
        with pytest.raises(MapError, match=r"streets\.osm: no floor in this file: it has no rooms"):
            load_plan(source)
    assert expand_plans(streets)
    with pytest.warns(MapWarning, match=r"streets\.osm: left out: no floor is in it"):
        assert expand_plans(tmp_path) == [str(tmp_path / "own.geojson")]


def test_what_a_plan_lacks_names_its_file(tmp_path: Path) -> None:
    """Also later: that all of it is walled, or that a robot fits nowhere, is known once it has cells."""
    path, room = tmp_path / "sheet.geojson", Room(id=1, polygon=shapely.box(0, 0, 4, 0.2))
    save_plan(FloorPlan(name="one", rooms=(room,)), path)
    raster = load_plan(path).rasterize(0.1)
    told = rf"^{re.escape(str(path))}: plan 'one': a robot of radius 0\.2 m fits nowhere in this floor plan"
    with pytest.raises(MapError, match=told):
        raster.reachable(0.2)
    save_plan(FloorPlan(name="one", rooms=(room,), walls=shapely.box(-1, -1, 5, 1)), path)
    for plan in (load_plan(path), load_plan(path).stretched(2.0, 2.0), cached_plan(path)):
        with pytest.raises(MapError, match=rf"^{re.escape(str(path))}: plan 'one' has no free space at"):
            plan.rasterize(0.1)
    imdf = write_imdf(tmp_path / "imdf")
    assert load_plan(f"{imdf}#0").file == f"{imdf}#0" and not load_plan("apartment-01").file
