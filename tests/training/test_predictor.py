"""Training a predictor from the command line."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from layoutexplore import cli
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.predictors import make_room_predictor
from layoutexplore.predictors.learned import CELL_MODEL, CELL_NETWORK, FRONTIER_MODEL, FRONTIER_NETWORK
from layoutexplore.training.predictor import (
    ExplorationConfig,
    Explored,
    NetworkTrainer,
    buildings_of,
    buildings_of_words,
    explore_plans,
)
from tests.plans import THREE_OFFICES


def test_training_from_the_command_line(tmp_path: Path) -> None:
    wide = "\n".join(row[:20] + row[19:20] * 4 + row[20:] for row in THREE_OFFICES.strip().splitlines())
    for name, plan in (("north", THREE_OFFICES), ("south", wide)):
        save_plan(floorplan_from_ascii(plan, resolution=0.9, name=name), tmp_path / f"{name}.geojson")
    paths = [str(tmp_path / f"{name}.geojson") for name in ("north", "south")]
    out = tmp_path / "models"
    plainly = ["evaluate", "train-predictor", *paths, "--stops", "2", "--trees", "4", "--out", str(out)]
    arguments, store = [*plainly, "--folds", "2"], ["--store", str(tmp_path / "store")]
    network = [
        "apartment:7",
        "--stretched",
        "1",
        "--first-steps",
        "2",
        "--steps",
        "2",
        "--frontier-steps",
        "2",
    ]
    result = CliRunner().invoke(cli.app, [*arguments, *network, *store])
    assert result.exit_code == 0, result.output
    assert "held out" in result.output and "hidden_iou" in result.output
    notes = [
        json.loads((out / folder / FRONTIER_MODEL.name).read_text())["note"]
        for folder in ("fold1", "fold2", ".")
    ]
    frontiers, buildings = zip(*(map(int, re.findall(r"\d+", note)) for note in notes), strict=True)
    assert buildings == (2, 2, 3), "a copy is of its plan's building, so that it is held out with it"
    assert (out / "fold1" / "held_out.json").read_text() != (out / "fold2" / "held_out.json").read_text()
    assert make_room_predictor(f"layout:model={out}").name.startswith("layout:")
    networks = [path.name for path in (CELL_NETWORK, FRONTIER_NETWORK)]
    assert all((out / folder / name).exists() for folder in ("fold1", "fold2", ".") for name in networks)
    alone = [*arguments, "apartment:7", "--no-network", *store, "--doubtful", paths[1]]
    assert CliRunner().invoke(cli.app, alone).exit_code == 0
    for folder, more in zip(("fold1", "fold2", "."), frontiers, strict=True):
        fewer = json.loads((out / folder / FRONTIER_MODEL.name).read_text())["note"]
        assert int(fewer.split()[0]) < more, "copies are learnt from"
    assert not any(list(out.rglob(name)) for name in networks), "a network of an earlier training has no say"
    taken = [*plainly, "--frontier-steps", "2", "--rooms-of", "shipped", *store]
    result = CliRunner().invoke(cli.app, taken)
    assert result.exit_code == 0, result.output
    assert (out / FRONTIER_NETWORK.name).exists()
    for path in (CELL_MODEL, CELL_NETWORK):
        assert (out / path.name).read_bytes() == path.read_bytes()
    nowhere = CliRunner().invoke(cli.app, [*plainly, "--rooms-of", str(tmp_path / "none")])
    assert nowhere.exit_code != 0 and str(tmp_path / "none") in str(nowhere.exception)
    bare = tmp_path / "bare"
    bare.mkdir()
    for name in (FRONTIER_MODEL.name, CELL_MODEL.name):
        (bare / name).write_bytes((out / name).read_bytes())
    assert CliRunner().invoke(cli.app, [*taken, "--rooms-of", str(bare)]).exit_code == 0
    assert not (out / CELL_NETWORK.name).exists(), "no network stays that the folder has not"
    assert (out / FRONTIER_NETWORK.name).exists()


def test_a_stopped_training_leaves_the_models_before_as_they_were(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """New trees beside networks of an earlier training would be loaded as one predictor."""
    save_plan(floorplan_from_ascii(THREE_OFFICES, resolution=0.9, name="north"), tmp_path / "north.geojson")
    out = tmp_path / "models"
    command = [
        "evaluate",
        "train-predictor",
        str(tmp_path / "north.geojson"),
        "--stops",
        "2",
        "--out",
        str(out),
    ]
    steps = [part for name in ("first-steps", "steps", "frontier-steps") for part in (f"--{name}", "2")]
    assert CliRunner().invoke(cli.app, [*command, *steps, "--trees", "4"]).exit_code == 0
    before = {path: path.read_bytes() for path in out.iterdir()}

    def stop(*arguments: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(NetworkTrainer, "write", stop)
    assert CliRunner().invoke(cli.app, [*command, *steps, "--trees", "8"]).exit_code != 0
    monkeypatch.setattr("layoutexplore.training.predictor_forests.fit_cell_forests", stop)
    assert CliRunner().invoke(cli.app, [*command, "--no-network", "--trees", "8"]).exit_code != 0
    assert {path: path.read_bytes() for path in out.iterdir()} == before


def test_what_does_not_go_together_is_refused(tmp_path: Path) -> None:
    for name in ("north", "south"):
        plan = floorplan_from_ascii(THREE_OFFICES, resolution=0.9, name=name)
        save_plan(plan, tmp_path / f"{name}.geojson")
    paths = [str(tmp_path / f"{name}.geojson") for name in ("north", "south")]
    arguments = ["evaluate", "train-predictor", *paths, "apartment:7", "--stops", "2", "--no-network"]
    arguments += ["--out", str(tmp_path / "no")]
    for wrong in (["--folds", "3"], ["--folds", "2", "--no-forests"]):
        result = CliRunner().invoke(cli.app, [*arguments, *wrong])
        assert result.exit_code != 0 and not (tmp_path / "no").exists()
    for word in ("apartment:7", "nowhere"):
        result = CliRunner().invoke(cli.app, [*arguments, "--doubtful", word])
        assert result.exit_code != 0 and f"--doubtful '{word}' is no word of PLANS" in str(result.exception)
        assert not (tmp_path / "no").exists()


def test_a_plan_that_is_seen_at_once_teaches_nothing(tmp_path: Path) -> None:
    save_plan(
        floorplan_from_ascii("####\n#aa#\n####", resolution=0.9, name="closet"), tmp_path / "closet.geojson"
    )
    save_plan(floorplan_from_ascii(THREE_OFFICES, resolution=0.9, name="house"), tmp_path / "house.geojson")
    closet, house = (str(tmp_path / f"{name}.geojson") for name in ("closet", "house"))
    options = ["--no-network", "--stops", "2", "--trees", "4", "--out", str(tmp_path / "models")]
    result = CliRunner().invoke(cli.app, ["evaluate", "train-predictor", closet, *options])
    assert result.exit_code != 0
    assert "nothing to learn from" in str(result.exception)
    assert not (tmp_path / "models").exists()
    result = CliRunner().invoke(cli.app, ["evaluate", "train-predictor", closet, house, *options])
    assert result.exit_code == 0 and (tmp_path / "models" / FRONTIER_MODEL.name).exists(), result.output


def test_each_source_is_left_out_in_turn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wide = "\n".join(row[:20] + row[19:20] * 4 + row[20:] for row in THREE_OFFICES.strip().splitlines())
    for name, plan in (("north", THREE_OFFICES), ("south", wide)):
        (tmp_path / name).mkdir()
        save_plan(floorplan_from_ascii(plan, resolution=0.9, name=f"{name}-1"), tmp_path / name / "1.geojson")
    sources = [str(tmp_path / name) for name in ("north", "south")]
    options = ["--leave-out", "source", "--no-network", "--stops", "2", "--trees", "4"]
    out = tmp_path / "models"
    command = ["evaluate", "train-predictor", *sources, "apartment:7", *options, "--out", str(out)]
    result = CliRunner().invoke(cli.app, command)
    assert result.exit_code == 0, result.output
    rows = [line for line in result.output.splitlines() if re.match(r"without-(north|south) ", line)]
    assert len(rows) == 2 and "hidden_mean" in result.output
    for name, other in (("north", "south"), ("south", "north")):
        held_out = json.loads((out / f"without-{name}" / "held_out.json").read_text())
        assert held_out["plans"] == [f"{name}-1"], f"without {other}"
    monkeypatch.setattr("layoutexplore.evaluation.partial_rooms.find_items", lambda snapshot: [])
    result = CliRunner().invoke(cli.app, command)
    assert result.exit_code == 0 and "no room is judged" in result.output, result.output
    for wrong in ([*command, "--folds", "2"], [*command[:3], *command[4:]]):
        assert CliRunner().invoke(cli.app, wrong).exit_code != 0, "one way to hold out, and two sources"


def test_plans_of_one_name_are_tested_together(tmp_path: Path) -> None:
    """Many data sets have a folder for each building and the same names of files in it."""
    wide = "\n".join(row[:20] + row[19:20] * 4 + row[20:] for row in THREE_OFFICES.strip().splitlines())
    for folder, plan in (("north", THREE_OFFICES), ("south", wide)):
        (tmp_path / folder).mkdir()
        named = floorplan_from_ascii(plan, resolution=0.9, name="floor")
        save_plan(named, tmp_path / folder / "floor.geojson")
    words = {folder: [str(tmp_path / folder / "floor.geojson")] for folder in ("north", "south")}

    def explored(*folders: str) -> Explored:
        paths = [words[folder][0] for folder in folders]
        return explore_plans(
            paths, ExplorationConfig(stops=1), forests=True, network=False, rooms=False,
            progress=lambda done, total, name: None,
        )  # fmt: skip

    seen = explored("north", "south")
    alone = [len(explored(folder).asked["floor"]) for folder in words]
    assert len(seen.asked["floor"]) == sum(alone) and min(alone) > 0
    groups = buildings_of(seen, 0)
    assert all(buildings_of_words(seen, groups, words, [folder]) == {"floor"} for folder in words)
