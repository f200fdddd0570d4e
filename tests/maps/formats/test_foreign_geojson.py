"""GeoJSON as QGIS and others write it."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from shapely import LineString, MultiPolygon, Point, Polygon, affinity, box
from shapely.geometry import mapping

from layoutexplore.errors import ConfigError, MapError, MapWarning
from layoutexplore.maps import load_plan
from layoutexplore.maps.formats.foreign_geojson import load_foreign_geojson
from layoutexplore.maps.geojson import save_plan
from tests.maps.cases import share_reached, two_rooms


def write(folder: Path, *features: tuple[Any, dict[str, Any]], name: str = "qgis") -> Path:
    """A file as QGIS exports a layer."""
    data = {
        "type": "FeatureCollection",
        "name": name,
        "crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::25833"}},
        "features": [
            {"type": "Feature", "properties": properties, "geometry": mapping(shape)}
            for shape, properties in features
        ],
    }
    (folder / f"{name}.geojson").write_text(json.dumps(data))
    return folder / f"{name}.geojson"


ROOMS = (
    (MultiPolygon([box(0, 0, 4, 5)]), {"fid": 1, "Bezeichnung": "Office"}),
    (MultiPolygon([box(4, 0, 9, 5)]), {"fid": 2, "Bezeichnung": "Lab"}),
    (LineString([(4, 2), (4, 3.2)]), {"fid": 3, "Bezeichnung": None}),
    (Point(0, 2.5), {"fid": 4, "Bezeichnung": None}),
)


def test_multipolygons_with_columns_of_any_name(tmp_path: Path) -> None:
    plan = load_plan(write(tmp_path, *ROOMS), columns={"room": "Bezeichnung"})
    assert [room.label for room in plan.rooms] == ["Office", "Lab"]
    assert [door.rooms for door in plan.doors] == [(1, 2), (0, 1)]
    assert [door.width for door in plan.doors] == pytest.approx([1.2, 0.9])
    assert plan.rooms[0].polygon.area == pytest.approx(3.8 * 4.8)
    assert share_reached(plan) == 1.0
    assert [room.label for room in load_plan(write(tmp_path, *ROOMS)).rooms] == ["", ""]


@pytest.mark.parametrize("thick", [0.08, 0.2, 0.4])
def test_rooms_that_lie_apart_keep_their_size(tmp_path: Path, thick: float) -> None:
    rooms = [box(0, 0, 4, 5), box(4 + thick, 0, 9, 5), box(0, 5 + thick, 9, 8)]
    doors = [
        LineString([(4 + thick / 2, 2), (4 + thick / 2, 3)]),
        LineString([(1, 5 + thick / 2), (2, 5.04)]),
    ]
    plan = load_plan(write(tmp_path, *((shape, {}) for shape in [*rooms, *doors])))
    assert [room.polygon.area for room in plan.rooms] == pytest.approx([room.area for room in rooms])
    assert [door.rooms for door in plan.doors] == [(1, 2), (1, 3)]
    assert share_reached(plan) == 1.0


def test_two_rooms_that_touch_among_many_that_lie_apart_have_a_wall(tmp_path: Path) -> None:
    rooms = [box(4.2 * k, 0, 4.2 * k + 4, 5) for k in range(7)] + [box(4.2 * 6 + 4, 0, 34, 5)]
    plan = load_plan(write(tmp_path, *((shape, {}) for shape in rooms)))
    assert [room.polygon.area for room in plan.rooms[:6]] == pytest.approx([20.0] * 6)
    x = rooms[7].bounds[0]
    assert plan.walls.contains(box(x - 0.09, 0, x + 0.09, 5))
    assert [room.polygon.area for room in plan.rooms[6:]] == pytest.approx([19.5, 5 * (34 - x) - 0.5])


def test_columns_that_are_not_there_are_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"no feature has the property 'Raum'; there are: Bezeichnung, fid"):
        load_plan(write(tmp_path, *ROOMS), columns={"room": "Raum"})
    with pytest.raises(ConfigError, match="columns can be named for"):
        load_plan(write(tmp_path, *ROOMS), columns={"colour": "Raum"})


class Counted(dict[str, Any]):
    """A table that counts how often its names are listed."""

    listed = 0

    def __iter__(self) -> Iterator[str]:
        Counted.listed += 1
        return super().__iter__()


def test_a_table_that_many_parts_share_is_listed_once(tmp_path: Path) -> None:
    shape = mapping(MultiPolygon([box(x, 0, x + 1, 1) for x in range(300)]))
    data = {"type": "FeatureCollection", "features": [{"geometry": shape, "properties": Counted(a=1, b=2)}]}
    with pytest.raises(ConfigError, match="there are: a, b"):
        load_foreign_geojson(tmp_path / "x.geojson", {"room": "Raum"}, data)
    assert Counted.listed < 5


def test_outlines_of_floors_that_cross_each_other_are_counted_before_they_are_joined(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LAYOUTEXPLORE_LIMITS", "crossings=100")
    bars = [box(k, 0, k + 0.5, 40) for k in range(40)] + [box(0, k, 40, k + 0.5) for k in range(40)]
    path = write(tmp_path, *((bar, {"art": "footprint"}) for bar in bars))
    with pytest.raises(MapError, match="more than 100 times"):
        load_plan(path, columns={"kind": "art"})


def test_degrees_are_projected_and_feet_of_a_country_refused(tmp_path: Path) -> None:
    degrees = write(
        tmp_path,
        (box(13.7, 51.0, 13.7 + 10 / 70055.2, 51.0 + 6 / 111320), {"name": "hall"}),
        (box(13.7 + 10 / 70055.2, 51.0, 13.7 + 20 / 70055.2, 51.0 + 6 / 111320), {"name": "store"}),
    )
    with pytest.warns(MapWarning, match="projected"):
        plan = load_plan(degrees)
    assert plan.bounds[2] - plan.bounds[0] == pytest.approx(20.2, abs=0.05)
    far = write(tmp_path, (box(0, 0, 1, 1), {}), (box(9e5, 4e6, 9e5 + 5, 4e6 + 5), {}))
    with pytest.raises(MapError, match="no size of a building in metres"):
        load_plan(far)


def test_what_is_dropped_is_said(tmp_path: Path) -> None:
    crossed = Polygon([(10, 0), (14, 4), (14, 0), (10, 4)])
    path = write(
        tmp_path,
        *((shape, {**properties, "art": ""}) for shape, properties in ROOMS),
        (crossed, {"fid": 9}),
        (Point(50, 50), {"fid": 5}),
        (LineString([(0, 0), (40, 0)]), {"fid": 6}),
        (box(0, 0, 9, 5), {"art": "Wall"}),
        (Polygon(), {"fid": 8}),
        (Polygon([(70, 70), (77, 70), (70, 71)]), {"fid": 7}),
    )
    path.write_text(path.read_text().replace("77.0", "NaN"))
    with pytest.warns(MapWarning) as caught:
        plan = load_plan(path, columns={"kind": "art"})
    assert {warning.category for warning in caught} == {MapWarning}
    said = " ".join(str(warning.message) for warning in caught)
    parts = ("crossed themselves", "without a usable width", "of kind 'wall'", "without a usable geometry")
    for part in parts:
        assert part in said, part
    assert "1 of 3 doors lie on no wall" in said
    assert len(plan.rooms) == 4 and len(plan.doors) == 2
    with pytest.raises(MapError, match="no polygon that could be a room"):
        load_plan(write(tmp_path, (Point(1, 1), {})))


def test_our_own_format_saved_by_a_gis_is_read_as_ours(tmp_path: Path) -> None:
    plan = two_rooms()
    save_plan(plan, tmp_path / "own.geojson")
    data = json.loads((tmp_path / "own.geojson").read_text())
    for key in ("format", "version", "units", "metadata", "building"):
        data.pop(key)
    for feature in data["features"]:
        geometry = feature["geometry"]
        if not geometry["type"].startswith("Multi"):
            feature["geometry"] = {
                "type": f"Multi{geometry['type']}",
                "coordinates": [geometry["coordinates"]],
            }
    (tmp_path / "own.geojson").write_text(json.dumps(data))
    assert load_plan(tmp_path / "own.geojson").content_hash == plan.content_hash


def test_areas_are_compared_with_the_rooms_that_they_lie_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Thousands of rooms with an area each: no room is compared with the areas of all others."""
    places = [(2.2 * i, 2.2 * j) for i in range(15) for j in range(15)]
    holes = [box(x + 0.1, y + 0.1, x + 2.1, y + 2.1).exterior for x, y in places]
    features: list[tuple[Any, dict[str, Any]]] = [
        (box(0, 0, 33.1, 33.1), {"art": "footprint"}),
        (Polygon(box(0, 0, 33.1, 33.1).exterior, holes), {"art": "wall"}),
    ]
    features += [
        (box(x + 0.3, y + 0.3, x + 1.5, y + 1.5), {"art": "office", "label": f"{x:g} {y:g}"})
        for x, y in places
    ]
    calls = 0
    intersection = Polygon.intersection

    def counted(*arguments: Any, **options: Any) -> Any:
        nonlocal calls
        calls += 1
        return intersection(*arguments, **options)

    monkeypatch.setattr(Polygon, "intersection", counted)
    plan = load_plan(write(tmp_path, *features), columns={"kind": "art"})
    labels = {room.label: room.polygon.bounds[:2] for room in plan.rooms}
    assert len(labels) == 225
    assert all(labels[f"{x:g} {y:g}"] == pytest.approx((x + 0.1, y + 0.1)) for x, y in places)
    assert calls < 2000


def test_a_warning_names_some_of_the_kinds_that_are_left_out(tmp_path: Path) -> None:
    made_up = [(Point(k, 0), {"art": f"kind {k} " + "x" * 2000}) for k in range(300)]
    path = write(tmp_path, (box(0, 0, 9, 9), {"art": "room"}), *made_up)
    with pytest.warns(MapWarning, match="1 Point features of kind .*, and 280 other kinds") as caught:
        load_plan(path, columns={"kind": "art"})
    assert len(str(caught[0].message)) < 10_000


def test_outlines_that_cross_themselves_are_counted_together(tmp_path: Path) -> None:
    """A star of 131 corners crosses itself 8,385 times; mended it has no hole where it lies over itself."""
    angles = np.arange(131) * 2 * np.pi * 65 / 131
    star = Polygon(np.stack([5 * np.cos(angles), 5 * np.sin(angles)], axis=1))
    with pytest.warns(MapWarning, match="1 polygons crossed themselves"):
        plan = load_plan(write(tmp_path, (star, {})))
    assert len(plan.rooms) == 1 and len(plan.rooms[0].polygon.interiors) == 0
    with pytest.raises(MapError, match="places where outlines cross themselves"):
        load_plan(write(tmp_path, (star, {}), (affinity.translate(star, 20), {})))


def test_areas_are_counted_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LAYOUTEXPLORE_LIMITS", "rooms=25")
    areas = [{"geometry": mapping(box(k, 0, k + 1, 9)), "properties": {}} for k in range(30)]
    (tmp_path / "areas.geojson").write_text(json.dumps({"features": areas}))
    with pytest.raises(MapError, match="30 areas, and the limit rooms is 25"):
        load_foreign_geojson(tmp_path / "areas.geojson")


def test_a_drawing_in_feet_has_walls_and_doors_of_the_usual_size(tmp_path: Path) -> None:
    feet = 1 / 0.3048
    drawn = [(affinity.scale(shape, feet, feet, origin=(0, 0)), properties) for shape, properties in ROOMS]
    metres, scaled = load_plan(write(tmp_path, *ROOMS)), load_plan(write(tmp_path, *drawn), resolution=0.3048)
    assert [door.width for door in scaled.doors] == pytest.approx([door.width for door in metres.doors])
    assert scaled.area == pytest.approx(metres.area) and share_reached(scaled) == 1.0
    assert scaled.metadata["scale"] == "0.3048 m a unit (as given)"
    wide = (LineString([(4 * feet, 2), (4 * feet, 3)]), {"width": 1.5 * feet})
    scaled = load_plan(write(tmp_path, *drawn[:2], wide), resolution=0.3048)
    assert scaled.doors[0].width == pytest.approx(1.5)
    # A plan of ours has its walls: it is stretched with them, whatever scale it tells of.
    save_plan(scaled, tmp_path / "own.geojson")
    assert load_plan(tmp_path / "own.geojson", resolution=0.5).area == pytest.approx(scaled.area / 4)


def test_degrees_are_corrected_by_a_unit(tmp_path: Path) -> None:
    path = write(tmp_path, (box(10.0, 50.0, 10.0002, 50.0001), {}))
    with pytest.warns(MapWarning, match="projected"):
        width, wide = (load_plan(path, resolution=unit).bounds for unit in (None, 1.1))
    assert wide[2] - wide[0] == pytest.approx(1.1 * (width[2] - width[0]), rel=0.01)
    with pytest.raises(MapError, match="is no unit of a drawing"):
        load_plan(path, resolution=1e-5)


@pytest.mark.parametrize("key", ["level_id", "LEVEL_ID"])
def test_floors_that_would_lie_on_each_other_are_told(tmp_path: Path, key: str) -> None:
    rooms = [(box(0, 0, 4, 5), {key: "a"}), (box(0, 0, 9, 5), {key: "b"})]
    path = write(tmp_path, *rooms, name="unit")
    with pytest.raises(MapError, match=r"on 2 floors .* give the folder of all files"):
        load_plan(path)
    (tmp_path / "level.geojson").write_text("{}")
    with pytest.raises(MapError, match=f"give the folder {tmp_path} "):
        load_plan(path)
    assert len(load_plan(write(tmp_path, *rooms[:1])).rooms) == 1


def test_the_coordinate_system_that_a_file_declares_is_heard(tmp_path: Path) -> None:
    path = write(tmp_path, (box(1e6, 6.6e6, 1e6 + 16, 6.6e6 + 8), {}))
    text = path.read_text()
    path.write_text(text.replace("25833", "3857"))
    with pytest.warns(MapWarning, match="Web Mercator"):
        x0, _, x1, _ = load_plan(path).bounds
    assert x1 - x0 == pytest.approx(16 * 0.631 + 0.2, abs=0.02)
    path.write_text(text.replace("25833", "2263"))
    with pytest.raises(MapError, match="are feet"):
        load_plan(path)
    assert load_plan(path, resolution=0.3048).bounds[2] == pytest.approx((1e6 + 16) * 0.3048 + 0.1)


def test_every_part_of_a_room_that_falls_apart_is_a_room(tmp_path: Path) -> None:
    bow = Polygon([(0, 0), (5, 4), (5, 0), (0, 4)])
    uneven = Polygon([(10, 0), (15, 4), (15, 0), (13.2, 3)])
    path = write(tmp_path, (bow, {"name": "hall"}), (uneven, {"name": "store"}))
    with pytest.warns(MapWarning, match="2 polygons crossed themselves.* 1 parts of rooms are left out"):
        plan = load_plan(path)
    assert [room.label for room in plan.rooms] == ["hall", "hall", "store"]


def test_floors_of_a_building_name_it(tmp_path: Path) -> None:
    floors = [write(tmp_path, *ROOMS, name=f"house-floor-{floor}") for floor in ("gf", "1", "2")]
    assert {load_plan(floor).building for floor in floors} == {"house"}
    assert {load_plan(floor).name for floor in floors} == {"house-floor-gf", "house-floor-1", "house-floor-2"}
    (tmp_path / "school").mkdir()
    assert load_plan(write(tmp_path / "school", *ROOMS, name="level-1")).building == "school"
    walls = write(tmp_path, (box(0, 0, 9, 9), {"type": "building_outline"}), name="mill_3")
    assert load_plan(walls).building == "mill"


@pytest.mark.parametrize(
    ("whole", "rooms", "building"),
    [
        ("Annex", ["a", "b"], "Annex"),
        (7, ["a", "a"], "7"),
        (None, ["Annex", "Annex"], "Annex"),
        (None, ["a", "b"], "hall"),
        (None, ["Annex", None], "hall"),
        (None, ["yes", "yes"], "hall"),
        (["x"], [None, None], "hall"),
        (None, ["university", "university"], "hall"),
        (None, [{"a": 1}, {"a": 1}], "hall"),
        ("x" * 2000, [None, None], "hall"),
    ],
)
def test_a_building_that_is_named_comes_first(
    tmp_path: Path, whole: Any, rooms: list[Any], building: str
) -> None:
    left, right = ((shape, {"building": name}) for (shape, _), name in zip(ROOMS[:2], rooms, strict=True))
    path = write(tmp_path, left, right, name="hall-1")
    path.write_text(json.dumps({**json.loads(path.read_text()), "building": whole}))
    assert load_plan(path).building == building


@pytest.mark.parametrize("kinds", [("office", None, "door"), ("room", "room", "door"), ("room", "x", None)])
def test_a_property_that_is_called_kind_makes_no_file_ours(
    tmp_path: Path, kinds: tuple[str | None, ...]
) -> None:
    shapes = (box(0, 0, 4, 5), box(4, 0, 9, 5), LineString([(4, 2), (4, 3)]))
    parts = ((shape, {"kind": kind, "name": "A"}) for shape, kind in zip(shapes, kinds, strict=True))
    plan = load_plan(write(tmp_path, *parts))
    assert len(plan.rooms) == 2 and [door.rooms for door in plan.doors] == [(1, 2)]


def test_a_file_that_looks_like_ours_is_told_of_columns(tmp_path: Path) -> None:
    path = write(tmp_path, (box(0, 0, 4, 5), {"kind": "room", "id": 1}), (Point(4, 2), {"kind": "door"}))
    with pytest.raises(MapError, match=r"feature 1 \(door\): geometry must be .*--column room=NAME"):
        load_plan(path)
    assert len(load_plan(path, columns={"kind": "kind"}).rooms) == 1


def test_rooms_that_lie_on_each_other_are_told(tmp_path: Path) -> None:
    floors = [(room, {"level": level}) for level in "01" for room in (box(0, 0, 5, 4), box(5, 0, 9, 4))]
    with pytest.warns(MapWarning, match=r"2 pairs of rooms lie on each other \(rooms 1 and 3\)"):
        load_plan(write(tmp_path, *floors))
    # A whole with rooms in it, up to its border, is one floor.
    nested = [(room, {}) for room in (box(0, 0, 9, 9), box(0, 0, 5, 4), box(6, 5, 8, 8))]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(load_plan(write(tmp_path, *nested)).rooms) == 3


@pytest.mark.filterwarnings("ignore::layoutexplore.errors.MapWarning")
def test_walls_and_doors_may_be_lines_inside_of_an_outline(tmp_path: Path) -> None:
    shell = [(0, 0), (10, 0), (10, 4), (0, 4), (0, 0)]
    lines = {"wall": [shell, [(5, 0), (5, 1)], [(5, 1.9), (5, 4)]], "door": [[(5, 1), (5, 1.9)]]}
    drawn = [(LineString(line), {"type": kind}) for kind, of_kind in lines.items() for line in of_kind]
    plan = load_plan(write(tmp_path, (box(0, 0, 10, 4), {"type": "building_outline"}), *drawn))
    assert [room.polygon.area for room in plan.rooms] == pytest.approx([4.8 * 3.8] * 2, abs=0.15)
    assert [(door.rooms, round(door.width, 2)) for door in plan.doors] == [((1, 2), 0.9)]


@pytest.mark.parametrize("width", ["0.9 m", 90, "wide", -1])
def test_doors_whose_width_is_unusable_are_as_wide_as_drawn(tmp_path: Path, width: object) -> None:
    rooms = [(box(0, 0, 5, 4), {}), (box(5, 0, 10, 4), {})]
    doors = [(LineString([(5, 1), (5, 2.2)]), {"width": width}), (Point(0, 2), {"width": width})]
    with pytest.warns(MapWarning, match="2 doors have a width that is no number of metres"):
        plan = load_plan(write(tmp_path, *rooms, *doors))
    assert [round(door.width, 2) for door in plan.doors] == [1.2, 0.9]
