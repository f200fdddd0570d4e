"""Lines that say how far a long command is."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from rich.console import Console
from typer.testing import CliRunner

from layoutexplore.benchmark import runner
from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.runner import BenchmarkWatcher
from layoutexplore.cli import app, progress
from layoutexplore.cli.benchmark import run_with_progress
from layoutexplore.cli.progress import ProgressLine, plain_console, print_table
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.tracing import floorplan_from_ascii
from tests.plans import TWO_ROOMS


def test_the_end_is_told_once_however_often_it_is_reached() -> None:
    console = Console(file=io.StringIO(), width=200)
    with ProgressLine(console, "steps") as line:
        for done in (1, 10, 10, 10):  # as of training, whose last rollout goes past its end
            line.advance(done, 10, done / 10)
    assert isinstance(console.file, io.StringIO)
    assert console.file.getvalue().count("10/10 steps") == 1


@pytest.mark.parametrize("width", [40, 60, 100])
def test_how_far_it_is_is_told_on_narrow_terminals(width: int) -> None:
    console = Console(file=io.StringIO(), width=width, force_terminal=True, color_system=None)
    with ProgressLine(console, "runs") as line:
        line.advance(7, 12, 0.5, "apartment-01 stage layout-tour:predictor=rectangle")
    assert isinstance(console.file, io.StringIO)
    assert "7/12 runs" in console.file.getvalue()


def test_kernels_that_are_compiled_later_have_a_bar_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a large floor plan more are needed, which is known once the plans are read."""
    now = 0.0

    def run(*_: object, watcher: BenchmarkWatcher, **__: object) -> None:
        nonlocal now
        for total in (40, 30):
            watcher.say(f"compiling {total} kernels")
            for done in (1, total):
                now += 20.0
                watcher.compiled(done, total)

    monkeypatch.setattr(progress.time, "monotonic", lambda: now)
    monkeypatch.setattr(runner, "run_benchmark", run)
    console = Console(file=io.StringIO(), width=200)
    run_with_progress(console, BenchmarkConfig(plans=("apartment-01",)), Path("out"), jobs=2)
    assert isinstance(console.file, io.StringIO)
    lines = console.file.getvalue().splitlines()
    assert [text for text in lines if text[0].isdigit()] == [
        "1/40 kernels, 0:20 elapsed",
        "40/40 kernels, 0:40 elapsed",
        "1/30 kernels, 0:20 elapsed",
        "30/30 kernels, 0:40 elapsed",
    ]


def test_names_that_look_like_markup_are_written_as_they_are() -> None:
    odd = "[red]a[/b] :smile:"
    for is_terminal in (False, True):
        console = plain_console(file=io.StringIO(), width=200, force_terminal=is_terminal)
        with ProgressLine(console, "steps") as line:
            line.advance(1, 2, 0.5, odd)
            line.say(odd)
            line.advance(2, 2, 1.0, odd)
        assert isinstance(console.file, io.StringIO)
        assert odd in console.file.getvalue()


def test_the_time_left_goes_by_the_speed_of_late(monkeypatch: pytest.MonkeyPatch) -> None:
    console, times = Console(file=io.StringIO(), width=200), iter((0.0, 300.0, 320.0, 340.0))
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(times))
    with ProgressLine(console, "% seen") as line:
        for done in (2, 42, 82):  # kernels were compiled for the first five minutes
            line.advance(done, 100, done / 100)
    assert isinstance(console.file, io.StringIO)
    assert console.file.getvalue().splitlines() == [
        "2 % seen, 5:00 elapsed",
        "42 % seen, 5:20 elapsed, about 0:29 left",
        "82 % seen, 5:40 elapsed, about 0:09 left",
    ]


def test_nothing_done_yet_and_begun_again() -> None:
    console = Console(file=io.StringIO(), width=200)
    with ProgressLine(console, "runs") as line:
        for done in (0, 0, 1, 0, 2):
            line.advance(done, 2, done / 2)
    assert isinstance(console.file, io.StringIO)
    assert console.file.getvalue().startswith("2/2 runs")


def test_the_table_of_a_benchmark_fits_a_narrow_terminal(tmp_path: Path) -> None:
    save_plan(floorplan_from_ascii(TWO_ROOMS, name="hut"), tmp_path / "hut.geojson")
    words = ["--plans", str(tmp_path / "hut.geojson"), "--starts", "1", "--jobs", "1", "--agents", "nearest"]
    words += ["--agents", "cost-utility:alpha=0.3", "--out", str(tmp_path / "out")]
    for columns, last in ((50, "better"), (80, "reached 99 %")):
        printed = CliRunner().invoke(app, ["benchmark", *words], env={"COLUMNS": str(columns)}).output
        table = printed[printed.index("metres /") :].split("\n2 runs, ")[0].splitlines()
        assert max(map(len, table)) <= columns
        assert "cost-utility" in "\n".join(table) and any(line.endswith(last) for line in table)


@pytest.mark.parametrize(("columns", "parts"), [(32, 6), (60, 2), (200, 1)])
def test_a_narrow_terminal_shows_a_table_in_parts(
    columns: int, parts: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, value in {
        "COLUMNS": str(columns),
        "LINES": "40",
        "TTY_COMPATIBLE": "1",
        "TERM": "dumb",
    }.items():
        monkeypatch.setenv(name, value)
    heads = ["set", "method", *(f"measure {k}" for k in range(6))]
    rows = [["maps", f"method {row}", *(f"{k}{row}.123±4" for k in range(6))] for row in ("a", "b")]
    print_table(heads, rows, keys=2)
    shown = capsys.readouterr().out
    assert "…" not in shown and all(len(line) <= columns for line in shown.splitlines())
    assert all(f"{k}{row}.123±4" in shown for k in range(6) for row in "ab")
    assert shown.count("method a") == parts
