"""The command that predicts rooms behind closed doors."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path

import pytest
from typer.testing import CliRunner

from layoutexplore.cli import app
from layoutexplore.closed_doors.doors import DOOR_FEATURES
from layoutexplore.closed_doors.features import FEATURES
from layoutexplore.closed_doors.models import AGREEMENT, DOOR
from layoutexplore.errors import ConfigError, MapError, ResultsError
from layoutexplore.files.locking import LOCK, held
from layoutexplore.models.forest_files import load_forests


def test_command(closed_door_maps: Path, tmp_path: Path) -> None:
    out, report = tmp_path / "out", tmp_path / "numbers.json"
    arguments = [
        "evaluate",
        "closed-doors",
        str(closed_door_maps),
        "--out",
        str(out),
        "--json",
        str(report),
        "--no-report",
    ]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert {p.name for p in out.iterdir()} == {"office_1_doors_pred.png", "office_2_doors_pred.png"}
    assert len(json.loads(report.read_text())["maps"]) == 2


def test_numbers_are_there_before_pictures(
    closed_door_maps: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A disk that is full of pictures loses no number."""

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("layoutexplore.report.studies.closed_doors.draw_panels", full)
    out, numbers = tmp_path / "out", tmp_path / "numbers.json"
    words = ["evaluate", "closed-doors", str(closed_door_maps), "--out", str(out), "--json", str(numbers)]
    assert isinstance(CliRunner().invoke(app, words).exception, OSError)
    assert len(json.loads(numbers.read_text())["maps"]) == 2
    assert (out / "maps.csv").exists() and (out / "summary.csv").exists()


def test_of_two_studies_in_one_folder_the_second_is_refused(closed_door_maps: Path, tmp_path: Path) -> None:
    """The page of each would show the predictions of both."""
    words = ["evaluate", "closed-doors", str(closed_door_maps), "--out", str(tmp_path / "out")]
    words += ["--folds", "2", "--cache", str(tmp_path / "samples")]
    with held(tmp_path / "out", "study"):
        second = CliRunner().invoke(app, words)
        assert isinstance(second.exception, ResultsError) and "another study" in str(second.exception)
        assert not (tmp_path / "samples").exists(), "refused before anything is learnt"
        assert [path.name for path in (tmp_path / "out").iterdir()] == [LOCK]
    assert not (tmp_path / "out").exists()


def test_training_writes_both_models(closed_door_maps: Path, tmp_path: Path) -> None:
    words = ["evaluate", "train-closed-doors", str(closed_door_maps), "--out", str(tmp_path / "models")]
    result = CliRunner().invoke(app, [*words, "--cache", str(tmp_path / "samples")])
    assert result.exit_code == 0, result.output
    assert "maps of 1 building" in result.output
    assert len(load_forests(tmp_path / "models" / "doors.json", DOOR_FEATURES)[DOOR].roots)
    assert len(load_forests(tmp_path / "models" / "rooms.json", FEATURES)[AGREEMENT].roots)
    missing = CliRunner().invoke(app, [*words[:2], str(tmp_path / "nowhere"), *words[3:]])
    assert isinstance(missing.exception, MapError) and "nowhere" in str(missing.exception)


@pytest.mark.parametrize("folds", ["1", "8"])
def test_folds_that_cannot_be_dealt_are_refused_before_anything_is_learnt(
    closed_door_maps: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folds: str
) -> None:
    def learn(*_: object) -> None:
        raise AssertionError("samples are collected")

    monkeypatch.setattr("layoutexplore.training.closed_doors.collect_all", learn)
    arguments = ["evaluate", "closed-doors", str(closed_door_maps), "--out", str(tmp_path), "--folds", folds]
    result = CliRunner().invoke(app, [*arguments, "--no-report"])
    assert isinstance(result.exception, ConfigError) and "two buildings at least" in str(result.exception)


@pytest.mark.parametrize("option", ["--plans", "--cache"])
def test_options_of_training_without_folds_are_refused(
    closed_door_maps: Path, tmp_path: Path, option: str
) -> None:
    arguments = [
        "evaluate",
        "closed-doors",
        str(closed_door_maps),
        "--out",
        str(tmp_path),
        option,
        "office-01",
    ]
    result = CliRunner().invoke(app, arguments)
    assert isinstance(result.exception, ConfigError) and f"{option} is about training" in str(
        result.exception
    )
