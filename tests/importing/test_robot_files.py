"""What a robot is given."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from layoutexplore.grids.grid import Pose
from layoutexplore.grids.image_map import grid_from_image
from layoutexplore.grids.ros_map import load_grid
from layoutexplore.importing.building import building_from_grid
from layoutexplore.importing.robot_files import room_goals, room_graph, write_robot_files
from tests.importing.cases import office


@pytest.mark.parametrize("yaw", [0.0, 0.4])
def test_a_robot_gets_map_rooms_doors_and_graph_in_the_frame_of_its_map(tmp_path: Path, yaw: float) -> None:
    grid = replace(grid_from_image(office(), 0.05), origin=Pose(-3.0, 5.0, yaw))
    building = building_from_grid(grid, name="office")
    files = write_robot_files(building, tmp_path / "robot")
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
