"""Floors of buildings in the formats of other programs."""

from __future__ import annotations

import contextlib
import json
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest
from shapely import box
from shapely.affinity import rotate

from layoutexplore.errors import MapError, MapWarning
from layoutexplore.maps import expand_plans, load_plan
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.formats.building_files import FORMATS, split_level
from layoutexplore.maps.formats.levels import choose_level
from layoutexplore.maps.library import cached_plan, find_plans
from tests.maps.cases import share_reached
from tests.maps.formats.cases import (
    feature,
    write_collection,
    write_ifc,
    write_imdf,
    write_osm,
    write_osmag,
    write_rmf,
    write_walls,
)

WRITERS: dict[str, tuple[Callable[[Path], Path], str, str]] = {
    "imdf": (write_imdf, "school", "#0"),
    "osm": (write_osm, "house.osm", "#0"),
    "osmag": (write_osmag, "campus.osm", ""),
    "rmf": (write_rmf, "two.building.yaml", "#L1"),
    "walls": (write_walls, "walls.geojson", ""),
    "ifc": (write_ifc, "house.ifc", "#EG"),
}


def sample(folder: Path, name: str) -> tuple[Path, FloorPlan]:
    write, file, level = WRITERS[name]
    path = write(folder / file)
    return path, load_plan(f"{path}{level}")


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.filterwarnings("ignore::layoutexplore.errors.MapWarning")
def test_two_rooms_and_their_door(tmp_path: Path, name: str) -> None:
    _, plan = sample(tmp_path, name)
    assert len(plan.rooms) == 2 and [door.rooms for door in plan.doors] == [(1, 2)]
    assert [room.polygon.area for room in plan.rooms] == pytest.approx([4.75 * 3.7] * 2, rel=0.06)
    assert plan.doors[0].width == pytest.approx(1.1 if name == "osmag" else 0.9, abs=0.01)
    assert plan.bounds[2] - plan.bounds[0] == pytest.approx(10.1, abs=0.15)
    assert share_reached(plan) == 1.0 and share_reached(plan.with_doors_closed([0])) < 0.6


def test_labels_of_rooms(tmp_path: Path) -> None:
    labels = {name: [room.label for room in sample(tmp_path, name)[1].rooms] for name in ("imdf", "osm")}
    assert labels == {"imdf": ["classroom", "corridor"], "osm": ["office", "corridor"]}
    with pytest.warns(MapWarning, match="projected"):
        assert [room.label for room in sample(tmp_path, "walls")[1].rooms] == ["", "elevator"]


@pytest.mark.parametrize(
    ("name", "floors"), [("imdf", ["0", "1"]), ("osm", ["0", "1"]), ("rmf", ["L1"]), ("ifc", ["EG", "1. OG"])]
)
def test_every_floor_of_a_building_can_be_named(tmp_path: Path, name: str, floors: list[str]) -> None:
    path, plan = sample(tmp_path, name)
    named = [f"{path}#{floor}" for floor in floors]
    assert expand_plans(path) == expand_plans(tmp_path) == named
    assert find_plans([str(path)]) == [f"{path.resolve()}#{floor}" for floor in floors]
    plans = [load_plan(each) for each in named]
    assert len({each.name for each in plans}) == len(floors) and {each.building for each in plans} == {
        plan.building
    }
    assert cached_plan(named[0]) is cached_plan(named[0])
    with pytest.raises(MapError, match=rf"no floor '77': name one of .*#{floors[0]}"):
        load_plan(f"{path}#77")
    if len(floors) > 1:
        with pytest.raises(MapError, match="several floors"):
            load_plan(path)


def test_floors_of_several_buildings(tmp_path: Path) -> None:
    path = write_imdf(tmp_path / "campus", homes=("east", "west"))
    assert expand_plans(path) == [f"{path}#{name}" for name in ("east/0", "east/1", "west/0", "west/1")]
    assert load_plan(f"{path}#west/0").building != load_plan(f"{path}#east/0").building
    with pytest.raises(MapError, match="several floors are called '0'"):
        load_plan(f"{path}#0")


def test_names_of_floors() -> None:
    assert choose_level(Path("x"), "", ["only"]) == "only"
    with pytest.raises(MapError, match="no floor in this file"):
        choose_level(Path("x"), "1", [])
    assert split_level("a/b.osm#-1") == (Path("a/b.osm"), "-1") and split_level("a.osm") == (
        Path("a.osm"),
        "",
    )
    assert len({known.load for known in FORMATS}) == len(FORMATS)


def test_a_file_with_a_hash_in_its_name_is_a_file(tmp_path: Path) -> None:
    write_osm(tmp_path / "house.osm").rename(tmp_path / "house#2.osm")
    assert load_plan(f"{tmp_path / 'house#2.osm'}#0").rooms


REAL = {
    "imdf_spbpu": (443, 472),
    "osm_dresden/APBorig.osm": (476, 533),
    "osmag_shanghaitech/ShanghaiTech_merge_2.osm": (262, 313),
    "rmf": (119, 152),
    "westport": (258, 327),
    "ifc": (190, 193),
}


@pytest.mark.parametrize("name", REAL)
@pytest.mark.filterwarnings("ignore::layoutexplore.errors.MapWarning")
def test_real_buildings(data_dir: Path, name: str) -> None:
    folder = data_dir / "buildings" / name
    if not folder.exists():
        pytest.skip("this building is not in the data folder")
    floors = [each for each in expand_plans(folder) if "paths" not in each and "outline" not in each]
    plans = [load_plan(each) for each in floors]
    rooms, doors = sum(len(plan.rooms) for plan in plans), sum(len(plan.doors) for plan in plans)
    assert (rooms, doors) == REAL[name]
    assert sum(share_reached(plan) > 0.7 for plan in plans) >= len(plans) / 2


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("lon='13.7000", "lon='nan' l='", "node '-1' has no usable lon and lat"),
        ("v='office'", "v='office'/><tag k='level' v='99999999999999999999999'", ""),
        ("<nd ref='-2'/>", "<nd ref='-99'/>", ""),
    ],
)
def test_buildings_of_other_places_and_floors(tmp_path: Path, old: str, new: str, said: str) -> None:
    """A floor of a number to which nothing can be added, a node that is missing, a place that is none."""
    text = write_osm(tmp_path / "home.osm").read_text()
    assert old in text
    (tmp_path / "home.osm").write_text(text.replace(old, new))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            assert load_plan(f"{tmp_path / 'home.osm'}#0").rooms
        except MapError as error:
            assert said and said in str(error)


def test_measures_and_floors_of_other_types(tmp_path: Path) -> None:
    path = write_rmf(tmp_path / "two.building.yaml")
    text = path.read_text()
    for old, new in (
        ("    measurements:\n    - [0, 2, {distance: [3, 10.0]}]", "    measurements: 1.5"),
        ("- [0, 1, {}]", "- [.inf, 1, {}]"),
        ("[250, 0, 0", "[1.0e+300, 0, 0"),
        ("distance: [3, 10.0]", "distance: [3, 1.0e+300]"),
    ):
        assert old in text
        path.write_text(text.replace(old, new))
        with warnings.catch_warnings(), contextlib.suppress(MapError):
            warnings.simplefilter("ignore")
            load_plan(path)
    path.write_text("a: &a [1]\nlevels: {x: {walls: *a}}")
    with pytest.raises(MapError, match="alias"):
        load_plan(path)


def test_outlines_that_cannot_be_put_together(tmp_path: Path) -> None:
    """An outline of a floor that crosses itself, and properties that are a list."""
    path = write_walls(tmp_path / "walls.geojson")
    data = json.loads(path.read_text())
    ring = data["features"][0]["geometry"]["coordinates"][0]
    ring[1], ring[2] = ring[2], ring[1]
    data["features"][2]["properties"] = [1]
    path.write_text(json.dumps(data))
    with pytest.warns(MapWarning, match=r"crossed themselves|without a usable geometry"):
        assert load_plan(path).rooms


def test_rooms_that_share_outlines_are_no_tangle_and_bars_are(tmp_path: Path) -> None:
    side = 30
    grid = [
        feature(box(4 * c, 4 * r, 4 * c + 4, 4 * r + 4), name="a") for r in range(side) for c in range(side)
    ]
    with pytest.warns(MapWarning, match="projected"):
        assert len(load_plan(write_collection(tmp_path / "grid.geojson", *grid)).rooms) == side**2
    bars = [feature(rotate(box(0, 0, 60, 1), 0.36 * k), name="a") for k in range(1000)]
    with pytest.warns(MapWarning), pytest.raises(MapError, match="the limit crossings"):
        load_plan(write_collection(tmp_path / "bars.geojson", *bars))


def test_floors_whose_names_hold_a_hash_can_be_named(tmp_path: Path) -> None:
    folder = write_imdf(tmp_path / "school#1")
    levels = json.loads((folder / "level.geojson").read_text())
    for name, level in zip(("A#1", "#"), levels["features"], strict=False):
        level["properties"]["short_name"] = {"en": name}
    (folder / "level.geojson").write_text(json.dumps(levels))
    named = expand_plans(folder)
    assert f"{folder}#A#1" in named and split_level("###") == (Path("##"), "")
    for spec in named:
        assert load_plan(spec).rooms and expand_plans(spec) == [spec]
