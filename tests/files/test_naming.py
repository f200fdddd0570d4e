"""Errors name the file that they come from, also those of values that are checked apart from it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from layoutexplore.agents.rl.hyperparameters import read_config
from layoutexplore.benchmark.config import simulation_of_file
from layoutexplore.benchmark.suite import load_suite
from layoutexplore.errors import ConfigError, LayoutExploreError, MapError, UnknownNameError
from layoutexplore.files import blaming, naming
from layoutexplore.importing.building import import_building
from layoutexplore.maps import load_plan
from layoutexplore.simulation.region import read_region
from layoutexplore.simulation.saved_run import load_simulation, save_simulation
from layoutexplore.simulation.simulation import Simulation
from layoutexplore.training.map_noise.files import read_noise
from tests.cli.test_cli import run
from tests.maps.cases import two_rooms, write_houseexpo
from tests.maps.formats.cases import RMF, write_walls


def door_of_no_length(path: Path) -> None:
    house = write_houseexpo(path.parent)
    beside = house.with_suffix(".label_data.json")
    data = json.loads(beside.read_text())
    data["door"] = [[[2.0, 1.0], [2.0, 1.0]]]
    beside.write_text(json.dumps(data))


def walls_alone(path: Path) -> None:
    data = json.loads(write_walls(path).read_text())
    data["features"] = [one for one in data["features"] if one["properties"]["type"] != "building_outline"]
    data["features"][0]["geometry"] = {"type": "Polygon", "coordinates": [[[0, 0], [3, 0], [3, 1], [0, 0]]]}
    path.write_text(json.dumps(data))


def black(path: Path) -> None:
    cells = np.zeros((40, 50), np.uint8)
    cells[5:8, 5:8] = 254
    cv2.imwrite(str(path), cells)


def text(content: str) -> Callable[[Path], object]:
    return lambda path: path.write_text(content)


CROSSING = json.dumps({"type": "Polygon", "coordinates": [[[0, 0], [9, 9], [9, 0], [0, 9], [0, 0]]]})

WRONG: dict[str, tuple[Callable[[Path], object], Callable[[Path], Any]]] = {
    "house.json": (door_of_no_length, load_plan),
    "two.building.yaml": (text(RMF.replace("10.0", "0.01")), load_plan),
    "walls.geojson": (walls_alone, load_plan),
    "floor.png": (black, import_building),
    "region.geojson": (text(CROSSING), lambda path: read_region(str(path))),
    "noise.toml": (text("drift = [2.0, 1.0]"), read_noise),
    "training.toml": (text("[learning]\ngamma = -1.0"), read_config),
    "suite.toml": (text("starts = 0"), lambda path: load_suite(str(path))),
    "run.toml": (
        text("[lidars.mine]\nrange_max = 0.01\n"), lambda path: simulation_of_file(path, "mine"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", list(WRONG))
def test_what_is_wrong_with_a_file_is_told_with_its_name(tmp_path: Path, name: str) -> None:
    write, read = WRONG[name]
    path = tmp_path / name
    write(path)
    with pytest.raises(LayoutExploreError) as told:
        read(path)
    assert str(told.value).count(name.partition(".")[0] + ".") == 1, told.value


def test_a_saved_run_of_another_plan_is_named(tmp_path: Path) -> None:
    simulation = Simulation(two_rooms())
    simulation.reset(seed=1)
    save_simulation(simulation, tmp_path / "run.npz")
    with pytest.raises(ConfigError, match=r"run\.npz: this run was saved on 'two'"):
        load_simulation(tmp_path / "run.npz", "apartment-01")


def test_a_file_is_blamed_for_what_is_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "training.toml"
    path.write_text("steps = 0")
    with pytest.raises(ConfigError, match=r"training\.toml: steps must be"):
        read_config(path, {"seed": 1})
    path.write_text("seed = 1")
    with pytest.raises(ConfigError, match=r"^steps must be"):
        read_config(path, {"steps": 0})
    path.write_text("starts = 0")
    assert run(monkeypatch, "benchmark", "--config", str(path), "--out", str(tmp_path / "out")) == 2
    assert f"{path.name}: starts must be" in capsys.readouterr().err


def test_errors_that_name_a_file_stay_as_they_are() -> None:
    path, other = Path("folder") / "plan.json", Path("other.json")
    for told, found in {
        "no room": f"{path}: no room",
        f"{path}#1: no room": f"{path}#1: no room",
        f"{other}: no room": f"{other}: no room",
    }.items():
        with pytest.raises(MapError) as raised, naming(path, MapError, lambda: [other]):
            raise MapError(told)
        assert str(raised.value) == found
    with pytest.raises(UnknownNameError, match=r"^unknown$"), blaming(None, ConfigError, lambda: None):
        raise UnknownNameError("unknown")
    with pytest.raises(ConfigError, match=r"^too many$"), naming(path, MapError):
        raise ConfigError("too many")
