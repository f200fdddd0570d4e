"""Where nothing can be written, or the disk is full: one line, status 2, and what was there is whole."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from layoutexplore import cli
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.errors import ConfigError, ResultsError
from layoutexplore.files import check_places
from layoutexplore.files.locking import held
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.tracing import floorplan_from_ascii
from tests.benchmark.cases import timeless
from tests.cli.test_cli import run as run_cli
from tests.maps.test_painted_rooms import paint

BENCHMARK = (
    *("benchmark", "--plans", "apartment-01", "--starts", "2", "--agents", "nearest", "--agents", "random"),
    *("--no-explain", "--jobs", "1", "--out", "{out}/b"),
)
TRAINING = ("--plans", "apartment-01", "--predictor", "none", "--out", "{out}/t")
COMMANDS = {
    "benchmark": BENCHMARK,
    "train": ("train", "--algorithm", "maskable-ppo", "--envs", "2", "--steps", "400", *TRAINING),
    "search": ("train", "--algorithm", "tour-search", "--steps", "20", *TRAINING),
    "explore": ("explore", "apartment-01", "--out", "{out}/e"),
    "film": ("explore", "apartment-01", "--video", "{out}/e.gif"),
    "state": ("explore", "apartment-01", "--save-state", "{out}/e.npz", "--pause-after", "5"),
    "robustness": ("evaluate", "robustness", "apartment:3", "--jobs", "1", "--out", "{out}/r"),
    "partial-rooms": ("evaluate", "partial-rooms", "apartment:3", "-p", "hull", "--snapshots", "{out}/s"),
    "in-the-loop": ("evaluate", "in-the-loop", "apartment:3", "-p", "hull", "--out", "{out}/l"),
    "train-predictor": ("evaluate", "train-predictor", "apartment-01", "--out", "{out}/p"),
}
"""Commands that write, by name; {out} is where."""

NOWHERE = Path("/proc/self")
"""A folder in which nobody can make anything, root included."""


def arguments(name: str, out: Path) -> list[str]:
    return [part.replace("{out}", str(out)) for part in COMMANDS[name]]


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("place", ["a file", "no permission"])
def test_a_place_that_takes_nothing_is_told_before_anything_runs(
    name: str, place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if name in ("train", "search", "train-predictor"):
        pytest.importorskip("sb3_contrib")
    if place == "no permission" and not NOWHERE.is_dir():
        pytest.skip("there is no such folder here")
    (tmp_path / "file").write_text("mine")
    out = tmp_path / "file" if place == "a file" else NOWHERE
    assert run_cli(monkeypatch, *arguments(name, out)) == 2
    told = capsys.readouterr().err.strip()
    assert told.startswith("layoutexplore: ") and str(out) in told and "\n" not in told
    assert (tmp_path / "file").read_text() == "mine"


def test_places_are_named_by_their_options(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for option, call in (
        ("--out", lambda path: check_places(path)),
        ("--json", lambda path: check_places(None, path / "a.json")),
        ("--save-state", lambda path: check_places(None, path / "a.npz", file="--save-state")),
        ("--store", lambda path: check_places(None, store=path)),
    ):
        with pytest.raises(ConfigError, match=f"is a file: {option} "):
            call(tmp_path / "file" / "x")
        call(tmp_path / "new" / "x")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_json_file_is_named_like_one(tmp_path: Path) -> None:
    check_places(None, tmp_path / "numbers.JSON")
    check_places(None, Path("/dev/null"))
    with pytest.raises(ConfigError, match=r"numbers\.csv: --json must name a file that ends with \.json"):
        check_places(None, tmp_path / "numbers.csv")


def test_a_link_that_leads_nowhere_is_no_place(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    for name in ("link", "loop", "loop/x"):
        with pytest.raises(ConfigError, match="leads nowhere"):
            check_places(tmp_path / name)


def test_names_that_are_no_text_are_printed(tmp_path: Path) -> None:
    """A name of bytes that are no characters, and one that looks like a colour, end no command."""
    for name in (b"\xff", b"[red]x[/b]"):
        out = os.fsencode(tmp_path) + b"/" + name + b".geojson"
        command = [sys.executable, "-m", "layoutexplore", "maps", "generate", "apartment", "--out", out]
        told = subprocess.run(command, capture_output=True, check=False, timeout=300)
        assert told.returncode == 0 and b".geojson" in told.stdout, told.stderr


LIMITED = """
import resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv.pop(1)), -1))
from layoutexplore.__main__ import start
start()
"""
"""The command where no file can grow beyond so many bytes: writing fails as it does on a full disk."""


def limited(size: int, *words: str) -> tuple[int, str]:
    """Exit status and error output."""
    command = [sys.executable, "-c", LIMITED, str(size), *words]
    told = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    return told.returncode, told.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="files are limited as Linux does")
def test_a_file_that_cannot_grow_ends_a_benchmark_that_can_go_on(tmp_path: Path) -> None:
    command = arguments("benchmark", tmp_path)
    status, errors = limited(3000, *command)
    assert status == 2 and "cannot write" in errors and "Traceback" not in errors, errors
    assert not list(tmp_path.rglob("*.part"))
    before = ResultsFolder(tmp_path / "b").rows() if (tmp_path / "b" / "results.csv").exists() else []
    assert CliRunner().invoke(cli.app, command).exit_code == 0
    rows = ResultsFolder(tmp_path / "b").rows()
    assert len(rows) == 4 and timeless(rows)[: len(before)] == timeless(before)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 1.5 MB; only root can make one."""
    disk = tmp_path / "disk"
    disk.mkdir()
    made = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=1500k", "tmpfs", str(disk)], capture_output=True, check=False
    )
    if made.returncode:
        pytest.skip("this user cannot mount a disk")
    yield disk
    subprocess.run(["umount", str(disk)], check=True)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="a tmpfs is a small disk")
@pytest.mark.parametrize("free", [0, 10_000, 60_000, 200_000])
@pytest.mark.parametrize("name", COMMANDS)
def test_a_full_disk(name: str, free: int, small_disk: Path) -> None:
    """One line and status 2, or all is done; nothing half-written stays, and with room it goes on."""
    (small_disk / "fill").write_bytes(b"x" * (1_530_000 - free))
    command = [sys.executable, "-m", "layoutexplore", *arguments(name, small_disk)]
    told = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    # imageio closes a film that failed once more when it is collected, and Python tells that.
    assert told.returncode in (0, 2) and (name == "film" or "Traceback" not in told.stderr), told.stderr
    assert told.returncode == 0 or "layoutexplore: " in told.stderr
    assert not list(small_disk.rglob("*.part"))
    (small_disk / "fill").unlink()
    if name in ("benchmark", "robustness"):
        again = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
        assert again.returncode in (0, 2) and "Traceback" not in again.stderr, again.stderr


def test_documentation_is_not_built_into_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("mine")
    assert run_cli(monkeypatch, "docs", "--out", str(tmp_path / "file")) == 2
    assert "cannot name a folder" in capsys.readouterr().err


def test_a_folder_whose_name_is_no_text_is_gone_on_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A name in Latin-1, or any umlaut in a process without UTF-8."""
    plan, out = tmp_path / "closet.geojson", tmp_path / os.fsdecode(b"r\xe4um")
    save_plan(floorplan_from_ascii("#####\n#...#\n#...#\n#####", 0.5, name="closet"), plan)
    words = ("--plans", str(plan), "--starts", "1", "--agents", "nearest", "--jobs", "1", "--out", str(out))
    for _ in range(2):
        assert run_cli(monkeypatch, "benchmark", *words) == 0
    assert r"r\udce4um" in ResultsFolder(out).manifest()["command"]


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a folder in use stays")
def test_a_folder_that_is_gone_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """That in which the command is given: somebody else, or a script, has removed it."""
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    assert run_cli(monkeypatch, "benchmark", "--plans", "office-01", "--out", str(tmp_path / "b")) == 2
    assert "is no longer there: go into another" in capsys.readouterr().err


STUDIES = {
    "registration": ("apartment:3",),
    "partial-rooms": ("apartment:3", "-p", "hull"),
    "train-predictor": ("apartment:3", "--no-network"),
    "segmentation": ("{out}",),
    "clutter": ("{out}/flat.png",),
}
"""Studies with what they are made from; {out} is a folder with a map and its rooms."""


@pytest.mark.parametrize("name", STUDIES)
def test_a_second_study_of_a_folder_is_refused(name: str, tmp_path: Path) -> None:
    paint(tmp_path, "flat", 40)
    given = [part.replace("{out}", str(tmp_path)) for part in STUDIES[name]]
    with held(tmp_path / "out", "study"):
        second = CliRunner().invoke(cli.app, ["evaluate", name, *given, "--out", str(tmp_path / "out")])
    assert isinstance(second.exception, ResultsError) and "another study is writing" in str(second.exception)
    assert not (tmp_path / "out").exists()
