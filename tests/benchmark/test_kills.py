"""A benchmark that is killed again and again comes to the results of one that is left alone."""

from __future__ import annotations

import contextlib
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest

from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.processes import descendants
from tests.benchmark.cases import timeless

BENCHMARK = (
    *("--plans", "office-01", "--plans", "apartment-01", "--starts", "10", "--seed", "3"),
    *("--agents", "nearest", "--agents", "random", "--no-explain", "--jobs", "2"),
)
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
GONE = {"local": 20.0, "dask": 20.0, "ray": 90.0}
"""Seconds until nothing is left of a driver that was killed: Ray's agents look for theirs once a minute."""
KILLS = int(os.environ.get("LAYOUTEXPLORE_KILLS", "34"))


def started(out: Path, cluster: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "layoutexplore", "benchmark", *BENCHMARK, "--out", str(out)]
    command += ["--cluster", cluster] * (cluster != "local")
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def working(below: list[int]) -> list[int]:
    """Those of the processes that make runs: no trackers, nannies and servers."""
    found = []
    for process in below:
        try:
            command = Path(f"/proc/{process}/cmdline").read_bytes().replace(b"\0", b" ")
            ticks = sum(map(int, Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[11:13]))
        except OSError:
            continue
        makes_runs = b"ray::" in command or b"spawn_main" in command or b"forkserver" in command
        if makes_runs and ticks > os.sysconf("SC_CLK_TCK"):  # a second of computing: it is at work
            found.append(process)
    return found


def wait_for_work(process: subprocess.Popen[bytes], out: Path, rng: random.Random) -> None:
    """Until a random number of further runs is done, and a random moment within the next one."""
    table, further = out / "results.csv", rng.randrange(4)
    size = table.stat().st_size if table.exists() else 0
    end = time.monotonic() + 60
    while process.poll() is None and time.monotonic() < end:
        there = table.stat().st_size if table.exists() else 0
        if there > size:
            size, further = there, further - 1
        if further < 0 and working(descendants(process.pid)):
            break
        time.sleep(0.02)
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(rng.uniform(0.0, 0.3))


def killed(process: subprocess.Popen[bytes], out: Path, rng: random.Random, cluster: str) -> str:
    """Send a signal to the driver or to one of its processes; what was done, empty when it was over."""
    whom, number = rng.choices(("worker", "other", "driver"), (7, 1, 2))[0], rng.choice(SIGNALS)
    if whom == "driver" and rng.random() < 0.5:
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(rng.uniform(0.0, 8.0))  # while it is loaded, too
    else:
        wait_for_work(process, out, rng)
    if process.poll() is not None:
        return ""
    below = descendants(process.pid)
    victims = working(below) if whom == "worker" else below if whom == "other" else [process.pid]
    victim = rng.choice(victims or [process.pid])
    try:
        os.kill(victim, number)
    except ProcessLookupError:
        return ""
    if victim == process.pid:
        process.wait(60)
        end = time.monotonic() + GONE[cluster]
        while time.monotonic() < end and any(Path(f"/proc/{k}/exe").exists() for k in below):
            time.sleep(0.2)
        assert not [k for k in below if Path(f"/proc/{k}/exe").exists()]
        return f"driver {number.name}"
    return f"{whom} {number.name}"


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are found in /proc")
@pytest.mark.parametrize("cluster", ["local", "dask", "ray"])
def test_every_cell_once_and_as_if_undisturbed(cluster: str, tmp_path: Path) -> None:
    if cluster != "local":
        pytest.importorskip({"dask": "distributed"}.get(cluster, cluster))
    rng, done = random.Random(0), Counter[str]()
    assert started(tmp_path / "whole", "local").wait() == 0
    whole = ResultsFolder(tmp_path / "whole").rows()
    round_ = 0
    while done.total() < KILLS:
        out = tmp_path / f"killed-{round_}"
        end = time.monotonic() + 300
        while done.total() < KILLS and time.monotonic() < end:
            process = started(out, cluster)
            while process.poll() is None and done.total() < KILLS:
                done.update(filter(None, [killed(process, out, rng, cluster)]))
            process.wait(300)
            if process.returncode == 0:
                break
        last = started(out, cluster)
        assert last.wait(600) == 0
        rows = ResultsFolder(out).rows()
        assert len({row.key for row in rows}) == len(rows) == len(whole)
        assert timeless(rows) == timeless(whole)
        round_ += 1
    print(cluster, dict(done))
