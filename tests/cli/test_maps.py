"""The commands around floor plans."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
import shapely
import typer
from typer.testing import CliRunner

from layoutexplore.errors import ConfigError, LayoutExploreError, MapError, MapWarning, UnknownNameError
from layoutexplore.grids.ros_map import load_grid
from layoutexplore.maps import expand_plans, load_plan
from layoutexplore.maps.geojson import save_plan
from tests.importing.cases import office, write_ros_map
from tests.maps.cases import share_reached, write_houseexpo


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


@pytest.mark.skipif(sys.platform != "linux", reason="needs pipes")
def test_no_picture_is_put_beside_a_pipe(tmp_path: Path) -> None:
    source, pipe = write_houseexpo(tmp_path), tmp_path / "out" / "pipe"
    pipe.parent.mkdir()
    os.mkfifo(pipe)
    # Open for reading and writing, so that neither side waits; the plan fits into the pipe.
    held = os.open(pipe, os.O_RDWR)
    code, text = invoke("import", str(source), "--out", str(pipe))
    written = os.read(held, 1 << 16)
    os.close(held)
    assert code == 0 and "no picture is drawn" in text and b"FeatureCollection" in written
    assert list(pipe.parent.iterdir()) == [pipe]


def test_a_ros_map_is_explored_with_its_rooms_in_two_commands(tmp_path: Path) -> None:
    from layoutexplore.cli import app as whole

    source = write_ros_map(tmp_path, office())
    target = tmp_path / "out" / "floor.geojson"
    with pytest.warns(MapWarning):
        code, text = invoke("import", str(source), "--out", str(target), "--robot", str(tmp_path / "robot"))
    assert code == 0 and "4 rooms, 3 doors" in text
    assert cv2.imread(str(target.with_suffix(".png"))) is not None
    assert (tmp_path / "robot" / "graph.json").is_file()
    result = CliRunner().invoke(whole, ["explore", str(target), "--sensor", "indoor"])
    assert result.exit_code == 0 and "of 4 rooms finished" in result.output
    # The picture beside the plan is no plan of its own.
    assert expand_plans(target.parent) == [str(target)]


def test_a_picture_of_a_plan_is_imported_with_a_known_length(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "plan.png"), office(unknown=255, free=255))
    target = str(tmp_path / "plan.geojson")
    code, text = invoke("import", str(tmp_path / "plan.png"), "--scale-by", "90 cm = 6 px", "--out", target)
    assert code == 0 and "0.15 m a pixel (as given)" in text
    with pytest.raises(ConfigError, match="118 px"):
        invoke("import", str(tmp_path / "plan.png"), "--scale-by", "90", "--out", target)
    with pytest.raises(ConfigError, match="rooms of its own"):
        invoke("import", target, "--blueprint", "--out", target)


def test_what_is_imported_is_never_written_over(tmp_path: Path) -> None:
    image, plan = tmp_path / "plan.png", tmp_path / "plan.geojson"
    cv2.imwrite(str(image), office(unknown=255, free=255))
    before = image.read_bytes()
    for _ in range(2):
        code, text = invoke("import", str(image), "--out", str(plan))
        assert code == 0 and "plan_imported.png" in text and image.read_bytes() == before
    assert "drawn into" in invoke("import", str(plan), "--out", str(plan))[1]
    assert image.read_bytes() == before
    with pytest.raises(ConfigError, match=r"plan\.png is read and would be written over: --out"):
        invoke("import", str(image), "--out", str(image))
    assert image.read_bytes() == before


def ros_map(folder: Path, suffix: str) -> Path:
    """A map.yaml and its image, as robots and runs call theirs."""
    source = write_ros_map(folder, office())
    (folder / "floor.pgm").unlink()
    cv2.imwrite(str(folder / f"map{suffix}"), office())
    (folder / "map.yaml").write_text(source.read_text().replace("floor.pgm", f"map{suffix}"))
    source.unlink()
    return folder / "map.yaml"


def test_the_files_of_a_ros_map_are_never_written_over(tmp_path: Path) -> None:
    source = ros_map(tmp_path, ".pgm")
    (tmp_path / "link.geojson").symlink_to(source.with_suffix(".pgm"))
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    for out in (source, source.with_suffix(".pgm"), tmp_path / "link.geojson"):
        with pytest.raises(ConfigError, match="would be written over: --out"):
            invoke("import", str(source), "--out", str(out))
    with pytest.raises(ConfigError, match="would be written over: --robot"):
        invoke("import", str(source), "--out", str(tmp_path / "x.geojson"), "--robot", str(tmp_path))
    with pytest.raises(ConfigError, match="would be written over: --out"):
        invoke("show", str(source), "--out", str(source.with_suffix(".pgm")))
    from layoutexplore.cli import app as whole

    result = CliRunner().invoke(whole, ["explore", str(source), "--out", str(tmp_path)])
    assert isinstance(result.exception, ConfigError) and "map.yaml is read" in str(result.exception)
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_picture_of_a_plan_spares_the_image_that_is_read(tmp_path: Path) -> None:
    source, image = ros_map(tmp_path, ".png"), tmp_path / "map.png"
    before = image.read_bytes()
    save_plan(load_plan("apartment-01"), tmp_path / "map.geojson")  # as if map.png were its picture
    code, text = invoke("import", str(source), "--out", str(tmp_path / "map.geojson"))
    assert code == 0 and "map_imported.png" in text and image.read_bytes() == before


@pytest.mark.parametrize(
    ("words", "ending"),
    [
        (("import", "apartment-01", "--out", "out.txt"), r"\.geojson or \.json"),
        (("generate", "office", "--out", "k.pgm"), r"\.geojson or \.json"),
        (("show", "office-01", "--out", "k.yaml"), r"\.png"),
        (("show", "office-01", "--out", "k.jpg"), r"\.png"),
    ],
)
def test_files_have_the_suffix_of_what_they_are(
    words: tuple[str, ...], ending: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError, match=f"--out must name a file that ends with {ending}$"):
        invoke(*words)
    assert not list(tmp_path.iterdir())


def test_options_that_mean_nothing_are_told(tmp_path: Path) -> None:
    source, out = write_ros_map(tmp_path, office()), str(tmp_path / "out.geojson")
    for words in (["--resolution", "0.2"], ["--scale-by", "1 m = 5 px"]):
        with pytest.raises(MapError, match="brings its own scale"):
            invoke("import", str(source), *words, "--out", out)
    with pytest.raises(ConfigError, match="--rooms, which finds them, means nothing"):
        invoke("import", str(write_houseexpo(tmp_path)), "--rooms", "rose2", "--out", out)


def test_findings_are_of_the_robot_that_is_said(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "map.png"), office())
    words = ["import", str(tmp_path / "map.png"), "--out", str(tmp_path / "map.geojson")]
    assert "by a robot 1.2 m wide" in invoke(*words, "--robot-radius", "0.6")[1]
    assert "out of reach" not in invoke(*words)[1]


def test_what_to_correct_is_listed_with_its_place(tmp_path: Path) -> None:
    image = office()
    image[110:114, 228:246] = 0  # the last room is shut
    cv2.imwrite(str(tmp_path / "map.png"), image)
    code, text = invoke("import", str(tmp_path / "map.png"), "--out", str(tmp_path / "map.geojson"))
    assert code == 0 and "1 out of reach, 1 no door" in text and "1. at x " in text


@pytest.mark.parametrize("with_rooms", [False, True])
def test_places_in_a_map_with_a_yaw_are_told_in_its_frame(tmp_path: Path, with_rooms: bool) -> None:
    image = office()
    image[110:114, 228:246] = 0  # the last room is shut
    source = write_ros_map(tmp_path, image)
    source.write_text(source.read_text().replace("-2.0, 0]", "-2.0, 2.5]"))
    if with_rooms:
        ids = cv2.connectedComponents((image == 254).astype(np.uint8))[1].astype(np.uint8)
        cv2.imwrite(str(tmp_path / "floor_rooms.png"), ids)
    words = ["--out", str(tmp_path / "plan.geojson"), "--robot", str(tmp_path / "robot")]
    text = invoke("import", str(source), *words)[1]
    pair = r"x (-?\d+\.\d), y (-?\d+\.\d)"
    found = re.search(rf"{pair} of the map \({pair} of the floor plan\): room \d+ of 1[45].* no door", text)
    assert found is not None
    row, col = load_grid(source).world_to_cell(float(found[1]), float(found[2]))
    assert 34 <= 199 - row < 110 and 198 <= col < 276
    assert load_grid(tmp_path / "robot" / "map.yaml").origin == load_grid(source).origin
    rooms, place = load_plan(tmp_path / "plan.geojson").rooms, shapely.Point(float(found[3]), float(found[4]))
    room = next(room for room in rooms if room.polygon.contains(place))
    assert f"room {room.id} of" in found[0]
    goals = [node["goal"] for node in json.loads((tmp_path / "robot" / "graph.json").read_text())["nodes"]]
    cells = [load_grid(source).world_to_cell(*goal) for goal in goals if goal]
    assert cells and all(image[199 - row, col] == 254 for row, col in cells)


def test_a_drawing_in_feet_becomes_metres(tmp_path: Path) -> None:
    feet = load_plan("apartment-01").stretched(1 / 0.3048, 1 / 0.3048)
    save_plan(feet, tmp_path / "feet.geojson")
    target = tmp_path / "metres.geojson"
    code, text = invoke(
        "import", str(tmp_path / "feet.geojson"), "--scale-by", "1 ft = 1 unit", "--out", str(target)
    )
    assert code == 0 and "scale is doubtful" not in text
    assert load_plan(target).area == pytest.approx(load_plan("apartment-01").area)


@pytest.mark.parametrize("name", ["plan.pdf", "plan.svg", "plan.webp", "imdf.zip"])
def test_a_file_of_no_known_kind_is_said_to_be_one_whatever_is_asked(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"%PDF-1.4")
    for words in (["--blueprint"], ["--rooms", "rose2"], []):
        with pytest.raises(MapError, match=r"no known format .*PDF.*a PNG can be read, of an archive"):
            invoke("import", str(tmp_path / name), *words, "--out", str(tmp_path / "mine.geojson"))
    with pytest.raises(MapError, match="no such file"):
        invoke("import", str(tmp_path / "no.osm"), "--blueprint", "--out", str(tmp_path / "mine.geojson"))


@pytest.mark.skipif(sys.platform != "linux", reason="needs /dev/stdout")
def test_what_goes_to_the_standard_output_can_be_piped_on(tmp_path: Path) -> None:
    source = write_houseexpo(tmp_path)
    for words in (["import", str(source)], ["generate", "apartment", "--seed", "1"], ["show", "office-01"]):
        command = [sys.executable, "-m", "layoutexplore", "maps", *words, "--out", "/dev/stdout"]
        done = subprocess.run(command, capture_output=True, check=True)
        if words[0] == "show":
            assert done.stdout.startswith(b"\x89PNG") and done.stdout.endswith(b"IEND\xaeB`\x82")
        else:
            assert json.loads(done.stdout)["type"] == "FeatureCollection"
        assert b"m2" in done.stderr
