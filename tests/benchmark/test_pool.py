"""Worker processes: none outlives its benchmark, one that dies costs its task alone."""

from __future__ import annotations

import subprocess
import sys

from layoutexplore.benchmark.pool import run_all


def test_workers_end_with_a_killed_benchmark() -> None:
    code = """
import time
from layoutexplore.benchmark.pool import run_all
for _ in run_all(time.sleep, [0.0, 600.0, 600.0, 600.0], jobs=2, lost=str, initializer=int):
    print("one", flush=True)
"""
    command = [sys.executable, "-c", code]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        assert process.stdout and process.stdout.readline() == b"one\n"
        process.kill()
        process.communicate(timeout=120)  # it ends when nobody holds the other end of the pipe any more


def test_a_dying_worker_costs_its_task_alone() -> None:
    tasks = ["1 + 1", "__import__('os')._exit(1)", "2 + 2", "3 + 3"]
    results = list(run_all(eval, tasks, jobs=2, lost=lambda task: f"lost {task[:6]}", initializer=int))
    assert sorted(map(str, results)) == ["2", "4", "6", "lost __impo"]
