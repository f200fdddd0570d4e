"""A benchmark that is killed again and again comes to the results of one that is left alone."""

from __future__ import annotations

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
    *("--plans", "office-01", "--plans", "apartment-01", "--starts", "6", "--seed", "3"),
    *("--agents", "nearest", "--agents", "random", "--no-explain", "--jobs", "2"),
)
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
KILLS = int(os.environ.get("LAYOUTEXPLORE_KILLS", "34"))


def started(out: Path, cluster: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "layoutexplore", "benchmark", *BENCHMARK, "--out", str(out)]
    command += ["--cluster", cluster] * (cluster != "local")
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def killed(process: subprocess.Popen[bytes], rng: random.Random) -> str:
    """Send a signal to the driver or to one of its workers at a random moment; what was done."""
    whom, number = rng.choice(("driver", "worker")), rng.choice(SIGNALS)
    while whom == "worker" and process.poll() is None and len(descendants(process.pid)) < 2:
        time.sleep(0.2)
    try:
        process.wait(rng.uniform(1.0, 15.0))
        return ""
    except subprocess.TimeoutExpired:
        below = descendants(process.pid)
    victim = process.pid if whom == "driver" or not below else rng.choice(below)
    try:
        os.kill(victim, number)
    except ProcessLookupError:
        return ""
    if victim == process.pid:
        process.wait(60)
        end = time.monotonic() + 20
        while time.monotonic() < end and any(Path(f"/proc/{k}/exe").exists() for k in below):
            time.sleep(0.2)
        assert not [k for k in below if Path(f"/proc/{k}/exe").exists()]
    return f"{'driver' if victim == process.pid else 'worker'} {number.name}"


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
        for _ in range(6):
            process = started(out, cluster)
            while process.poll() is None:
                if (what := killed(process, rng)) and done.total() < KILLS:
                    done[what] += 1
        last = started(out, cluster)
        assert last.wait() == 0
        rows = ResultsFolder(out).rows()
        assert len({row.key for row in rows}) == len(rows) == len(whole)
        assert timeless(rows) == timeless(whole)
        round_ += 1
    print(cluster, dict(done))
