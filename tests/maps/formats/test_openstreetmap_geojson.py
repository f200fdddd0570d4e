"""GeoJSON with the tags of OpenStreetMap, as overpass turbo saves it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from shapely import LineString, Point, box

from layoutexplore.errors import MapError, MapWarning
from layoutexplore.maps import load_plan
from tests.maps.formats.cases import LEFT, RIGHT, feature, write_collection

DOOR = feature(Point(5, 2), id="node/1", door="yes", level="0")


def rooms(left: str, right: str) -> list[dict[str, Any]]:
    return [
        feature(LEFT, id="way/1", indoor="room", level=left, name="A"),
        feature(RIGHT, id="way/2", indoor="corridor", level=right),
    ]


def test_what_is_no_room_and_no_door_is_left_out(tmp_path: Path) -> None:
    """The outlines of the building and of its level, a path, and things that stand at walls."""
    path = write_collection(
        tmp_path / "export.geojson",
        feature(box(0, 0, 10, 4), building="university"),
        feature(box(0, 0, 10, 4), indoor="level", level="0"),
        *rooms("0", "0;1"),
        DOOR,
        feature(Point(0, 2), entrance="main", level="0"),
        feature(Point(5, 3), door="yes", level="1"),
        feature(Point(8, 0), amenity="vending_machine", level="0"),
        feature(LineString([(1, 1), (9, 1)]), highway="footway", indoor="yes"),
    )
    with pytest.warns(
        MapWarning, match="4 features that are no rooms, corridors, areas or doors by their tags"
    ):
        plan = load_plan(path)
    assert [room.label for room in plan.rooms] == ["A", ""]
    assert [door.rooms for door in plan.doors] == [(1, 2), (0, 1)]


@pytest.mark.filterwarnings("ignore::layoutexplore.errors.MapWarning")
def test_rooms_of_several_floors_are_no_plan(tmp_path: Path) -> None:
    path = write_collection(tmp_path / "export.geojson", *rooms("0", "1"), DOOR)
    with pytest.raises(MapError, match=r"several floors \(level 0, 1\).*\.osm"):
        load_plan(path)
    write_collection(path, *rooms("", "1"), DOOR)
    assert len(load_plan(path).rooms) == 2


@pytest.mark.filterwarnings("ignore::layoutexplore.errors.MapWarning")
def test_corridors_and_areas_are_open_where_they_meet(tmp_path: Path) -> None:
    hall = feature(box(10, 0, 18, 4), indoor="area", level="0")
    path = write_collection(tmp_path / "export.geojson", *rooms("0", "0"), hall, DOOR)
    assert [(door.rooms, round(door.width, 1)) for door in load_plan(path).doors] == [
        ((1, 2), 0.9),
        ((2, 3), 3.8),
    ]
