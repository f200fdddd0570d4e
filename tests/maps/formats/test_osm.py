"""OpenStreetMap files that are broken, or hold more than rooms and doors."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
from shapely import box

from layoutexplore.errors import MapError, MapWarning
from layoutexplore.maps import load_plan
from layoutexplore.maps.formats.levels import numbers_of
from tests.maps.formats.cases import LEFT, RIGHT, OsmFile, corners, write_osm, write_osmag


@pytest.mark.parametrize(
    ("text", "floors"),
    [
        ("0", {"0"}),
        ("-1-1", {"-1", "0", "1"}),
        ("1;3", {"1", "3"}),
        ("0.5", {"0.5"}),
        ("", set()),
        ("G", set()),
    ],
)
def test_levels(text: str, floors: set[str]) -> None:
    assert numbers_of(text) == floors


def test_a_text_names_two_hundred_floors_at_most() -> None:
    assert len(numbers_of("0-1000000")) == 200
    assert len(numbers_of("0-90;" * 9)) == 91  # the same again is looked at no more than that
    assert numbers_of(";" * 10**6 + "5") == set()


def test_entrances_widths_and_open_outlines(tmp_path: Path) -> None:
    file = OsmFile()
    file.node(0, 2, entrance="main", width="1.6 m".replace(" ", ""), level="0")
    file.node(60, 60, door="yes", level="0")
    file.way([(0, 0), (6, 0), (6, 4), (0, 4), (0, 2), (0, 0)], indoor="room", level="0")
    file.way([(6, 0), (9, 0), (9, 4)], indoor="room", level="0")
    file.way([(0, 10), (4, 14), (4, 10), (0, 14), (0, 10)], indoor="room", level="0")
    path = file.write(tmp_path / "hall.osm")
    with pytest.warns(MapWarning) as caught:
        plan = load_plan(path)
    said = " ".join(str(warning.message) for warning in caught)
    assert "outline is not closed" in said
    assert "crossed themselves" in said
    assert "1 of 2 doors lie on no wall" in said
    assert len(plan.rooms) == 3  # one that crosses itself is two
    assert [(door.rooms, door.width) for door in plan.doors] == [((0, 1), pytest.approx(1.6))]


def test_passages_to_other_floors_are_no_doors(tmp_path: Path) -> None:
    path = write_osmag(tmp_path / "campus.osm")
    text = path.read_text().replace("v='-1001'", "v='-77'").replace("v='-1000'", "v='-76'")
    path.write_text(text)
    assert load_plan(path).doors == ()


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda text: text[:200], "not readable as XML"),
        (lambda text: "<gpx/>", "must be OpenStreetMap"),
        (lambda text: text.replace("lon='13", "lon='east"), "no usable lon and lat"),
        (lambda text: text.replace("indoor", "outdoor"), "no floor in this file"),
    ],
)
def test_broken_files_are_named(tmp_path: Path, damage, message: str) -> None:  # type: ignore[no-untyped-def]
    path = write_osm(tmp_path / "house.osm")
    path.write_text(damage(path.read_text()))
    with pytest.raises(MapError, match=message) as caught:
        load_plan(f"{path}#0")
    assert "house.osm" in str(caught.value)


def test_towns_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "town.osm"
    with path.open("wb") as file:
        file.truncate(100_000_001)
    assert path.stat().st_blocks * 512 < 10**6  # a hole, not 100 MB
    with pytest.raises(MapError, match="100 MB, and the limit text_mb is 32"):
        load_plan(path)


def test_rooms_inside_of_rooms(tmp_path: Path) -> None:
    file = OsmFile()
    file.way(corners(box(0, 0, 10, 8)), indoor="room", level="0")
    file.way(corners(box(2, 2, 4, 5)), indoor="room", level="0")
    plan = load_plan(file.write(tmp_path / "shaft.osm"))
    raster = plan.rasterize(0.1)
    assert len(plan.rooms) == 2
    assert (raster.room_ids == 2).sum() * 0.01 == pytest.approx(1.8 * 2.8, abs=0.2)


def test_multipolygons_are_rooms_with_holes(tmp_path: Path) -> None:
    """A hall around a court, whose outline is three ways, one of them backwards, and a room beside it."""
    file = OsmFile()
    outer = [[(0, 0), (12, 0), (12, 5)], [(12, 10), (12, 5)], [(12, 10), (0, 10), (0, 0)]]
    court = [(4, 4), (8, 4), (8, 7), (4, 7), (4, 4)]
    file.multipolygon(outer, court, indoor="area", level="0", room="hall")
    file.way([(12, 5), (16, 5), (16, 10), (12, 10), (12, 5)], indoor="room", level="0")
    file.node(12, 5, door="yes", level="0")
    plan = load_plan(file.write(tmp_path / "court.osm"))
    areas = {room.label: room.polygon.area for room in plan.rooms}
    assert areas["hall"] == pytest.approx(11.8 * 9.8 - 4.2 * 3.2)
    assert [door.rooms for door in plan.doors] == [(1, 2)]


def test_rooms_that_fall_apart_keep_their_parts(tmp_path: Path) -> None:
    """A hole cuts a hall in two, and a way crosses itself: doors lead into the part that they are at."""
    file = OsmFile()
    hall = [(0, 0), (4, 0), (6, 0), (10, 0), (10, 2), (10, 4), (6, 4), (4, 4), (0, 4), (0, 2), (0, 0)]
    shaft = [(4, 0), (6, 0), (6, 4), (4, 4), (4, 0)]
    file.multipolygon([hall], shaft, indoor="area", level="0", room="hall")
    file.way([(10, 0), (14, 0), (14, 4), (10, 4), (10, 2), (10, 0)], indoor="room", level="0", room="end")
    bow = [(0, 10), (4, 13), (4, 11.5), (4, 10), (0, 13), (0, 11.5), (0, 10)]
    file.way(bow, indoor="room", level="0", room="bow")
    file.way([(4, 10), (8, 10), (8, 13), (4, 13), (4, 11.5), (4, 10)], indoor="room", level="0", room="side")
    for x, y in ((10, 2), (0, 2), (4, 11.5), (0, 11.5)):
        file.node(x, y, door="yes", level="0")
    with pytest.warns(MapWarning, match="crossed themselves"):
        plan = load_plan(file.write(tmp_path / "apart.osm"))
    names = {0: "outside"}
    names |= {n: f"{room.label} at {room.polygon.centroid.x:.0f}" for n, room in enumerate(plan.rooms, 1)}
    assert {tuple(sorted(names[n] for n in door.rooms)) for door in plan.doors} == {
        ("end at 12", "hall at 8"),
        ("hall at 2", "outside"),
        ("bow at 3", "side at 6"),
        ("bow at 1", "outside"),
    }
    assert len(plan.rooms) == 6 and len(plan.doors) == 4


def test_multipolygons_that_are_not_closed_are_left_out(tmp_path: Path) -> None:
    file = OsmFile()
    file.multipolygon(
        [[(0, 0), (9, 0)], [(9, 9), (0, 9)]], [(1, 1), (2, 1), (2, 2)], indoor="room", level="0"
    )
    file.way([(12, 5), (16, 5), (16, 10), (12, 10), (12, 5)], indoor="room", level="0")
    with pytest.warns(MapWarning, match="2 rooms whose outline is not closed"):
        assert len(load_plan(file.write(tmp_path / "open.osm")).rooms) == 1


def test_multipolygons_that_name_a_way_over_and_over_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A member takes fifty bytes and stands for a whole way; every outline is cut by every hole."""
    monkeypatch.setenv("LAYOUTEXPLORE_LIMITS", "vertices=1000")
    ring = [(0, 0), (9, 0), (9, 9), (0, 9), (0, 0)]
    often = OsmFile()
    often.multipolygon([ring] * 150, [(1, 1), (2, 1), (2, 2), (1, 1)], indoor="room", level="0")
    once = OsmFile()
    once.multipolygon([ring], [(1, 1), (2, 1), (2, 2), (1, 1)], indoor="room", level="0")
    text = once.write(tmp_path / "once.osm").read_text()
    member = re.search(r"<member [^>]*role='outer'[^>]*/>", text)
    assert member
    (tmp_path / "members.osm").write_text(text.replace(member[0], member[0] * 300))
    for path in (often.write(tmp_path / "holes.osm"), tmp_path / "members.osm"):
        with pytest.raises(MapError, match="corners of multipolygons, and the limit vertices is 1000"):
            load_plan(path)
    assert len(load_plan(tmp_path / "once.osm").rooms) == 1


def test_multipolygons_that_are_no_rooms_are_not_put_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LAYOUTEXPLORE_LIMITS", "vertices=500")
    file = OsmFile()
    ring = [(0, 0), (9, 0), (9, 9), (0, 9), (0, 0)]
    file.multipolygon([ring] * 60, [(1, 1), (2, 1), (2, 2), (1, 1)], landuse="forest")
    file.way(ring, indoor="room", level="0")
    assert len(load_plan(file.write(tmp_path / "forest.osm")).rooms) == 1


def test_ways_inside_of_ways_do_not_hand_on_their_nodes(tmp_path: Path) -> None:
    file = OsmFile()
    file.way([(0, 0), (9, 0), (9, 9), (0, 9), (0, 0)], indoor="room", level="0")
    path = file.write(tmp_path / "nested.osm")
    text = path.read_text()
    refs = re.findall(r"<nd [^>]*/>", text)
    inner = "<way id='999'>" + refs[0] * 3 + "<tag k='indoor' v='no'/></way>"
    path.write_text(text.replace("</way>", inner + "</way>", 1))
    assert [room.polygon.area for room in load_plan(path).rooms] == [pytest.approx(8.8**2, abs=0.5)]


def test_lines_that_all_end_at_one_node_are_paired_in_their_order(tmp_path: Path) -> None:
    """Blades around a middle in which thousands of lines may end, each of two lines that begin at its tip."""
    file = OsmFile()
    lines = []
    for k in range(40):
        x, y = 40 * math.cos(0.15 * k), 40 * math.sin(0.15 * k)
        right = (x + 0.1 * y, y - 0.1 * x)
        lines += [[(x, y), (0.0, 0.0)], [(x, y), right, (0.0, 0.0)]]
    file.multipolygon(lines, [], indoor="room", level="0")
    plan = load_plan(file.write(tmp_path / "blades.osm"))
    assert len(plan.rooms) == 40
    assert max(room.polygon.area for room in plan.rooms) < 80.0


def test_rooms_without_any_node_are_told(tmp_path: Path) -> None:
    path = write_osm(tmp_path / "home.osm")
    path.write_text(re.sub("<node.*</node>", "", path.read_text()))
    with pytest.raises(MapError, match="no node of this floor's rooms"):
        load_plan(f"{path}#1")


@pytest.mark.parametrize(
    ("tags", "what"),
    [
        ({"indoor": "room", "level": "0"}, "31 rooms"),
        ({"indoor": "room", "level": "1-30"}, "31 floors"),
        ({"osmAG__type": "passage", "osmAG__to": "-1000"}, "30 passages"),
    ],
)
def test_what_is_too_many_is_counted_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, tags: dict[str, str], what: str
) -> None:
    monkeypatch.setenv("LAYOUTEXPLORE_LIMITS", "rooms=25")
    file = OsmFile()
    file.way(corners(LEFT), indoor="room", level="0")
    for _ in range(30):
        file.way(corners(RIGHT), **tags)
    path = file.write(tmp_path / "home.osm")
    with pytest.raises(MapError, match=f"{what}, and the limit rooms"):
        load_plan(f"{path}#0")


def test_rooms_without_a_level_are_named(tmp_path: Path) -> None:
    file = OsmFile()
    file.way([*corners(LEFT)], indoor="room")
    with pytest.raises(MapError, match="no floor in this file: none of its 1 rooms has a level"):
        load_plan(file.write(tmp_path / "bare.osm"))
    file.way([*corners(RIGHT)], indoor="room", level="0")
    with pytest.warns(MapWarning, match="1 rooms without a level are left out"):
        assert len(load_plan(file.write(tmp_path / "half.osm")).rooms) == 1


def test_a_floor_of_rooms_without_an_area_is_told(tmp_path: Path) -> None:
    file = OsmFile()
    file.way([(0, 0), (5, 0), (9, 0), (0, 0)], indoor="room", level="0")
    with pytest.warns(MapWarning), pytest.raises(MapError, match="there is no room on this floor"):
        load_plan(file.write(tmp_path / "flat.osm"))
