"""Studies of maps go on without the maps that cannot be used, name them at the end, and end with status 1."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner, Result

from layoutexplore.cli import app
from layoutexplore.errors import MapError, WorkerError
from layoutexplore.evaluation.segmentation import evaluate_cases
from layoutexplore.plugins.transport import worker_pool
from layoutexplore.training.map_noise.files import describe_folders
from tests.maps.test_painted_rooms import paint

BROKEN = "cut_off", "void", "unpainted"
"""One that is no picture, one without free space, and one without true rooms."""


@pytest.fixture
def maps(tmp_path: Path) -> Path:
    folder = tmp_path / "maps"
    for k, name in enumerate(("barn", *BROKEN, "mill")):
        paint(folder, name, 36 + 4 * k)
    (folder / "cut_off.png").write_bytes(b"no picture")
    cv2.imwrite(str(folder / "void.png"), np.full((60, 90), 205, np.uint8))
    cv2.imwrite(str(folder / "unpainted_gt.png"), np.zeros((60, 90), np.uint8))
    return folder


def evaluate(*words: str | Path) -> Result:
    return CliRunner().invoke(app, ["evaluate", *map(str, words)])


def failed(result: Result, *names: str) -> bool:
    """Whether a command ended with these maps named, one a line."""
    lines = result.output.splitlines()[-len(names) :]
    named = all(line.startswith("failed: ") and name in line for line, name in zip(lines, names, strict=True))
    return result.exit_code == 1 and named and result.output.count("failed: ") == len(names)


def test_rooms_of_the_other_maps_are_scored(maps: Path, tmp_path: Path) -> None:
    out, numbers = tmp_path / "out", tmp_path / "numbers.json"
    result = evaluate("segmentation", maps, "-m", "doorways", "--out", out, "--json", numbers)
    assert failed(result, "cut_off.png", "unpainted_gt.png", "void.png"), result.output
    said = json.loads(numbers.read_text())
    assert [row["map"] for row in said["maps"]] == ["barn", "mill"] and len(said["failed"]) == 3
    page = (out / "report.html").read_text()
    assert "Failed maps" in page and "cut_off.png" in page and "<b>3</b>failed" in page
    held_out = "--folds=2", "--simulated=2", "--resolution=0.1", f"--buildings={table(tmp_path)}"
    folds = evaluate("segmentation", maps, *held_out)
    assert failed(folds, "cut_off.png", "unpainted_gt.png", "void.png"), folds.output
    assert folds.output.count("default:") == 2


def test_what_is_scored_stays_where_a_worker_dies(
    maps: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def dying(*arguments: Any, **options: Any) -> Iterator[Any]:
        if options["jobs"] == 2:
            yield next(evaluate_cases(*arguments, **options))
        with worker_pool(1) as pool:
            pool.submit(os._exit, 1).result()

    monkeypatch.setattr("layoutexplore.evaluation.segmentation.evaluate_cases", dying)
    numbers = tmp_path / "numbers.json"
    command = ["segmentation", maps, "-m", "doorways", "--json", numbers]
    nothing = evaluate(*command)
    assert isinstance(nothing.exception, WorkerError) and not numbers.exists()
    result = evaluate(*command, "--jobs=2")
    assert failed(result, "cut_off.png", "unpainted_gt.png", "void.png", "after barn: one of 1 worker")
    said = json.loads(numbers.read_text())
    assert [row["map"] for row in said["maps"]] == ["barn"] and "fewer of them (--jobs" in said["failed"][-1]


def table(folder: Path) -> Path:
    path = folder / "buildings.csv"
    path.write_text("map,building\n" + "".join(f"{name},{name}\n" for name in ("barn", "mill", *BROKEN)))
    return path


def test_clutter_is_added_to_the_other_maps(maps: Path, tmp_path: Path) -> None:
    numbers = tmp_path / "numbers.json"
    for name in ("mill", "unpainted"):
        (maps / f"{name}.png").unlink()
    result = evaluate("clutter", maps, "--json", numbers)
    assert failed(result, "cut_off.png", "void.png"), result.output
    clean = json.loads(numbers.read_text())["summary"]["clean_scores"]
    assert [Path(name).stem for name in clean] == ["barn"]


def test_the_other_maps_are_described(maps: Path) -> None:
    statistics, buildings, wrong = describe_folders([maps], 0.05)
    assert len(statistics) == len(buildings) == 3 and len(wrong) == 2
    for name in ("barn", "mill", "unpainted"):
        (maps / f"{name}.png").unlink()
    with pytest.raises(MapError, match=r"cut_off.*; .*void\.png: a map without free"):
        describe_folders([maps], 0.05)


def test_a_study_of_no_usable_map_ends_with_what_is_wrong(maps: Path) -> None:
    (maps / "barn_gt.png").unlink(), (maps / "mill_gt.png").unlink()
    result = evaluate("segmentation", maps, "-m", "doorways")
    assert isinstance(result.exception, MapError) and "unpainted_gt.png: no room" in str(result.exception)


def test_a_folder_without_maps_is_named(tmp_path: Path) -> None:
    (tmp_path / "barn_gt.png").touch()
    for study in ("clutter", "segmentation"):
        result = evaluate(study, tmp_path)
        assert isinstance(result.exception, MapError) and f"{tmp_path}: no map" in str(result.exception)
