"""The command `frontiers`, on a map that a simulated robot has half finished."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from layoutexplore.cli import app
from layoutexplore.errors import ConfigError, MapError, StartError
from layoutexplore.grids.ros_map import save_grid
from layoutexplore.maps.library import load_plan
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.simulation import Simulation


@pytest.fixture(scope="module")
def half_seen(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A ROS map, and where the robot is."""
    simulation = Simulation(load_plan("apartment-01"), SimulationConfig())
    simulation.reset(seed=0)
    simulation.step(0)
    path = tmp_path_factory.mktemp("maps") / "half.yaml"
    save_grid(simulation.mapper.grid, path)
    return path, f"{simulation.pose.x},{simulation.pose.y},0.5"


def call(*words: str) -> str:
    result = CliRunner().invoke(app, ["frontiers", *words])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


@pytest.mark.parametrize("columns", [40, 60, 120])
def test_no_number_of_the_table_is_cut(half_seen: tuple[Path, str], columns: int) -> None:
    words = ["frontiers", half_seen[0].as_posix(), "--at", half_seen[1]]
    shown = CliRunner(env={"COLUMNS": str(columns), "TERM": "dumb"}).invoke(app, words).output
    frontiers = json.loads(call(*words[1:], "--json"))["frontiers"]
    assert "…" not in shown
    for row in frontiers:
        numbers = [row[name] for name in ("expected_area", "visible_area", "path_length", "size", "x", "y")]
        line = " ".join([f"{100 * row['confidence']:.0f} %", *(f"{number:.1f}" for number in numbers)])
        assert ("closed " if row["closed"] else "open ") + line in " ".join(shown.split())


def test_it_tells_what_is_open_and_where_to_go(half_seen: tuple[Path, str], tmp_path: Path) -> None:
    path, here = half_seen
    found = json.loads(call(str(path), "--at", here, "--out", str(tmp_path), "--json"))
    frontiers, way = found["frontiers"], found["way"]
    assert {row["closed"] for row in frontiers} == {True, False}
    assert [row["path_length"] for row in frontiers] == sorted(row["path_length"] for row in frontiers)
    assert found["pose"][2] == 0.5 and 0 <= found["choice"] < len(frontiers)
    assert way[0] == pytest.approx(found["pose"][:2], abs=0.1)
    picture, rooms = (Path(name) for name in found["written"])
    assert picture.name == "half_frontiers.png" and cv2.imread(str(picture)).shape[1] == 960
    assert rooms.name == "half_rooms.geojson" and json.loads(rooms.read_text())["features"]


def test_its_table_has_a_row_a_frontier(half_seen: tuple[Path, str]) -> None:
    path, here = half_seen
    found = json.loads(call(str(path), "--at", here, "--agent", "nearest", "--json"))
    text = call(str(path), "--at", here, "--agent", "nearest")
    count = len(found["frontiers"])
    assert f"{count} frontiers to look at" in text and "nearest goes to" in text
    lines = text.splitlines()
    first = next(k for k, line in enumerate(lines) if line.split()[-1:] == ["y"]) + 1
    assert [line.split()[-1] for line in lines[first : first + count]] == [
        f"{row['y']:.1f}" for row in found["frontiers"]
    ]
    assert "None" not in text  # without a predictor nothing is told of classes


@pytest.mark.parametrize("answer", ["np.array([1])", "np.int64(1)"])
def test_a_number_of_numpy_is_a_choice(half_seen: tuple[Path, str], tmp_path: Path, answer: str) -> None:
    own = tmp_path / "own.py"
    own.write_text(
        "import numpy as np\nclass Policy:\n    def reset(self, seed): ...\n"
        f"    def act(self, decision): return {answer}\n"
    )
    found = json.loads(call(str(half_seen[0]), "--at", half_seen[1], "--agent", f"{own}:Policy", "--json"))
    assert found["choice"] == 1 and found["way"]


def test_what_is_said_is_not_broken_into_short_lines(half_seen: tuple[Path, str], tmp_path: Path) -> None:
    path, here = half_seen
    long = tmp_path / f"{'long' * 20}.yaml"
    long.write_text(path.read_text())
    (tmp_path / path.with_suffix(".pgm").name).write_bytes(path.with_suffix(".pgm").read_bytes())
    text = call(str(long), "--at", here, "--agent", "watchful-tour")
    assert f"{long}: " in text and text.rstrip().endswith("where it looks around and decides anew")


def test_the_way_of_an_agent_that_plans_its_own_is_drawn(half_seen: tuple[Path, str], tmp_path: Path) -> None:
    pictures = []
    for agent in ("watchful-tour:step=2.0", "watchful-tour:step=0.2"):
        call(str(half_seen[0]), "--at", half_seen[1], "--agent", agent, "--out", str(tmp_path))
        pictures.append(cv2.imread(str(tmp_path / "half_frontiers.png")))
    assert (pictures[0] != pictures[1]).any()


def test_without_a_place_the_robot_is_where_most_floor_is_clear(half_seen: tuple[Path, str]) -> None:
    assert json.loads(call(str(half_seen[0]), "--json"))["frontiers"]


def test_what_makes_no_sense_is_refused(half_seen: tuple[Path, str]) -> None:
    path, here = str(half_seen[0]), half_seen[1]
    with pytest.raises(ConfigError, match="true floor plan"):
        call(path, "--at", here, "--agent", "clairvoyant")
    with pytest.raises(ConfigError, match=r"^--at needs"):
        call(path, "--at", "here")
    with pytest.raises(MapError, match="brings its own"):
        call(path, "--resolution", "0.1")
    with pytest.raises(MapError, match="floor plan"):
        call("floor.geojson")
    with pytest.raises(StartError, match="not on its map"):
        call(path, "--at", "1000,0")


def test_a_map_without_floor_is_named(tmp_path: Path) -> None:
    for level, error, said in ((0, MapError, "no cell of the robot's map"), (254, StartError, "no room at")):
        cells = np.zeros((9, 9), np.uint8)
        cells[4, 4] = level
        cv2.imwrite(str(tmp_path / "dark.png"), cells)
        with pytest.raises(error, match=rf"dark\.png: .*{said}"):
            call(str(tmp_path / "dark.png"))
