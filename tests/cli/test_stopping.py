"""Ctrl-C and SIGTERM end every command at any moment, without a traceback, and no process is left."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from layoutexplore.benchmark.store import ResultsFolder

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
        (os.killpg if everywhere else os.kill)(process.pid, number)
        _, errors = process.communicate(timeout=60)
    time.sleep(0.2)
    assert in_session(process.pid) == []
    return process.returncode, errors


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are counted in /proc")
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
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are counted in /proc")
@pytest.mark.parametrize("after", [0.6, 0.8, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 9.0])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_at_any_moment(jobs: str, number: int, after: float, tmp_path: Path) -> None:
    out = tmp_path / "out"
    status, errors = stopped((*BENCHMARK, "--jobs", jobs, "--out", str(out)), number, after, everywhere=True)
    assert status in (0, 128 + number) and "Traceback" not in errors
    if (out / "results.csv").exists():
        assert not any(row.error for row in ResultsFolder(out).finished())
