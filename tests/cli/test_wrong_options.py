"""Options that make no sense are refused before anything runs: status 2, one line that says what to do."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.test_cli import run

WRONG: dict[str, str] = {
    "benchmark --plans apartment-01 --jobs 2147483648": "--jobs must be a whole number from 1 to 1024",
    "benchmark --plans apartment-01 --jobs -1": "--jobs must be a whole number",
    "benchmark --plans apartment-01 --starts 2147483648": "starts must be a whole number from 1 to 10000",
    "benchmark --plans apartment-01 --starts 0": "starts must be",
    "benchmark --plans office:1-99999 --starts 9999": "runs are more than 1000000",
    "evaluate partial-rooms office:1-99999 -s stage --starts 9999": "explorations are more than 1000000",
    "benchmark --plans apartment-01 --cell-seconds inf": "cell_seconds must be a number from 0",
    "benchmark --plans apartment-01 --cell-mb nan": "cell_mb must be a number from 0",
    "benchmark --plans apartment-01 --agents nearset": "did you mean 'nearest'",
    "benchmark --plans apartment-01 --seed 18446744073709551616": "seed must be a whole number from 0",
    "explore apartment-01 --save-state a.npz --seed 18446744073709551616": "--seed must be a whole",
    "maps import {file} --out a.geojson --robot-radius nan": "--robot-radius must be a number from 0 to 100",
    "maps import {file} --out a.geojson --column rom=x": "did you mean 'room'",
    "maps import {file} --out a.geojson --column room=x --column room=y": "is given twice",
    "maps import {file} --out a.geojson --column room=x": "is a picture: --column is for GeoJSON",
    "maps import {file} --out folder": "is a folder: --out must name a file",
    "evaluate registration apartment-01 --out a --jobs 9999": "--jobs must be a whole number from 1 to 1024",
    "evaluate map-noise folder --plans apartment-01 --out a.csv": "must name a file that ends with .toml",
    "evaluate train-fans --out a": "--out must name a file that ends with .json",
    "evaluate train-separator --out a": "--out must name a file that ends with .safetensors",
    "evaluate train folder --out a.csv": "--out must name a file that ends with .json",
    "evaluate train folder --out a.json --cut-out a": "must name a file that ends with .json",
    "layout {file} --jobs 9999": "--jobs must be a whole number from 1 to 1024",
    "speed --only import --json folder": "is a folder: --json must name a file",
    "speed --only ryas": "did you mean 'rays'",
    "explore apartment-01 --region 0,0": 'three corners X,Y in metres or more in one text, as "0,0 4,0 4,3"',
    "explore apartment-01 --continue nowhere.npz": "there is no such file",
    "explore apartment-01 --video .": "a film is an .mp4 or .gif file, got '.'",
    "layout .": ".: is a folder: name one map inside it, as floor.png",
    "layout /": "/: is a folder: name one map inside it",
    "frontiers folder": "folder: is a folder: name one map inside it",
}


@pytest.mark.parametrize("words", WRONG)
def test_it_is_told_in_one_line_and_nothing_is_made(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "floor.png").write_bytes(b"no picture")
    monkeypatch.chdir(tmp_path)
    assert run(monkeypatch, *words.format(file="floor.png").split()) == 2
    told = capsys.readouterr().err.strip()
    assert told.startswith("layoutexplore: ") and WRONG[words] in told and "\n" not in told, told
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["floor.png", "folder"]


def test_a_plan_to_train_on_is_read_before_training_begins(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("sb3_contrib")
    (tmp_path / "plan.txt").write_text("a house")
    out = tmp_path / "out"
    words = ("train", "--plans", str(tmp_path / "plan.txt"), "--out", str(out), "--seed", "1")
    assert run(monkeypatch, *words) == 2
    assert "no known format of floor plans" in capsys.readouterr().err
    assert run(monkeypatch, "train", "--out", str(out), "--seed", "99999999999") == 2
    assert "seed must be a whole number from 0" in capsys.readouterr().err and not out.exists()


@pytest.mark.parametrize(
    ("words", "option"),
    [
        ("benchmark study.toml", "--config study.toml"),
        ("benchmark office-01 office-02", "--plans office-01"),
        ("explore office-01 layout-tour", "--agent layout-tour"),
        ("explore office-01 --region 0,0 12,0 12,9", '--region "0,0 12,0 12,9"'),
        ("maps list office-01", ""),
    ],
)
def test_a_word_too_many_is_told_with_its_option(
    words: str, option: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, *words.split()) == 2
    told = " ".join(capsys.readouterr().err.replace("│", "").split())
    assert "Got unexpected extra argument" in told
    assert ("perhaps" in told or "quotes" in told) == bool(option) and option in told


@pytest.mark.parametrize(
    ("words", "again"),
    [
        ("explore {nowhere} --sensor stage --sensor=indoor", "--sensor"),
        ("maps show {nowhere} --out a.png --out b.png", "--out"),
        ("explore {nowhere} --sensor stage --seed 1", ""),
        ("benchmark --plans {nowhere} --sensor stage --sensor indoor", ""),
    ],
)
def test_an_option_of_one_value_that_is_given_twice_is_told(
    words: str,
    again: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(monkeypatch, *words.format(nowhere="nowhere.png").split()) == 2
    told = capsys.readouterr().err
    assert (f"warning: {again} takes one value: the last one counts" in told) == bool(again), told
    assert ("takes one value" in told) == bool(again), told
