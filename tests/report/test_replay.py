"""Replays: packed without loss, as many as there is room for, and played by a browser."""

from __future__ import annotations

import base64
import dataclasses
import json
import re
import shutil
import subprocess
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.runner import run_benchmark
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.cli import app
from layoutexplore.errors import ResultsError, UnknownNameError
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.report.replay import replay_view, runs_to_replay, write_replay
from tests.plans import HOUSE

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> ResultsFolder:
    """Two agents from two starts on a plan whose name would end a script."""
    plans = tmp_path_factory.mktemp("plans")
    save_plan(floorplan_from_ascii(HOUSE, resolution=0.6, name="</script><b>"), plans / "plan.geojson")
    config = BenchmarkConfig(plans=(str(plans),), starts=2, agents=("nearest", "layout-tour"))
    return run_benchmark(config, tmp_path_factory.mktemp("results") / "out", command="a command").folder


def unpack(text: str) -> dict[str, np.ndarray[Any, Any]]:
    raw = zlib.decompress(base64.b64decode(text))
    length = int.from_bytes(raw[:4], "little")
    return {
        name: np.frombuffer(raw, kind, count, 4 + length + at)
        for name, kind, count, at in json.loads(raw[4 : 4 + length])
    }


def test_what_is_packed_is_what_was_recorded(folder: ResultsFolder) -> None:
    rows = folder.rows()
    view = replay_view(folder, rows)
    assert view is not None and "</script" not in view.json and len(view.numbers) == 4
    data = json.loads(view.json)
    for row, run in zip(rows, data["runs"], strict=True):
        recording, arrays = folder.recording(row), unpack(run["data"])
        assert recording is not None and run["agent"] == row.agent
        assert np.array_equal(arrays["first"], recording.first.ravel())
        assert np.array_equal(
            np.unpackbits(arrays["occupied"])[: recording.first.size], recording.occupied.ravel()
        )
        assert np.array_equal(arrays["curve"].reshape(-1, 2), folder.episode(row)[0])
        assert np.array_equal(arrays["rooms"], recording.rooms.ravel())
    floor = data["floors"][rows[0].plan]
    occupied, frame = folder.raster(rows[0].plan)
    bits = np.unpackbits(unpack(floor["data"])["occupied"], count=occupied.size)
    assert floor["frame"] == frame.tolist() and np.array_equal(bits, occupied.ravel())
    assert view.link(rows[1], 3.14159) == "#replay=1@3.14"


def test_the_command_of_other_runs_names_the_folder_as_a_shell_reads_it(
    folder: ResultsFolder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "my results"
    shutil.copytree(folder.path, place)
    monkeypatch.chdir(place)
    for path in (place, Path()):
        view = replay_view(ResultsFolder(path), folder.rows())
        assert view is not None and "layoutexplore replay 'my results' --plan NAME" in view.note


def test_only_what_there_is_room_for(folder: ResultsFolder) -> None:
    rows = folder.rows()
    every = replay_view(folder, rows)
    sizes = [len(run["data"]) for run in json.loads(every.json if every else "")["runs"]]
    view = replay_view(folder, rows, most_bytes=sizes[0] + sizes[1] + 4000)
    assert view is not None and len(view.numbers) == 2 and "2 of 4 runs" in view.note
    assert view.link(rows[3], 1.0) == ""
    chosen = runs_to_replay(rows, [rows[3]])
    assert [row.key for row in chosen[:1]] == [rows[3].key]
    assert {(row.agent, row.start) for row in chosen} == {
        ("nearest", 0),
        ("layout-tour", 0),
        (rows[3].agent, 1),
    }


def test_the_command_writes_a_page(folder: ResultsFolder, tmp_path: Path) -> None:
    out = tmp_path / "page.html"
    done = CliRunner().invoke(
        app, ["replay", str(folder.path), "--agent", "nearest", "--start", "1", "--out", str(out)]
    )
    assert done.exit_code == 0 and "1 of 1 run" in done.output and "a command" in out.read_text()
    wrong = CliRunner().invoke(app, ["replay", str(folder.path), "--agent", "nearst", "--out", str(out)])
    assert isinstance(wrong.exception, UnknownNameError) and "did you mean 'nearest'" in str(wrong.exception)


def test_without_recordings_there_is_no_page(folder: ResultsFolder, tmp_path: Path) -> None:
    with pytest.raises(ResultsError, match="no recording"):
        write_replay(folder, [], tmp_path / "page.html")
    assert not (tmp_path / "page.html").exists()


def test_where_all_runs_failed_there_is_no_page(folder: ResultsFolder, tmp_path: Path) -> None:
    shutil.copytree(folder.path, tmp_path / "failed")
    failed = ResultsFolder(tmp_path / "failed")
    failed.rewrite([dataclasses.replace(row, error="Boom: no") for row in folder.rows()])
    for more in ([], ["--agent", "nearest"]):
        done = CliRunner().invoke(
            app, ["replay", str(failed.path), "--out", str(tmp_path / "page.html"), *more]
        )
        assert isinstance(done.exception, ResultsError)
        said = str(done.exception)
        assert f"all {2 if more else 4} runs" in said and "Boom: no" in said and "error.txt" in said
        assert "earlier version" not in said
    assert not (tmp_path / "page.html").exists()


def page_after_scripts(page: Path, hash_: str, profile: Path) -> str:
    """The page's elements after its scripts have run, by a browser without a screen."""
    if BROWSER is None:
        pytest.skip("no browser (chromium) is installed")
    command = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={profile}"]
    command += ["--virtual-time-budget=8000", "--dump-dom", f"{page.as_uri()}{hash_}"]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout


def test_a_browser_shows_the_map_of_the_moment(folder: ResultsFolder, tmp_path: Path) -> None:
    row = next(row for row in folder.rows() if row.agent == "layout-tour")
    recording, curve = folder.recording(row), folder.episode(row)[0]
    assert recording is not None
    write_replay(folder, [row], tmp_path / "page.html")
    for metres in (0.0, row.distance / 2, row.distance):
        dom = page_after_scripts(tmp_path / "page.html", f"#replay=0@{metres:.3f}", tmp_path / "profile")
        scans = int(np.count_nonzero(curve[:, 0] <= round(metres, 3) + 1e-4))
        shown = {
            name: int(value) for name, value in re.findall(r'data-(known|scans|decision)="(-?\d+)"', dom)
        }
        assert 'data-state="ready"' in dom and shown["scans"] == scans
        assert shown["known"] == np.count_nonzero(recording.cells(scans) >= 0)
        assert shown["decision"] == np.count_nonzero(recording.decided[:, 0] <= scans) - 1
        assert f"{metres:.1f} m, {100 * curve[scans - 1, 1]:.1f} % seen" in dom
        assert "&lt;/script&gt;&lt;b&gt;, start" in dom and "<b>," not in dom
