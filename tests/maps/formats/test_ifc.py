"""IFC models: what lies between spaces, and models that are broken."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from shapely import MultiPolygon, Polygon, box

from layoutexplore.errors import MapError, MapWarning, MissingExtraError
from layoutexplore.maps import load_plan
from layoutexplore.maps.formats import ifc
from layoutexplore.maps.formats.ifc_geometry import write_floors
from tests.maps.cases import share_reached
from tests.maps.formats.cases import IfcModel, write_ifc


@pytest.fixture
def model() -> IfcModel:
    return IfcModel()


def storey(model: IfcModel, home: str = "house", name: str = "EG") -> Any:
    return model.storey(model.part("IfcBuilding", home, model.site), name, 0.0)


def test_spaces_that_touch_where_no_wall_is_are_open_to_each_other(model: IfcModel, tmp_path: Path) -> None:
    floor = storey(model)
    for name, area in (("kitchen", box(0, 0, 4, 4)), ("living", box(4, 0, 9, 4)), ("bath", box(0, 4, 4, 7))):
        model.space(floor, area, name)
    model.wall(floor, box(-0.1, 3.9, 4.1, 4.1))  # spaces meet in the middle of this one
    model.wall(floor, box(3.9, 0, 4.1, 4), bottom=2.1)  # hangs over the opening
    plan = load_plan(model.write(tmp_path / "flat.ifc"))
    assert [(door.rooms, round(door.width, 2)) for door in plan.doors] == [((1, 2), 3.7)]
    assert [round(room.polygon.bounds[3], 2) for room in plan.rooms] == [3.9, 4.0, 7.0]
    assert share_reached(plan) < 0.85  # nobody gets into the bathroom


def test_holes_of_walls_are_doorways_if_one_can_walk_through(model: IfcModel, tmp_path: Path) -> None:
    floor = storey(model)
    for k in range(3):
        model.space(floor, box(4 * k + 0.1, 0, 4 * k + 3.9, 3), f"room {k}")
    first = model.wall(floor, box(3.9, 0, 4.1, 3))
    second = model.wall(floor, box(7.9, 0, 8.1, 3))
    model.hole(first, box(3.9, 1, 4.1, 2.2), height=2.2)
    model.hole(second, box(7.9, 0.5, 8.1, 1.5), bottom=0.9, height=2.0)  # a hatch
    model.hole(second, box(7.9, 2, 8.1, 2.5), height=0.5)  # for a pipe
    model.hole(second, box(7.9, 2.7, 8.1, 2.8))  # for a duct
    cubicle = model.wall(floor, box(0.8, 1.45, 2.4, 1.55))
    model.door(floor, model.hole(cubicle, box(1.2, 1.45, 2, 1.55)), 0.8)
    with pytest.warns(MapWarning, match="1 doors inside of one room are left out"):
        plan = load_plan(model.write(tmp_path / "row.ifc"))
    assert [(door.rooms, round(door.width, 2)) for door in plan.doors] == [((1, 2), 1.2)]


def test_doors_without_a_hole_and_deep_walls(model: IfcModel, tmp_path: Path) -> None:
    """The door's own shape tells where it is, the model how wide: a deep wall makes no wide door."""
    floor = storey(model)
    model.space(floor, box(0, 0, 4, 3), "a")
    model.space(floor, box(4.6, 0, 9, 3), "b")
    model.wall(floor, box(4, 0, 4.6, 3))
    door = model.add("IfcDoor", "gate")
    door.OverallWidth = 500.0
    model.run("spatial.assign_container", products=[door], relating_structure=floor)
    model.block(door, box(4, 1, 4.6, 1.5), 0.0, 2.0)
    plan = load_plan(model.write(tmp_path / "deep.ifc"))
    assert [(door.rooms, round(door.width, 2)) for door in plan.doors] == [((1, 2), 0.5)]
    assert plan.doors[0].start[0] == pytest.approx(4.3, abs=0.05)


def test_sums_of_spaces_and_spaces_without_shape_are_no_rooms(model: IfcModel, tmp_path: Path) -> None:
    floor = storey(model)
    model.space(floor, box(0, 0, 8.2, 3), "whole floor")
    model.space(floor, box(0, 0, 4, 3), "a")
    model.space(floor, box(4.2, 0, 8.2, 3), "b")
    model.part("IfcSpace", "bare", floor)
    with pytest.warns(
        MapWarning, match="1 spaces of the model have no shape .*1 spaces are the sum of others"
    ):
        plan = load_plan(model.write(tmp_path / "sum.ifc"))
    assert [room.label for room in plan.rooms] == ["a", "b"]


def test_models_without_usable_spaces_are_told_what_lacks(model: IfcModel, tmp_path: Path) -> None:
    floor = storey(model)
    model.wall(floor, box(0, 0, 4, 0.2))
    model.part("IfcSpace", "flat", floor)
    with pytest.raises(MapError, match=r"has a space \(IfcSpace\) with a shape, 1 have none: export rooms"):
        load_plan(model.write(tmp_path / "walls.ifc"))


def test_storeys_of_several_buildings_and_of_one_name(model: IfcModel, tmp_path: Path) -> None:
    for home in ("east", "west"):
        model.space(storey(model, home), box(0, 0, 4, 3), "a")
    path = model.write(tmp_path / "campus.ifc")
    assert ifc.ifc_levels(path) == ["east/EG", "west/EG"]
    assert load_plan(f"{path}#west/EG").building != load_plan(f"{path}#east/EG").building
    twice = IfcModel()
    home = twice.part("IfcBuilding", "house", twice.site)
    for height in (0.0, 3.5):
        twice.space(twice.storey(home, "floor", height), box(0, 0, 4, 3), "a", height)
    assert ifc.ifc_levels(twice.write(tmp_path / "two.ifc")) == ["floor", "floor at 3.5 m"]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("<html>", "is no IFC model: it must begin with ISO-10303-21"),
        ("ISO-10303-21;\nnothing", "the model is cut short"),
        ("ISO-10303-21;\nnothing\nEND-ISO-10303-21;", "IfcOpenShell cannot read the model: "),
    ],
)
def test_broken_models_are_named(tmp_path: Path, content: str, said: str) -> None:
    pytest.importorskip("ifcopenshell")
    path = tmp_path / "broken.ifc"
    path.write_text(content)
    with pytest.raises(MapError, match=rf"broken\.ifc: {said}"):
        load_plan(path)


def test_a_model_cut_short(tmp_path: Path) -> None:
    text = write_ifc(tmp_path / "house.ifc").read_text()
    path = tmp_path / "half.ifc"
    path.write_text(text[: len(text) // 3])
    with pytest.raises(MapError, match=r"half\.ifc: the model is cut short"):
        load_plan(path)


@pytest.mark.parametrize(
    ("ended", "said"),
    [
        (subprocess.CompletedProcess([], -11, b"", b""), "the reader died of signal 11"),
        (subprocess.CompletedProcess([], 1, b"", b"one\ntwo"), "cannot read the model: two"),
        (subprocess.TimeoutExpired("ifc", 1.0), "takes more than 600 s"),
    ],
)
def test_a_reader_that_dies_takes_nothing_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ended: Any, said: str
) -> None:
    path = write_ifc(tmp_path / "house.ifc")

    def run(*_: Any, **__: Any) -> Any:
        if isinstance(ended, Exception):
            raise ended
        return ended

    monkeypatch.setattr(ifc.subprocess, "run", run)
    with pytest.raises(MapError, match=said):
        load_plan(f"{path}#EG")


@pytest.mark.skipif(sys.platform == "win32", reason="no such limit there")
def test_who_calls_the_reader_himself_keeps_his_memory(tmp_path: Path) -> None:
    import resource

    before = resource.getrlimit(resource.RLIMIT_AS)
    assert write_floors(str(tmp_path / "missing.ifc"), str(tmp_path / "floors.json")) == 1
    assert resource.getrlimit(resource.RLIMIT_AS) == before


def test_without_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_ifc(tmp_path / "house.ifc")
    monkeypatch.setitem(sys.modules, "ifcopenshell", None)
    with pytest.raises(MissingExtraError, match=r"layoutexplore\[bim\]"):
        load_plan(f"{path}#EG")


def of_spaces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, spaces: list[Any], doors: Any) -> Path:
    """A model of which IfcOpenShell has found so many spaces and doors on one storey without walls."""
    floor = {"name": "EG", "building": "house", "height": 0.0, "solid": "POLYGON EMPTY"}
    floor |= {"spaces": [["", space.wkt] for space in spaces], "openings": doors}
    monkeypatch.setattr(ifc, "_extracted", lambda *_: {"floors": [floor], "without_shape": 0})
    path = tmp_path / "storey.ifc"
    path.write_text("")
    return path


def test_spaces_that_fall_apart_keep_their_parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    apart = box(0, 0, 4, 3) | box(5, 0, 9, 3) | box(10, 0, 10.9, 1)
    with pytest.warns(MapWarning, match="1 parts of rooms are left out"):
        plan = ifc.load_ifc(of_spaces(tmp_path, monkeypatch, [apart, box(0, 4, 9, 6)], []))
    assert sorted(round(room.polygon.centroid.x, 1) for room in plan.rooms) == [2.0, 4.5, 7.0]
    halves = Polygon([(0, 0), (4, 0), (4, 3)]), Polygon([(0, 0.0003), (4, 3.0003), (0, 3)])
    plan = ifc.load_ifc(of_spaces(tmp_path, monkeypatch, [MultiPolygon(halves)], []))
    assert len(plan.rooms) == 1  # cut by a hair


def test_a_storey_of_a_thousand_rooms(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    corners = [(round(3.7 * i, 4), round(2.9 * j, 4)) for i in range(40) for j in range(40)]
    spaces = [box(x + 0.1, y + 0.1, x + 3.6, y + 2.8) for x, y in corners]
    doors = [[x, y + 1.4, 0.9] for x, y in corners if x > 0]
    plan = ifc.load_ifc(of_spaces(tmp_path, monkeypatch, spaces, doors))
    assert (len(plan.rooms), len(plan.doors)) == (1600, 1560)
    assert all(0 not in door.rooms for door in plan.doors)


@pytest.mark.parametrize(
    "spaces, doors, said",
    [
        ([box(k, k, 2000 - k, 2000 - k) for k in range(300)], 0, "pairs of them, and at most 20000 may"),
        ([box(0, k / 9, 90, 90 + k / 9) for k in range(400)], 0, "7980 times ten pairs of spaces"),
        ([box(0, 0, 9, 9)] * 120, 0, "5001 doors and open borders, and the limit rooms is 5000"),
        ([box(0, 0, 9, 9)], 6000, "6000 doors and holes of walls, and the limit rooms is 5000"),
    ],
)
def test_heaps_of_spaces_and_doors_are_counted_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, spaces: list[Any], doors: int, said: str
) -> None:
    path = of_spaces(tmp_path, monkeypatch, spaces, [[0.0, 4.0, 0.9]] * doors)
    with pytest.raises(MapError, match=said):
        ifc.load_ifc(path)
