"""Leaderboards: what counts, what is left out and why, and how agents rank."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from layoutexplore.benchmark.analysis import compare, over_all_sensors
from layoutexplore.benchmark.leaderboard import make_leaderboard
from layoutexplore.benchmark.runner import run_benchmark
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.benchmark.suite import Suite, load_suite
from layoutexplore.cli import app
from layoutexplore.errors import ResultsError
from layoutexplore.files import to_toml
from layoutexplore.report.leaderboard import write_leaderboard


@pytest.fixture(scope="module")
def suite(plans: Path, tmp_path_factory: pytest.TempPathFactory) -> Suite:
    """Two small floor plans, two starts, two sensors."""
    path = tmp_path_factory.mktemp("suite") / "small.toml"
    path.write_text(f'plans = ["{plans}"]\nstarts = 2\nsensors = ["stage", "indoor"]\n')
    return load_suite(str(path))


@pytest.fixture(scope="module")
def whole(suite: Suite, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of four agents that are whole."""
    out = tmp_path_factory.mktemp("results") / "whole"
    run_benchmark(suite.config(("random", "tour", "clairvoyant")), out)
    return out


@pytest.fixture
def copy(whole: Path, tmp_path: Path) -> Path:
    """The same, to be changed."""
    return Path(shutil.copytree(whole, tmp_path / "copy"))


def reasons(folder: Path, suite: Suite, whole: Path, *, repeat: int = 0) -> dict[str, str]:
    """Why agents of a folder do not count, beside a folder that does."""
    board = make_leaderboard([folder, whole], suite, repeat=repeat)
    assert {"nearest", "tour"} <= {standing.entrant.agent for standing in board.standings}
    return {out.agent: out.reason for out in board.left_out if out.folder == folder}


def test_the_ranking(suite: Suite, whole: Path) -> None:
    said: list[str] = []
    board = make_leaderboard([str(whole)], suite, repeat=2, say=said.append)
    assert not board.left_out and len(said) == 2 * 4
    assert (board.cells, board.buildings) == (8, 2)
    ranks = {standing.entrant.agent: standing.rank for standing in board.standings}
    assert ranks["clairvoyant"] == 0 and board.standings[0].entrant.agent == "clairvoyant"
    assert sorted(ranks.values()) == [0, 1, 2, 3] and ranks["random"] == 3
    for standing in board.standings:
        assert len(standing.entrant.repeated) == 2 and standing.ratios["d95"].plans == 2
        assert set(standing.by_sensor) == {"stage", "indoor"}
    estimates = [s.ratios["d95"].ratio.estimate for s in board.standings[1:]]
    assert estimates == sorted(estimates)
    leads = over_all_sensors(compare(ResultsFolder(whole).rows(), board.standings[1].entrant.agent))
    for standing in board.standings:
        chance = leads[standing.entrant.agent, "d95"].ratio.low <= 1 and standing.rank > 1
        assert standing.tied == chance
    assert {standing.tied for standing in board.standings[2:]} == {True, False}


def test_other_cells_are_left_out(suite: Suite, whole: Path, tmp_path: Path) -> None:
    config = dataclasses.replace(suite.config(("random",)), seed=5)
    run_benchmark(dataclasses.replace(config, agents=("nearest",)), tmp_path / "other")
    said = reasons(tmp_path / "other", suite, whole)
    assert said[""] == "other cells than the suite's: different seed"
    with pytest.raises(ResultsError, match=f"\n  {tmp_path / 'other'}: other cells") as caught:
        make_leaderboard([tmp_path / "other"], suite)
    assert f"of suite {suite.name} (--suite names another)" in str(caught.value)
    told = reasons(tmp_path / "nowhere", suite, whole)[""]
    assert told.startswith("holds no benchmark: there is no run.toml"), "the folder stands beside it"


def test_doors_that_lead_elsewhere_make_other_cells(copy: Path, suite: Suite, whole: Path) -> None:
    manifest = ResultsFolder(copy).manifest()
    plan = manifest["plans"]["house"]
    for kept, said in ((True, "different rooms of doors"), (False, "")):
        plan["raster_hash"] = "0" * 64
        if not kept:  # as earlier versions wrote it
            del plan["raster_hash"]
        (copy / "run.toml").write_text(to_toml(manifest))
        assert said in reasons(copy, suite, whole).get("", "")
    assert "" not in reasons(copy, suite, whole)


def test_another_version_is_left_out(copy: Path, suite: Suite, whole: Path) -> None:
    text = (copy / "run.toml").read_text()
    version = ResultsFolder(copy).manifest()["settings"]["version"]
    (copy / "run.toml").write_text(text.replace(f'version = "{version}"', 'version = "0.0.1"'))
    assert "made by version 0.0.1" in reasons(copy, suite, whole)[""]


def test_what_is_missing_is_left_out(copy: Path, suite: Suite, whole: Path) -> None:
    folder = ResultsFolder(copy)
    rows = folder.rows()
    gone = next(row for row in rows if row.agent == "tour")
    failed = next(row for row in rows if row.agent == "random")
    kept = [row for row in rows if row is not gone and row is not failed]
    folder.rewrite([*kept, dataclasses.replace(failed, error="MapError: no")])
    said = reasons(copy, suite, whole)
    assert said["tour"] == "incomplete: 1 of 8 runs are missing"
    assert said["random"] == "incomplete: 1 of 8 runs are missing, 1 of them failed"
    assert "nearest" not in said


@pytest.mark.parametrize("column", ["d95", "rooms_finished", "coverage"])
def test_numbers_that_cannot_be_repeated_are_left_out(
    column: str, copy: Path, suite: Suite, whole: Path
) -> None:
    folder = ResultsFolder(copy)
    rows = folder.rows()
    better = [
        dataclasses.replace(row, **{column: getattr(row, column) * 2}) if row.agent == "random" else row
        for row in rows
    ]
    folder.rewrite(better)
    said = reasons(copy, suite, whole, repeat=1)
    assert set(said) == {"random"} and f"{column} was" in said["random"]
    assert reasons(copy, suite, whole, repeat=0).get("random", "") == ""


def test_ways_that_cannot_be_repeated_are_left_out(copy: Path, suite: Suite, whole: Path) -> None:
    folder = ResultsFolder(copy)
    for row in folder.rows():
        if row.agent == "tour":
            with np.load(folder.curve_path(row)) as data:
                arrays = {name: data[name] for name in data.files}
            arrays["track"][-1] += 1
            np.savez_compressed(folder.curve_path(row), **arrays)
    said = reasons(copy, suite, whole, repeat=1)
    assert set(said) == {"tour"} and said["tour"].endswith("its way differs")


def test_other_weights_are_left_out(copy: Path, suite: Suite, whole: Path) -> None:
    manifest = ResultsFolder(copy).manifest()
    manifest["settings"]["models"] = {"tour": "0123456789ab"}
    (copy / "run.toml").write_text(to_toml(manifest))
    assert "other weights" in reasons(copy, suite, whole)["tour"]


def test_without_the_baseline_there_is_no_ranking(copy: Path, suite: Suite) -> None:
    folder = ResultsFolder(copy)
    folder.rewrite([row for row in folder.rows() if row.agent != "nearest"])
    with pytest.raises(ResultsError, match="no results of nearest to compare with"):
        make_leaderboard([copy], suite, repeat=0)


def test_one_run_in_one_building_is_no_more(whole: Path, suite: Suite, tmp_path: Path) -> None:
    board = make_leaderboard([whole], suite, repeat=0)
    write_leaderboard(dataclasses.replace(board, cells=1, buildings=1), tmp_path)
    for name in ("leaderboard.html", "leaderboard.md"):
        text = (tmp_path / name).read_text()
        assert "1 building;" in text and "1 run of each agent" in text
        assert "made again" in text and "came out" not in text, "none was repeated"


def test_the_command_writes_page_and_tables(whole: Path, suite: Suite, tmp_path: Path) -> None:
    out = tmp_path / "board"
    bad = tmp_path / "<b>not results"
    bad.mkdir()
    command = ["leaderboard", str(whole), str(bad), "--suite", suite.name, "--repeat", "1", "--out", str(out)]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.output
    assert "left out:" in done.output and "repeating tour on" in done.output
    html, text = (out / "leaderboard.html").read_text(), (out / "leaderboard.md").read_text()
    assert "<b>not" not in html and "<b>not" not in text and "&lt;b&gt;not results" in html
    table = np.genfromtxt(out / "leaderboard.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    assert set(table["agent"]) == {"nearest", "random", "tour", "clairvoyant"}
    assert table["d95_estimate"][table["agent"] == "nearest"][0] == 1.0
    assert all(name in html and name in text for name in table["agent"])
