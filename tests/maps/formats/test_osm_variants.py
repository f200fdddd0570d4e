"""OpenStreetMap files as different editors and authors write them."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from shapely import Polygon, box

from layoutexplore.errors import MapWarning
from layoutexplore.maps import load_plan
from tests.maps.formats.cases import LEFT, RIGHT, OsmFile, corners, write_osmag


def test_passages_that_name_their_areas(tmp_path: Path) -> None:
    """JOSM gives new ids when it saves: area graphs that were edited with it go by names."""
    file = OsmFile()
    for shape, name in ((LEFT, "A-01"), (RIGHT, "A-COR"), (box(10, 0, 14, 4), "A-02")):
        file.way(corners(shape), osmAG__type="area", osmAG__areaType="room", level="1", name=name)
    file.way(corners(box(0, 0, 14, 4)), osmAG__type="area", osmAG__areaType="structure", level="1", name="A")
    for x, one, other in ((5, "A-01", "A-COR"), (10, "A-COR", "A-02"), (14, "A-02", "A")):
        ends = {"osmAG__from": one, "osmAG__to": other, "level": "1"}
        file.way([(x, 1), (x, 2.1)], osmAG__type="passage", **ends)
    plan = load_plan(file.write(tmp_path / "edited.osm"))
    assert [door.rooms for door in plan.doors] == [(1, 2), (2, 3), (0, 3)]


def test_areas_that_meet_in_their_passages_alone_keep_their_size(tmp_path: Path) -> None:
    """Area graphs draw the floor of rooms, up to the faces of their walls; passages are on both outlines."""
    file, thick = OsmFile(), 0.15
    notch = [(5, 2.1), (5, 1), (5 + thick, 1)]
    right = [(5 + thick, 0), (9, 0), (9, 4), (5 + thick, 4), (5 + thick, 2.1), *notch, (5 + thick, 0)]
    left = [(0, 0), (5, 0), (5, 1), (5, 2.1), (5, 4), (0, 4), (0, 0)]
    outlines = (left, right, corners(box(0, 4 + thick, 9, 8)))
    for outline in outlines:
        file.way(outline, osmAG__type="area", osmAG__areaType="room", level="1")
    file.way(notch[:2], osmAG__type="passage", osmAG__from="-1000", osmAG__to="-1001", level="1")
    plan = load_plan(file.write(tmp_path / "graph.osm"))
    drawn = [Polygon(outline).area for outline in outlines]
    assert [room.polygon.area for room in plan.rooms] == pytest.approx(drawn, abs=0.2)  # but for the doorway
    assert [door.rooms for door in plan.doors] == [(1, 2)]


def test_stairs_and_lifts_of_area_graphs_are_rooms(tmp_path: Path) -> None:
    file = OsmFile()
    kinds = ("room", "corridor", "stairs", "elevator", "structure")
    for k, kind in enumerate(kinds):
        shape = box(4 * k, 0, 4 * k + 4, 4)
        file.way(corners(shape), osmAG__type="area", osmAG__areaType=kind, level="1", indoor="room")
    plan = load_plan(file.write(tmp_path / "tower.osm"))
    assert [room.label for room in plan.rooms] == ["", "corridor", "stairs", "elevator"]


def test_an_area_graph_without_levels_is_one_floor(tmp_path: Path) -> None:
    path = write_osmag(tmp_path / "one.osm")
    path.write_text(path.read_text().replace("<tag k='level' v='1'/>", ""))
    plan = load_plan(path)
    assert (len(plan.rooms), [door.rooms for door in plan.doors]) == (2, [(1, 2)])
    assert plan.metadata["level"] == "0"


def test_corridors_and_areas_are_open_where_they_meet(tmp_path: Path) -> None:
    """A hall with a kiosk in it, a corridor at its side, and another behind a door; a room has walls."""
    file = OsmFile()
    hall = [(0, 0), (10, 0), (10, 2), (10, 4), (10, 10), (0, 10), (0, 0)]
    file.way(hall, indoor="area", level="0")
    file.way(corners(box(3, 4, 6, 8)), indoor="area", level="0")
    file.way([(10, 4), (20, 4), (20, 6), (20, 7), (10, 7), (10, 4)], indoor="corridor", level="0")
    file.way([(20, 4), (26, 4), (26, 7), (20, 7), (20, 6), (20, 4)], indoor="corridor", level="0")
    file.way([(10, 0), (20, 0), (20, 4), (10, 4), (10, 2), (10, 0)], indoor="room", level="0")
    file.node(20, 6, door="hinged", level="0")
    plan = load_plan(file.write(tmp_path / "hall.osm"))
    found = sorted((door.rooms, round(door.width, 1)) for door in plan.doors)
    kiosk = [((1, 2), 2.8), ((1, 2), 2.8), ((1, 2), 3.8), ((1, 2), 3.8)]
    assert found == [*kiosk, ((1, 3), 2.8), ((3, 4), 0.9)]


def test_walls_stand_between_areas_and_in_rooms(tmp_path: Path) -> None:
    file = OsmFile()
    file.way(corners(LEFT), indoor="area", level="0")
    file.way(corners(RIGHT), indoor="area", level="0")
    file.way([(5, 0), (5, 3)], indoor="wall", level="0-1")
    file.way([(7, 0), (7, 2)], indoor="wall", level="0")
    file.way([(2, 0), (2, 2)], indoor="wall", level="1")
    plan = load_plan(file.write(tmp_path / "walls.osm"))
    assert [(door.rooms, round(door.width, 1)) for door in plan.doors] == [((1, 2), 0.7)]
    assert [room.polygon.area for room in plan.rooms] == [
        pytest.approx(4.8 * 3.8),
        pytest.approx(4.8 * 3.8 - 0.2 * 2.0),
    ]


def test_what_was_deleted_in_josm_is_not_there(tmp_path: Path) -> None:
    file = OsmFile()
    file.way(corners(LEFT), indoor="room", level="0")
    file.way(corners(RIGHT), indoor="room", level="0")
    path = file.write(tmp_path / "saved.osm")
    path.write_text(path.read_text().replace("<way id='-1001'", "<way id='-1001' action='delete'"))
    assert len(load_plan(path).rooms) == 1


def test_a_hall_around_a_larger_room_is_what_is_left(tmp_path: Path) -> None:
    file = OsmFile()
    file.way(corners(box(0, 0, 12, 10)), indoor="area", level="0", room="hall")
    file.way([(1, 1), (6, 1), (11, 1), (11, 9), (1, 9), (1, 1)], indoor="room", level="0", room="shop")
    file.node(6, 1, door="hinged", level="0")
    plan = load_plan(file.write(tmp_path / "mall.osm"))
    hall, shop = plan.rooms
    assert (hall.label, hall.polygon.area) == ("hall", pytest.approx(11.8 * 9.8 - 10.2 * 8.2))
    assert (shop.label, shop.polygon.area) == ("shop", pytest.approx(9.8 * 7.8))
    assert [door.rooms for door in plan.doors] == [(1, 2)]


def test_places_may_stand_in_ways_and_relations(tmp_path: Path) -> None:
    """As Overpass answers `out geom`: no node but the doors, and relations without their ways."""
    file = OsmFile()
    ring = [(0, 0), (5, 0), (5, 2), (5, 4), (0, 4), (0, 0)]
    file.multipolygon([ring[:4], ring[3:]], [(1, 1), (2, 1), (2, 2), (1, 1)], indoor="room", level="0")
    file.way([(5, 0), (10, 0), (10, 4), (5, 4), (5, 2), (5, 0)], indoor="room", level="0")
    file.node(5, 2, door="yes", level="0")
    root = ElementTree.fromstring(file.write(tmp_path / "whole.osm").read_text())
    nodes = {node.get("id"): node for node in root.iter("node")}
    ways = {way.get("id"): way for way in root.iter("way")}
    for nd in root.iter("nd"):
        nd.attrib |= {key: nodes[nd.get("ref")].get(key, "") for key in ("lon", "lat")}
    for member in root.iter("member"):
        way = ways[member.get("ref")]
        member.extend(ElementTree.Element("nd", {k: nd.get(k, "") for k in ("lon", "lat")}) for nd in way)
        root.remove(way)
    for node in [node for node in nodes.values() if not len(node)]:
        root.remove(node)
    ElementTree.ElementTree(root).write(tmp_path / "geom.osm")
    whole, inline = (load_plan(tmp_path / f"{name}.osm") for name in ("whole", "geom"))
    assert inline.content_hash == whole.content_hash and len(whole.rooms) == 2


def test_relations_without_their_ways_are_told(tmp_path: Path) -> None:
    file = OsmFile()
    file.way(corners(LEFT), indoor="room", level="0")
    file.multipolygon([], [], indoor="room", level="0")
    with pytest.warns(MapWarning, match="1 rooms whose outline is not closed"):
        assert len(load_plan(file.write(tmp_path / "cut.osm")).rooms) == 1
