"""School buildings as XML."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from shapely import LineString

from layoutexplore.errors import MapError, MapWarning
from layoutexplore.maps import load_plan
from tests.maps.cases import RADIUS, SCHOOL, share_reached


def test_a_school_in_metres_with_y_up(tmp_path: Path) -> None:
    (tmp_path / "Some_school_2.xml").write_text(SCHOOL)
    plan = load_plan(tmp_path / "Some_school_2.xml")
    assert plan.building == "Some_school"
    assert [(room.label, room.polygon.bounds) for room in plan.rooms] == [
        ("classroom", pytest.approx((0.1, -2.9, 5.9, -0.1))),
        ("corridor", pytest.approx((0.1, -5.9, 5.9, -3.28))),
    ]
    (door,) = plan.doors
    assert door.width == pytest.approx(0.9)
    assert door.start[1] == pytest.approx(-3.09)  # in the middle of the gap of 6 pixels
    assert share_reached(plan) == 1.0
    assert share_reached(plan.with_doors_closed([0])) < 0.6


def test_a_portal_without_its_segment_opens_where_the_rooms_are_nearest(tmp_path: Path) -> None:
    (tmp_path / "lost.xml").write_text(SCHOOL.replace('linesegment id="s"', 'linesegment id="other"'))
    plan = load_plan(tmp_path / "lost.xml")
    assert len(plan.doors) == 1
    assert share_reached(plan) == 1.0


PORTAL_PARTS = (("portal>", "portal"), ("linesegment id", "linesegment"))


def test_portals_are_counted_as_they_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each is compared with all before it between the same rooms: the file stops at the first too many."""
    monkeypatch.setenv("LAYOUTEXPLORE_LIMITS", "rooms=5")
    portal, segment = (re.search(f"<{tag}.*?</{name}>", SCHOOL, re.DOTALL) for tag, name in PORTAL_PARTS)
    assert portal and segment
    portals = "".join(portal[0].replace(">s<", f">s{k}<") for k in range(40))
    segments = "".join(
        segment[0].replace('id="s"', f'id="s{k}"').replace('x="30"', f'x="{100 * k}"') for k in range(40)
    )
    text = SCHOOL.replace(portal[0], portals, 1).replace(segment[0], segments, 1)
    (tmp_path / "many.xml").write_text(text)
    with pytest.raises(MapError, match="6 doors, and the limit rooms is 5"):
        load_plan(tmp_path / "many.xml")


def test_empty_spaces_are_left_out_and_counted(tmp_path: Path) -> None:
    empty = '<space id="e"><labels><label>ROOM</label></labels></space>'
    (tmp_path / "office.xml").write_text(SCHOOL.replace("</spaces>", 3 * empty + "</spaces>"))
    with pytest.warns(MapWarning, match="3 of 5 spaces"):
        plan = load_plan(tmp_path / "office.xml")
    assert len(plan.rooms) == 2 and len(plan.doors) == 1


def test_no_space_gets_lost_without_a_word(tmp_path: Path) -> None:
    """Spaces of one id are two rooms; that half of one is left out, as it crosses itself, is told."""
    bow = "".join(f'<point x="{x}" y="{y}"/>' for x, y in ((700, 0), (820, 150), (820, 0), (700, 150)))
    spaces = "".join(
        f'<space id="a"><bounding_polygon>{points}</bounding_polygon></space>'
        for points in (bow, bow.replace("7", "9").replace("82", "98"))
    )
    (tmp_path / "bow.xml").write_text(SCHOOL.replace("</spaces>", spaces + "</spaces>"))
    with pytest.warns(MapWarning, match="2 spaces cross themselves, and parts of them are left out"):
        plan = load_plan(tmp_path / "bow.xml")
    (tmp_path / "school.xml").write_text(SCHOOL)
    assert len(plan.rooms) == len(load_plan(tmp_path / "school.xml").rooms) + 2


def test_all_offices_load(data_dir: Path) -> None:
    paths = sorted((data_dir / "buildings" / "offices").glob("*.xml"))
    if not paths:
        pytest.skip("no offices in the data folder")
    with pytest.warns(MapWarning, match="have no bounding_polygon"):
        plans = [load_plan(path) for path in paths]
    assert sum(len(plan.rooms) for plan in plans) == 442


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text[:300], "not readable as XML"),
        (lambda text: "<building/>", "scale"),
        (lambda text: text.replace("<value>30</value>", ""), "<scale>: .* represented_distance is missing"),
        (
            lambda text: text.replace("<value>90<", "<value>1e999<"),
            "real_distance is no finite number: '1e999'",
        ),
        (lambda text: text.replace("<value>30</value>", "<value>0</value>"), "makes no sense"),
        (lambda text: text.replace("<um>cm</um>", "<um>parsec</um>"), "makes no sense"),
        (
            lambda text: text.replace('<point x="200" y="0"/>', '<point x="wide" y="0"/>'),
            "unusable coordinates",
        ),
        (lambda text: text.replace('<point x="200" y="100"/><point x="0" y="100"/>', ""), "needs 3 points"),
        (lambda text: text.replace("bounding_polygon", "outline"), "no <space>"),
        (lambda text: text.replace("space", "place"), "no <space>"),
    ],
)
def test_bad_school_xml(tmp_path: Path, change: Callable[[str], str], message: str) -> None:
    path = tmp_path / "bad.xml"
    path.write_text(change(SCHOOL))
    with pytest.raises(MapError, match=message) as caught:
        load_plan(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("was", "now", "message"),
    [
        ('x="200" y="200"', 'x="abc" y="200"', "space 'b', point 3 of its bounding_polygon: .* x='abc' is"),
        ('x="200" y="200"', 'x="200" y="nan"', "space 'b', point 3 .* y='nan' is no finite number"),
        ('x="200" y="200"', 'x="200" y="1e999"', "space 'b', point 3 .* y='1e999' is no finite number"),
        ('x="200" y="200"', 'x="200"', "space 'b', point 3 .* has no y"),
        (
            'x="200" y="200"',
            'x="1e99" y="200"',
            "space 'b', point 3 .* x='1e99' is 3e\\+97 m from the origin",
        ),
        ('x="30" y="100"', 'x="" y="100"', "linesegment 's', its first point: .* x='' is no finite number"),
    ],
)
def test_a_number_that_cannot_be_read_is_told_with_its_place(
    tmp_path: Path, was: str, now: str, message: str
) -> None:
    (tmp_path / "bad.xml").write_text(SCHOOL.replace(was, now))
    with pytest.raises(MapError, match=rf"bad\.xml: {message}"):
        load_plan(tmp_path / "bad.xml")


def test_all_schools_load_and_can_be_walked(data_dir: Path) -> None:
    """At 0.1 m and a robot of 0.2 m, at least 98 % hang together, and doors pierce no third room."""
    paths = sorted((data_dir / "floorplans" / "schools").glob("*.xml"))
    assert len(paths) == 28
    for path in paths:
        plan = load_plan(path)
        assert share_reached(plan) >= 0.98, path.name
        raster = plan.rasterize(0.1)
        target = raster.coverage_target(RADIUS)
        assert target.sum() >= 0.98 * raster.free.sum(), path.name
        connected = {room for door in plan.doors for room in door.rooms}
        seen = set(np.unique(raster.room_ids[target]))
        assert {room.id for room in plan.rooms} - seen <= {room.id for room in plan.rooms} - connected, (
            path.name
        )


def test_closed_school_doors_separate_the_rooms(data_dir: Path) -> None:
    plan = load_plan(data_dir / "floorplans" / "schools" / "Ursy1.xml")
    raster = plan.with_doors_closed(range(len(plan.doors))).rasterize(0.1)
    _, parts = cv2.connectedComponents(raster.free.astype(np.uint8), connectivity=8)
    for part in range(1, parts.max() + 1):
        assert len(set(np.unique(raster.room_ids[parts == part])) - {0}) <= 1


def test_door_lines_lie_on_their_walls(data_dir: Path) -> None:
    """A door's opening leads from one of its rooms into the other."""
    plan = load_plan(data_dir / "floorplans" / "schools" / "Borchen4.xml")
    polygons = {room.id: room.polygon for room in plan.rooms}
    for door in plan.doors:
        opening = plan.opening(door)
        assert all(opening.intersects(polygons[room]) for room in door.rooms)
        assert plan.walls.intersection(LineString([door.start, door.end])).length < 0.01
