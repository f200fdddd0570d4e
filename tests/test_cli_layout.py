"""The commands `layout` and `evaluate`, on small maps drawn here."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from layoutexplore.cli import app
from layoutexplore.errors import ConfigError, MapError
from layoutexplore.evaluation.cross_validation import deal_folds
from layoutexplore.evaluation.segmentation import find_cases, guess_building

runner = CliRunner()


def draw(folder: Path, name: str, wall: int = 82) -> None:
    """Two rooms side by side, the wall between them at column `wall`, and their painted truth."""
    image = np.full((140, 200), 205, np.uint8)
    image[20:120, 20:180] = 0
    truth = np.zeros((140, 200, 3), np.uint8)
    for (left, right), colour in (((24, wall), (0, 0, 255)), ((wall + 4, 176), (0, 255, 0))):
        image[24:116, left:right] = 254
        truth[24:116, left:right] = colour
    image[60:78, wall : wall + 4] = 254
    cv2.imwrite(str(folder / f"{name}.png"), image)
    cv2.imwrite(str(folder / f"{name}_gt.png"), truth)


def test_layout_writes_labels_in_the_image_orientation(tmp_path: Path) -> None:
    draw(tmp_path, "flat")
    result = runner.invoke(app, ["layout", str(tmp_path / "flat.png"), "--out", str(tmp_path / "out"), "--json"])
    assert result.exit_code == 0, result.output
    summary = json.loads(result.output)
    assert summary["rooms"] == 2
    labels = cv2.imread(summary["labels"], cv2.IMREAD_UNCHANGED)
    assert labels.dtype == np.uint16 and labels.shape == (140, 200)
    assert labels[30, 30] != labels[30, 150] and labels[0, 0] == 0
    image = cv2.imread(str(tmp_path / "flat.png"), cv2.IMREAD_GRAYSCALE)
    assert not labels[image == 0].any()
    features = json.loads(Path(summary["geojson"]).read_text())["features"]
    assert len(features) >= 2
    assert cv2.imread(summary["overview"]) is not None


def test_layout_prints_a_line_a_map_and_refuses_equal_names(tmp_path: Path) -> None:
    for name in ("a", "b"):
        draw(tmp_path, name)
    maps = [str(tmp_path / f"{n}.png") for n in ("a", "b")]
    result = runner.invoke(app, ["layout", *maps, "--out", str(tmp_path), "-m", "distance"])
    assert result.exit_code == 0 and len(result.output.strip().splitlines()) == 2
    again = runner.invoke(app, ["layout", maps[0], maps[0], "--out", str(tmp_path)])
    assert isinstance(again.exception, ConfigError)


def test_evaluate_segmentation_scores_several_methods(tmp_path: Path) -> None:
    for k, name in enumerate(("a", "b")):
        draw(tmp_path, name, 82 + 10 * k)
    out = tmp_path / "report"
    numbers = tmp_path / "numbers.json"
    options = ["-m", "default", "-m", "voronoi", "--out", str(out), "--json", str(numbers), "--protocol", "bormann"]
    result = runner.invoke(app, ["evaluate", "segmentation", str(tmp_path), *options])
    assert result.exit_code == 0, result.output
    data = json.loads(numbers.read_text())
    assert {r["method"] for r in data["maps"]} == {"default", "voronoi"} and len(data["maps"]) == 4
    best = next(line for line in data["summary"] if line["method"] == "default")
    assert best["one_to_one"] > 0.9 and best["maps"] == 2
    rows = list(csv.DictReader((out / "results.csv").open()))
    assert len(rows) == 4 and float(rows[0]["precision"]) > 90
    assert "Map by map" in (out / "report.html").read_text()
    assert len(list((out / "pictures").glob("*.png"))) == 4


def test_cross_validation_never_trains_on_the_building_it_scores(tmp_path: Path) -> None:
    for name in ("tower_scan", "tower2", "barn"):
        draw(tmp_path, name)
    cases = find_cases([tmp_path])
    assert {c.building for c in cases} == {"tower", "tower2", "barn"}
    assert len(set(deal_folds(cases, 3).values())) == 3
    with pytest.raises(ConfigError, match="folds"):
        deal_folds(cases, 4)
    options = ["--folds", "2", "--simulated", "2", "--weight", f"{tmp_path.name}=2"]
    result = runner.invoke(app, ["evaluate", "segmentation", str(tmp_path), *options])
    assert result.exit_code == 0, result.output
    assert result.output.count("default:") == 3


def test_buildings_come_from_a_file_or_the_name(tmp_path: Path) -> None:
    draw(tmp_path, "map1")
    assert guess_building("lab_intel", "x") == guess_building("intel_map", "y") == "intel"
    assert find_cases([tmp_path])[0].building == tmp_path.name
    assert find_cases([tmp_path], {"map1": "castle"})[0].building == "castle"


def test_what_is_missing_is_said_clearly(tmp_path: Path) -> None:
    with pytest.raises(MapError, match="no map"):
        find_cases([tmp_path])
    with pytest.raises(MapError, match="no such folder"):
        find_cases([tmp_path / "nowhere"])
    result = runner.invoke(app, ["evaluate", "segmentation", str(tmp_path), "--protocol", "roses"])
    assert isinstance(result.exception, ConfigError)
    result = runner.invoke(app, ["evaluate", "segmentation", str(tmp_path), "-m", "roses"])
    assert isinstance(result.exception, ConfigError)
    for weight in ("nowhere=4", f"{tmp_path.name}=heavy", f"{tmp_path.name}=0"):
        draw(tmp_path, "map1")
        result = runner.invoke(app, ["evaluate", "train", str(tmp_path), "--out", str(tmp_path / "m.json"), "--weight", weight])
        assert isinstance(result.exception, ConfigError) and weight in str(result.exception)


def test_evaluate_layout_on_a_school(data_dir: Path, tmp_path: Path) -> None:
    folder = data_dir / "gridmaps" / "schools"
    for suffix in (".png", "_gt.xml"):
        (tmp_path / f"herndon{suffix}").write_bytes((folder / f"herndon{suffix}").read_bytes())
    result = runner.invoke(app, ["evaluate", "layout", str(tmp_path), "--json", str(tmp_path / "n.json")])
    assert result.exit_code == 0, result.output
    row = json.loads((tmp_path / "n.json").read_text())["maps"][0]
    assert row["a_fc"] > 0.75 and row["a_bc"] > 0.7
