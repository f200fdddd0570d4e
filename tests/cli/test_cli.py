"""The command line: help, errors in one line, the commands from end to end."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
import typer
from typer.testing import CliRunner

import layoutexplore
from layoutexplore import cli
from layoutexplore.cli.explore import parse_start
from layoutexplore.cli.progress import ProgressLine, clock
from layoutexplore.errors import ConfigError
from layoutexplore.grids.ros_map import load_grid
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.tracing import floorplan_from_ascii
from tests.plans import TWO_ROOMS

RUNNER = CliRunner(env={"COLUMNS": "120", "TERM": "dumb"})


def leaves(
    command: typer.core.TyperGroup | typer.core.TyperCommand, path: tuple[str, ...] = ()
) -> list[tuple[str, ...]]:
    """Paths of all commands without sub-commands."""
    inner = getattr(command, "commands", None)
    return (
        [path]
        if inner is None
        else [leaf for name, sub in inner.items() for leaf in leaves(sub, (*path, name))]
    )


COMMANDS = leaves(typer.main.get_command(cli.app))


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("plans") / "hut.geojson"
    save_plan(floorplan_from_ascii(TWO_ROOMS, name="hut"), path)
    return path


def run(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    """Exit status of `layoutexplore ARGUMENTS`, through its entry point."""
    monkeypatch.setattr(sys, "argv", ["layoutexplore", *arguments])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    return int(stopped.value.code or 0)


def test_own_code_that_exits_is_told_as_what_fails_in_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """An exploration that has no end is no success, whatever the status that own code gives."""
    (tmp_path / "mine.py").write_text(
        "import sys\nclass Leaves:\n"
        "    def reset(self, seed): ...\n    def act(self, decision): sys.exit(0)\n"
        "    def rooms(self, decision): sys.exit(0)\n"
    )
    own = f"{tmp_path / 'mine.py'}:Leaves"
    assert run(monkeypatch, "explore", "apartment-01", "--agent", own) == 1
    told = capsys.readouterr().err
    assert (
        "line 4, in act" in told and f"SystemExit: 0\n(agent '{own}', decision 0 on 'apartment-01')" in told
    )
    agent = f"layout-tour:predictor={own}"
    assert run(monkeypatch, "explore", "apartment-01", "--agent", agent) == 1
    assert "line 5, in rooms" in capsys.readouterr().err


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_every_help_has_an_example(command: tuple[str, ...]) -> None:
    result = RUNNER.invoke(cli.app, [*command, "--help"])
    assert result.exit_code == 0
    assert "Example" in result.output and f"layoutexplore {' '.join(command)}" in result.output


def test_the_first_words() -> None:
    assert {("benchmark",), ("report",), ("explore",)} <= set(COMMANDS)
    assert RUNNER.invoke(cli.app, ["--version"]).output == f"layoutexplore {layoutexplore.__version__}\n"
    assert "benchmark" in RUNNER.invoke(cli.app, ["--help"]).output


def test_help_loads_nothing_heavy() -> None:
    heavy = ("torch", "matplotlib", "pandas", "sklearn", "jinja2", "numba", "cv2", "imageio")
    code = f"import sys, layoutexplore.cli; print([m for m in {heavy!r} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["benchmark", "--plans", "atlantis"], "unknown plan 'atlantis'"),
        (["benchmark", "--agents", "nearst"], "did you mean 'nearest'"),
        (["benchmark", "--sensor", "stge"], "did you mean 'stage'"),
        (["benchmark", "--starts", "0"], "starts must be a whole number from 1 to 10000"),
        (["benchmark", "--config", "none.toml"], "none.toml: cannot read the configuration"),
        (["report", "nowhere"], "nowhere holds no benchmark"),
        (["replay", "nowhere"], "nowhere holds no benchmark"),
        (["explore", "PLAN", "--start", "1"], "--start needs X,Y or X,Y,THETA"),
        (["explore", "PLAN", "--start", "-5,0"], "start"),
        (["explore", "PLAN", "--agent", "tuor"], "did you mean 'tour'"),
        (["explore", "PLAN", "--sensor", "sonar"], "unknown sensor 'sonar'"),
        (["explore", "PLAN", "--video", "film.avi"], ".mp4 or .gif"),
        (["explore", "none.xml"], "none.xml"),
    ],
)
def test_mistakes_are_one_clear_line(
    arguments: list[str],
    said: str,
    plan: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(monkeypatch, *(str(plan) if a == "PLAN" else a for a in arguments)) == 2
    error = capsys.readouterr().err
    assert error.startswith("layoutexplore: ") and error.count("\n") == 1 and said in error
    assert not list(tmp_path.iterdir())


def test_an_option_that_does_not_exist(monkeypatch: pytest.MonkeyPatch) -> None:
    assert run(monkeypatch, "benchmark", "--plan", "x") == 2


def test_benchmark_and_report(
    plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    arguments = (
        "benchmark",
        "--plans",
        str(plan),
        "--agents",
        "nearest",
        "--agents",
        "tour",
        "--starts",
        "1",
        "--jobs",
        "1",
    )
    assert run(monkeypatch, *arguments) == 0
    said = capsys.readouterr().out
    assert "2/2 runs" in said and "metres / nearest's" in said and "tour" in said and "report.html" in said
    out = tmp_path / "benchmark-results"
    assert {
        "results.csv",
        "results.parquet",
        "report.html",
        "report.md",
        "run.toml",
        "runs",
        "plans",
        "summary.csv",
    } == {path.name for path in out.iterdir()}
    assert " ".join(arguments[:2]) in (out / "report.md").read_text()
    (out / "report.html").unlink()
    assert run(monkeypatch, "report", "--baseline", "tour") == 0
    assert "compared with tour" in (out / "report.html").read_text()
    assert run(monkeypatch, *arguments) == 0
    assert "2 of 2 runs are already in benchmark-results" in capsys.readouterr().out


def test_explore_films_and_saves(plan: Path, tmp_path: Path) -> None:
    film, out = tmp_path / "film.gif", tmp_path / "run"
    arguments = [
        "explore",
        str(plan),
        "--agent",
        "tour",
        "--start",
        "2,2,0.5",
        "--video",
        str(film),
        "--out",
        str(out),
    ]
    result = RUNNER.invoke(cli.app, arguments, catch_exceptions=False)
    assert result.exit_code == 0 and "coverage" in result.output and "rooms finished" in result.output
    assert film.stat().st_size > 1000
    grid = load_grid(out / "map.yaml")
    assert grid.free.any() and grid.occupied.any()
    track = np.loadtxt(out / "track.csv", delimiter=",", skiprows=1)
    curve = np.loadtxt(out / "curve.csv", delimiter=",", skiprows=1)
    assert track[0].tolist() == [2.0, 2.0, 0.5] and curve[-1, 1] >= 0.99
    assert (out / "curve.csv").read_text().splitlines()[1].endswith(",1")  # scans are counted, not measured
    pictures = sorted(out.glob("seen_*.png"))
    assert pictures[-1].name == "seen_100.png" and all(
        cv2.imread(str(path)).shape[2] == 3 for path in pictures
    )


def test_filming_changes_nothing(plan: Path, tmp_path: Path) -> None:
    for name, film in (("plain", []), ("filmed", ["--video", str(tmp_path / "film.gif")])):
        RUNNER.invoke(
            cli.app, ["explore", str(plan), "--out", str(tmp_path / name), *film], catch_exceptions=False
        )
    for name in ("track.csv", "curve.csv", "map.pgm"):
        assert (tmp_path / "plain" / name).read_bytes() == (tmp_path / "filmed" / name).read_bytes()


def test_explore_is_decided_by_its_seed(plan: Path) -> None:
    def lines(seed: str) -> list[str]:
        output = RUNNER.invoke(cli.app, ["explore", str(plan), "--agent", "random", "--seed", seed]).output
        return [line for line in output.splitlines() if line.startswith(("travelled", "scans", "seen"))]

    assert lines("1") == lines("1") != lines("2")


def test_starts_in_words() -> None:
    assert parse_start(None) is None
    assert parse_start("1,2") == (1.0, 2.0, 0.0)
    for text in ("", "1", "1,2,3,4", "a,b", "1,nan"):
        with pytest.raises(ConfigError, match="--start"):
            parse_start(text)


@pytest.mark.parametrize("terminal", [False, True])
def test_progress_is_told(terminal: bool) -> None:
    import io

    from rich.console import Console

    file = io.StringIO()
    with ProgressLine(Console(file=file, force_terminal=terminal, width=100), "runs") as line:
        line.say("reading")
        line.advance(1, 2, 0.5, "cottage")
        line.advance(2, 2, 1.0, "house")
    assert "reading" in file.getvalue() and "2/2 runs" in file.getvalue()
    assert clock(59.6) == "1:00" and clock(3600) == "1:00:00"
