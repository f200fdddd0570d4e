"""What a robot is given."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import shapely
from scipy.cluster.hierarchy import DisjointSet
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from layoutexplore.errors import WriteError
from layoutexplore.grids.grid import Pose
from layoutexplore.grids.image_map import grid_from_image
from layoutexplore.grids.ros_map import load_grid
from layoutexplore.importing.building import building_from_grid, building_of_plan
from layoutexplore.importing.robot_files import room_goals, room_graph, write_robot_files
from layoutexplore.maps.library import load_plan
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.maps.tracing import floorplan_from_ascii
from tests.importing.cases import office


@pytest.mark.parametrize("yaw", [0.0, 0.4])
def test_a_robot_gets_map_rooms_doors_and_graph_in_the_frame_of_its_map(tmp_path: Path, yaw: float) -> None:
    grid = replace(grid_from_image(office(), 0.05), origin=Pose(-3.0, 5.0, yaw))
    building = building_from_grid(grid, name="office")
    files = write_robot_files(building, str(tmp_path / "robot"))
    assert all(path.is_file() for path in files)
    cleaned = load_grid(tmp_path / "robot" / "map.yaml")
    assert np.array_equal(cleaned.cells, building.grid.cells) and cleaned.origin.theta == yaw
    graph = json.loads((tmp_path / "robot" / "graph.json").read_text())
    assert len(graph["nodes"]) == 4 and len(graph["edges"]) == 3
    features = json.loads((tmp_path / "robot" / "rooms.geojson").read_text())["features"]
    outlines = {f["properties"]["id"]: shapely.geometry.shape(f["geometry"]) for f in features[:4]}
    for node in graph["nodes"]:
        cell = building.grid.world_to_cell(*node["goal"])
        assert building.room_ids[cell] == node["id"]
        assert outlines[node["id"]].contains(shapely.Point(node["goal"]))
        assert all(node["id"] in graph["edges"][door]["rooms"] for door in node["doors"])
    for edge in graph["edges"]:
        assert building.grid.free[building.grid.world_to_cell(*edge["place"])]
        assert 0.8 < edge["width"] < 1.0
        assert all(outlines[room].distance(shapely.Point(edge["place"])) < 0.3 for room in edge["rooms"])
    assert sorted(f["properties"]["kind"] for f in features) == ["door"] * 3 + ["goal"] * 4 + ["room"] * 4
    for door in (f for f in features if f["properties"]["kind"] == "door"):
        line, edge = shapely.geometry.shape(door["geometry"]), graph["edges"][door["properties"]["id"]]
        assert line.length == pytest.approx(edge["width"], abs=0.01)
        assert line.distance(shapely.Point(edge["place"])) < 0.3


def test_a_robot_gets_all_files_or_keeps_those_it_has(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rooms and goals of another map would lead it astray."""
    write_robot_files(building_of_plan(load_plan("office:1")), tmp_path)
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}

    def full(*_: object) -> None:
        raise WriteError("no space")

    monkeypatch.setattr("layoutexplore.importing.robot_files.write_json", full)
    with pytest.raises(WriteError, match="no space"):
        write_robot_files(building_of_plan(load_plan("office:2")), tmp_path)
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_goals_are_away_from_walls_and_reachable() -> None:
    image = office()
    image[110:114, 228:246] = 0  # the last room is shut
    building = building_from_grid(grid_from_image(image, 0.05), name="office")
    goals = room_goals(building)
    shut = [room for room, goal in goals.items() if goal is None]
    assert len(shut) == 1 and len(goals) == 4
    assert next(n for n in room_graph(building)["nodes"] if n["id"] == shut[0])["doors"] == []
    occupied = building.grid.cells_to_world(np.argwhere(~building.grid.free))
    for goal in goals.values():
        if goal:
            assert min(math.dist(goal, wall) for wall in occupied.tolist()) >= 0.85


def test_thousands_of_rooms_have_their_goals() -> None:
    lines = np.arange(1500) % 25 == 0
    grid = grid_from_image(np.where(lines[:, None] | lines, 0, 255).astype(np.uint8), 0.05)
    building = building_from_grid(grid, name="cells", method="none")
    goals = room_goals(building)
    assert len(goals) == 3600 and sum(map(bool, goals.values())) == 1  # no robot gets from one into the next


def joined(graph: dict[str, Any], kinds: set[str]) -> int:
    """Into how many parts the rooms fall."""
    places = {node["id"]: k for k, node in enumerate(graph["nodes"])}
    edges = [edge["rooms"] for edge in graph["edges"] if edge["kind"] in kinds and edge["open"]]
    ends = np.array([[places[a], places[b]] for a, b in edges if a in places and b in places])
    near = coo_array((np.ones(len(ends)), ends.reshape(-1, 2).T), shape=(len(places), len(places)))
    return int(connected_components(near, directed=False)[0])


HALL = """
################
#aaaa#bbbb#cccc#
#aaaa#bbbb#cccc#
#aaaa.bbbb#cccc#
#..............#
#..............#
#dddddddd#######
#dddddddd#eeeee#
#dddddddd#eeeee#
################
"""


def test_the_graph_joins_rooms_through_wide_openings() -> None:
    plan = floorplan_from_ascii(HALL, 0.5)
    building = building_of_plan(plan)
    graph = room_graph(building, radius=0.25)
    # Into the hall that is no room's four rooms open; nothing leads into the fifth.
    assert not plan.doors and joined(graph, {"door"}) == 5 and joined(graph, {"opening"}) == 2
    assert [edge["id"] for edge in graph["edges"]] == list(range(len(graph["edges"])))
    for node in graph["nodes"]:
        at = [edge["id"] for edge in graph["edges"] if node["id"] in edge["rooms"]]
        assert node["openings"] == at and bool(at) == (node["label"] != "e")
    free = building.grid.free
    for edge in graph["edges"]:
        assert free[building.grid.world_to_cell(*edge["place"])] and 0.5 <= edge["width"] < 4.0
    assert joined(room_graph(building, radius=0.6), {"opening"}) == 3  # the hall is too narrow below c


def test_a_door_is_no_second_opening_and_a_shut_one_is_none() -> None:
    plan = floorplan_from_ascii(
        "\n".join(["#########", "#aaa#bbb#", "#aaa.bbb#", "#aaa#bbb#", "#########"]), 1.0
    )
    for shut, kinds in (([], ["door"]), ([0], ["door"])):
        graph = room_graph(building_of_plan(plan.with_doors_closed(shut)))
        assert [edge["kind"] for edge in graph["edges"]] == kinds
        assert joined(graph, {"door", "opening"}) == 1 + len(shut)


@pytest.mark.parametrize("yaw", [0.0, 0.4])
def test_openings_lie_in_the_frame_of_the_map(tmp_path: Path, yaw: float) -> None:
    building = building_of_plan(floorplan_from_ascii(HALL, 0.5))
    grid = replace(building.grid, origin=Pose(-3.0, 5.0, yaw))
    turned = replace(building, grid=grid)
    write_robot_files(turned, tmp_path)
    features = json.loads((tmp_path / "rooms.geojson").read_text())["features"]
    openings = [f for f in features if f["properties"]["kind"] == "opening"]
    assert openings and all(f["geometry"]["type"] == "Point" for f in openings)
    for feature in openings:
        assert grid.free[grid.world_to_cell(*feature["geometry"]["coordinates"])]


@pytest.mark.parametrize("name", ["50010535_PLAN1", "50037765_PLAN3"])
def test_rooms_that_a_robot_walks_between_are_joined(data_dir: Path, name: str) -> None:
    building = building_of_plan(load_plan(str(data_dir / "floorplans" / "kth" / f"{name}_occ.png")))
    graph = room_graph(building, radius=0.25)
    grid = building.grid
    raster = PlanRaster(~grid.free, building.room_ids, grid.resolution, grid.origin)
    count, parts = cv2.connectedComponents((~raster.blocked(0.25)).astype(np.uint8), connectivity=4)
    known = {room["id"] for room in graph["nodes"]}
    sets = DisjointSet(known)
    for edge in graph["edges"]:
        if 0 not in edge["rooms"]:
            sets.merge(*edge["rooms"])
    for part in range(1, count):
        rooms = np.unique(building.room_ids[parts == part])
        met = [room for room in rooms.tolist() if room in known]
        assert all(sets.connected(met[0], room) for room in met[1:])
    assert joined(graph, {"door", "opening"}) < joined(graph, {"door"})
