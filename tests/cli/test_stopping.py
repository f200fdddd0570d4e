"""Ctrl-C and SIGTERM end every command at any moment within seconds, no traceback, no process left."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from layoutexplore.benchmark.store import ResultsFolder

SLACK = 1.0
"""Seconds more than the five that a command has to end: other tests run on the same machine."""

BENCHMARK = (
    "benchmark",
    "--plans",
    "office-01",
    "--plans",
    "office-02",
    "--agents",
    "nearest",
    "--starts",
    "8",
)


APARTMENTS = ("apartment:3", "apartment:4", "apartment:5")
TRAINING = ("--plans", "apartment-01", "--predictor", "none", "--steps", "100000", "--out", "{out}")
COMMANDS = {
    "benchmark": (*BENCHMARK, "--jobs", "2", "--out", "{out}"),
    "explore": ("explore", "school-05", "--agent", "layout-tour", "--out", "{out}"),
    "train": ("train", "--algorithm", "maskable-ppo", "--envs", "2", *TRAINING),
    "search": ("train", "--algorithm", "tour-search", *TRAINING),
    "robustness": ("evaluate", "robustness", *APARTMENTS, "--jobs", "2", "--out", "{out}"),
    "in-the-loop": ("evaluate", "in-the-loop", *APARTMENTS, "--jobs", "2", "--out", "{out}"),
    "partial-rooms": ("evaluate", "partial-rooms", *APARTMENTS, "-p", "hull", "--snapshots", "{out}"),
    "train-predictor": ("evaluate", "train-predictor", *APARTMENTS, "--out", "{out}"),
}
"""Commands that take long, by name; {out} is where they write."""

IN_PROC = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are counted in /proc")


def in_session(session: int) -> list[int]:
    """Processes of a session that are no zombies."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == session and fields[0] != "Z":
            found.append(int(stat.parent.name))
    return found


def stopped(arguments: tuple[str, ...], number: int, after: float, *, everywhere: bool) -> tuple[int, str]:
    """Exit status and error output of a command that gets a signal after so many seconds.

    `everywhere`: all processes that it has started get it, as from a terminal.
    """
    command = [sys.executable, "-m", "layoutexplore", *arguments]
    with subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True, text=True
    ) as process:
        time.sleep(after)
        began = time.monotonic()
        (os.killpg if everywhere else os.kill)(process.pid, number)
        _, errors = process.communicate(timeout=60)
    assert time.monotonic() - began < 5.0 + SLACK
    time.sleep(0.2)
    assert in_session(process.pid) == []
    return process.returncode, errors


@IN_PROC
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_benchmark(number: int, tmp_path: Path) -> None:
    status, errors = stopped(
        (*BENCHMARK, "--jobs", "2", "--out", str(tmp_path / "out")),
        number,
        2.5,
        everywhere=number == signal.SIGINT,
    )
    assert status == 128 + number and "Traceback" not in errors


@pytest.mark.slow
@IN_PROC
@pytest.mark.parametrize("after", [0.6, 0.8, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 9.0])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_at_any_moment(jobs: str, number: int, after: float, tmp_path: Path) -> None:
    out = tmp_path / "out"
    status, errors = stopped((*BENCHMARK, "--jobs", jobs, "--out", str(out)), number, after, everywhere=True)
    assert status in (0, 128 + number) and "Traceback" not in errors
    if (out / "results.csv").exists():
        assert not any(row.error for row in ResultsFolder(out).finished())


@IN_PROC
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_command_that_is_being_loaded(number: int) -> None:
    """From the package's first line on; before that Python answers by itself."""
    command = [sys.executable, "-m", "layoutexplore", "speed", "--only", "noise"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        end = time.monotonic() + 30
        while time.monotonic() < end and "numpy" not in Path(f"/proc/{process.pid}/maps").read_text():
            time.sleep(0.005)
        process.send_signal(number)
        _, errors = process.communicate(timeout=60)
    assert process.returncode == 128 + number and not errors


def test_a_program_that_imports_the_package_keeps_its_handlers() -> None:
    code = "import signal; before = signal.getsignal(2), signal.getsignal(15); import layoutexplore; "
    code += "assert before == (signal.getsignal(2), signal.getsignal(15))"
    assert subprocess.run([sys.executable, "-c", code], check=False, timeout=60).returncode == 0


@pytest.mark.slow
@IN_PROC
@pytest.mark.parametrize("after", [0.1, 0.15, 0.2, 0.3, 0.4, 0.6, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_at_any_moment(name: str, number: int, after: float, tmp_path: Path) -> None:
    out = tmp_path / "out"
    command = tuple(part.replace("{out}", str(out)) for part in COMMANDS[name])
    status, errors = stopped(command, number, after, everywhere=number == signal.SIGINT)
    # Done before, done while Python ended (which then ends as the signal says), or stopped.
    assert status in (0, -number, 128 + number) and "Traceback" not in errors, errors
    if name in ("train", "search") and (out / "config.toml").exists():
        rows = out / "explorations.csv"
        assert name == "train" or not rows.exists() or rows.read_text().endswith("\n")
        again = subprocess.run(
            [sys.executable, "-m", "layoutexplore", "train", "--out", str(out), "--resume", "--steps", "1"],
            capture_output=True, text=True, check=False, timeout=300,
        )  # fmt: skip
        assert "Traceback" not in again.stderr, again.stderr
