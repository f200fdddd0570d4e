"""Every format of floor plans, the library of names, and the command line around them."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import typer
from shapely import LineString
from typer.testing import CliRunner

from layoutexplore.errors import LayoutExploreError, MapError, UnknownNameError
from layoutexplore.grids.ros_map import save_grid
from layoutexplore.maps import expand_plans, load_plan, plan_names, splits
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.tracing import floorplan_from_ascii

RADIUS = 0.2


def share_reached(plan: FloorPlan) -> float:
    """The largest component's share of the cells that a robot of 0.2 m can be in, at 0.1 m a cell."""
    raster = plan.rasterize(0.1)
    return float(raster.reachable(RADIUS).sum() / (~raster.blocked(RADIUS)).sum())


SCHOOL = """<building id="b"><scale>
<represented_distance><value>30</value><um>pixel</um></represented_distance>
<real_distance><value>90</value><um>cm</um></real_distance></scale>
<building_type><main_type>SCHOOL</main_type></building_type>
<floor><spaces>
<space id="a"><labels><type>R</type><label>CLASSROOM</label></labels>
<bounding_polygon><point x="0" y="0"/><point x="200" y="0"/><point x="200" y="100"/><point x="0" y="100"/></bounding_polygon>
<space_representation><linesegment id="s"><point x="30" y="100"/><point x="30" y="100"/><class>PORTAL</class></linesegment>
</space_representation>
<portals><portal><linesegment>s</linesegment><target><id>a</id><id>b</id></target></portal></portals></space>
<space id="b"><labels><type>C</type><label>CORRIDOR</label></labels>
<bounding_polygon><point x="0" y="106"/><point x="200" y="106"/><point x="200" y="200"/><point x="0" y="200"/></bounding_polygon>
<portals><portal><linesegment>s</linesegment><target><id>a</id><id>b</id></target></portal></portals></space>
</spaces></floor></building>"""


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


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text[:300], "not readable as XML"),
        (lambda text: "<building/>", "scale"),
        (lambda text: text.replace("<value>30</value>", ""), "scale"),
        (lambda text: text.replace("<value>30</value>", "<value>0</value>"), "makes no sense"),
        (lambda text: text.replace("<um>cm</um>", "<um>parsec</um>"), "makes no sense"),
        (
            lambda text: text.replace('<point x="200" y="0"/>', '<point x="wide" y="0"/>'),
            "unusable coordinates",
        ),
        (lambda text: text.replace("bounding_polygon", "outline"), "needs 3 points"),
        (lambda text: text.replace("space", "place"), "no <space>"),
    ],
)
def test_bad_school_xml(tmp_path: Path, change: Callable[[str], str], message: str) -> None:
    path = tmp_path / "bad.xml"
    path.write_text(change(SCHOOL))
    with pytest.raises(MapError, match=message) as caught:
        load_plan(path)
    assert str(path) in str(caught.value)


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


def write_kth(folder: Path) -> Path:
    """Two rooms with a hollow wall between them, a door, and free space all around."""
    occ, rooms = np.full((120, 200), 254, np.uint8), np.zeros((120, 200), np.uint8)
    occ[20:100, 20:180] = 0
    occ[22:98, 22:98] = occ[22:98, 104:178] = 254
    occ[22:98, 100:102] = 254  # the hollow
    rooms[22:98, 22:98], rooms[22:98, 104:178] = 1, 2
    occ[50:68, 98:104] = 254  # the door
    occ[98:100, 40:60] = 254  # a door to the outside
    cv2.imwrite(str(folder / "50_PLAN1_occ.png"), occ)
    cv2.imwrite(str(folder / "50_PLAN1_rooms.png"), rooms)
    return folder / "50_PLAN1_occ.png"


def test_kth_outside_and_hollow_walls_are_solid(tmp_path: Path) -> None:
    path = write_kth(tmp_path)
    for each in (path, path.with_name("50_PLAN1_rooms.png")):
        plan = load_plan(each)
        assert (plan.name, plan.building) == ("50_PLAN1", "50")
        assert len(plan.rooms) == 2
        (door,) = plan.doors
        assert door.rooms == (1, 2)
        assert door.width == pytest.approx(0.9, abs=0.11)
        assert share_reached(plan) == 1.0
        raster = plan.rasterize(0.05)
        assert raster.free.sum() == pytest.approx(76 * 76 + 76 * 74 + 18 * 6, abs=45)
        assert raster.occupied[raster.world_to_cell(0.5, 0.5)]


def test_bad_kth(tmp_path: Path) -> None:
    path = write_kth(tmp_path)
    rooms = path.with_name("50_PLAN1_rooms.png")
    cv2.imwrite(str(rooms), np.ones((5, 5), np.uint8))
    with pytest.raises(MapError, match="do not fit"):
        load_plan(path)
    cv2.imwrite(str(rooms), np.zeros((120, 200), np.uint8))
    with pytest.raises(MapError, match="no room"):
        load_plan(path)
    rooms.write_bytes(b"nonsense")
    with pytest.raises(MapError, match="not an image"):
        load_plan(path)


def test_kth_floors(data_dir: Path) -> None:
    meta = json.loads((data_dir / "floorplans" / "kth" / "meta.json").read_text())
    for path in sorted((data_dir / "floorplans" / "kth").glob("*_occ.png")):
        plan = load_plan(path)
        facts = meta[plan.name]
        assert len(plan.rooms) == facts["rooms"]
        raster = plan.rasterize(0.1)
        assert raster.free.sum() * 0.01 == pytest.approx(facts["indoor_free_m2"], rel=0.03)
        assert share_reached(plan) >= 0.92, path.name  # 50010536_PLAN3 has a hall without a door
        assert len(plan.doors) >= 0.9 * len(plan.rooms)


def write_houseexpo(folder: Path, *, sidecar: bool = True) -> Path:
    verts = [
        [0, 0],
        [0, 3],
        [3, 3],
        [3, 2],
        [3.1, 2],
        [3.1, 3],
        [6, 3],
        [6, 0],
        [3.1, 0],
        [3.1, 1],
        [3, 1],
        [3, 0],
    ]
    boxes = {"Living_Room": [[-0.1, -0.1, 3.1, 3.1]], "Kitchen": [[3.0, -0.1, 6.1, 3.1]]}
    (folder / "house.json").write_text(json.dumps({"verts": verts, "id": "house", "room_category": boxes}))
    if sidecar:
        areas = [
            [[0, 0], [3.05, 0], [3.05, 3], [0, 3], [0, 0]],
            [[3.05, 0], [6, 0], [6, 3], [3.05, 3], [3.05, 0]],
        ]
        extra = {"areas": areas, "door": [[[3.05, 1], [3.05, 2]]]}
        (folder / "house.label_data.json").write_text(json.dumps(extra))
    return folder / "house.json"


def test_houseexpo_with_and_without_rooms(tmp_path: Path) -> None:
    path = write_houseexpo(tmp_path)
    plan = load_plan(path)
    assert [room.label for room in plan.rooms] == ["living room", "kitchen"]
    assert plan.doors[0].rooms == (1, 2)
    assert plan.area == pytest.approx(18 - 0.2, abs=0.01)
    assert share_reached(plan) == 1.0
    assert share_reached(plan.with_doors_closed([0])) < 0.6
    (tmp_path / "house.label_data.json").unlink()
    assert len(load_plan(path).rooms) == 1


@pytest.mark.parametrize(
    "thing", ["[]", "{", '{"verts": 3}', '{"verts": [[0, 0], [1, NaN], [1, 1]]}', '{"verts": [[0, 0]]}']
)
def test_bad_houseexpo(tmp_path: Path, thing: str) -> None:
    (tmp_path / "bad.json").write_text(thing)
    with pytest.raises(MapError, match=r"bad\.json"):
        load_plan(tmp_path / "bad.json")


def test_bad_houseexpo_rooms(tmp_path: Path) -> None:
    path = write_houseexpo(tmp_path)
    (tmp_path / "house.label_data.json").write_text('{"areas": [], "door": [[1, 2]]}')
    with pytest.raises(MapError, match="door 0"):
        load_plan(path)


def test_a_ros_map_is_a_floor_plan(tmp_path: Path) -> None:
    grid = floorplan_from_ascii("#######\n#aaaaa#\n#aaaaa#\n#######", 0.5).rasterize(0.5, margin=0.0).grid
    save_grid(grid, tmp_path / "hall.yaml")
    plan = load_plan(tmp_path / "hall.yaml")
    assert plan.metadata["format"] == "ROS map"
    assert [room.polygon.area for room in plan.rooms] == [2.5]
    assert plan.bounds[:2] == (grid.origin.x, grid.origin.y)


def test_plain_images_and_their_scale(tmp_path: Path) -> None:
    image = np.full((100, 100), 127, np.uint8)
    image[20:80, 20:80] = 195
    image[30:34, 30:34] = 208  # a start patch
    cv2.imwrite(str(tmp_path / "cave.png"), image)
    plan = load_plan(tmp_path / "cave.png")
    assert "assumed" in plan.metadata["scale"]
    assert plan.area == pytest.approx(9.0)
    assert load_plan(tmp_path / "cave.png", resolution=0.1).area == pytest.approx(36.0)
    with pytest.raises(MapError, match="resolution"):
        load_plan(tmp_path / "cave.png", resolution=0.0)


def test_an_image_with_an_image_of_its_rooms(tmp_path: Path) -> None:
    image, colours = np.full((80, 80), 205, np.uint8), np.zeros((80, 80, 3), np.uint8)
    image[10:70, 10:70] = 254
    image[10:70, 39:41] = 0
    image[30:50, 39:41] = 254
    colours[10:70, 10:39], colours[10:70, 41:70] = (255, 0, 0), (0, 9, 200)
    cv2.imwrite(str(tmp_path / "map.png"), image)
    cv2.imwrite(str(tmp_path / "map_gt.png"), colours)
    plan = load_plan(tmp_path / "map.png")
    assert len(plan.rooms) == 2
    assert [door.rooms for door in plan.doors] == [(1, 2)]
    cv2.imwrite(str(tmp_path / "map_gt.png"), colours[:20])
    with pytest.raises(MapError, match="do not fit"):
        load_plan(tmp_path / "map.png")


def test_images_without_free_space(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "black.png"), np.zeros((30, 30), np.uint8))
    with pytest.raises(MapError, match="no free space"):
        load_plan(tmp_path / "black.png")


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


@pytest.mark.parametrize("load", [load_plan, expand_plans])
def test_unknown_names_and_files(tmp_path: Path, load: Callable[[Any], object]) -> None:
    with pytest.raises(UnknownNameError, match="office:SEED"):
        load("ofice:SED")
    with pytest.raises(MapError, match="no such file"):
        load(tmp_path / "absent.geojson")
    with pytest.raises(MapError, match="no such file"):
        load("absent.xml")
    with pytest.raises(MapError, match="folder"):
        load(tmp_path)


def test_a_text_file_is_no_plan(tmp_path: Path) -> None:
    (tmp_path / "plan.txt").write_text("four walls")
    with pytest.raises(MapError, match="known endings"):
        load_plan(tmp_path / "plan.txt")


def invoke(*words: str) -> tuple[int, str]:
    from layoutexplore.cli import maps

    app = typer.Typer()
    maps.register(app)
    result = CliRunner().invoke(app, ["maps", *words])
    if isinstance(result.exception, LayoutExploreError):
        raise result.exception
    return result.exit_code, result.output


def test_command_line(tmp_path: Path) -> None:
    source = write_houseexpo(tmp_path)
    target, picture = tmp_path / "house.geojson", tmp_path / "house.png"
    assert invoke("import", str(source), "--out", str(target))[0] == 0
    code, text = invoke("show", str(target), "--out", str(picture))
    assert code == 0
    assert "kitchen" in text
    assert cv2.imread(str(picture)) is not None
    assert invoke("list")[0] == 0
    assert invoke("generate", "apartment", "--seed", "1", "--out", str(tmp_path / "flat.geojson"))[0] == 0
    assert share_reached(load_plan(tmp_path / "flat.geojson")) > 0.9
    with pytest.raises(UnknownNameError):
        invoke("show", "nothing-like-this")
    shutil.rmtree(tmp_path)


def test_door_lines_lie_on_their_walls(data_dir: Path) -> None:
    """A door's opening leads from one of its rooms into the other."""
    plan = load_plan(data_dir / "floorplans" / "schools" / "Borchen4.xml")
    polygons = {room.id: room.polygon for room in plan.rooms}
    for door in plan.doors:
        opening = plan.opening(door)
        assert all(opening.intersects(polygons[room]) for room in door.rooms)
        assert plan.walls.intersection(LineString([door.start, door.end])).length < 0.01
