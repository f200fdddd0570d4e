"""Worker processes: none outlives its benchmark, one that dies costs its task alone."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from layoutexplore.benchmark import pool
from layoutexplore.benchmark.pool import Handout, Limited, run_all
from tests.programs import said_by, wherever_it_comes_from


def test_workers_end_with_a_killed_benchmark() -> None:
    code = """
import time
from layoutexplore.benchmark.pool import run_all
for _ in run_all(time.sleep, [0.0, 600.0, 600.0, 600.0], jobs=2, lost=str):
    print("one", flush=True)
"""
    command = [sys.executable, "-c", code]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        assert process.stdout and process.stdout.readline() == b"one\n"
        process.kill()
        process.communicate(timeout=120)  # it ends when nobody holds the other end of the pipe any more


UNGUARDED = """
from layoutexplore.benchmark.pool import run_all
print(sorted(run_all(eval, ["1 + 1", "2 + 2"], jobs=2, lost=lambda task: -1)))
"""


@wherever_it_comes_from
def test_a_program_needs_neither_a_file_nor_a_guard(from_stdin: bool, tmp_path: Path) -> None:
    """Workers do not import it: it could not be found, or would begin anew in each of them."""
    assert said_by(UNGUARDED, tmp_path, from_stdin=from_stdin) == "[2, 4]\n"


def test_a_dying_worker_costs_its_task_alone() -> None:
    tasks = ["1 + 1", "__import__('os')._exit(1)", "2 + 2", "3 + 3"]
    results = list(run_all(eval, tasks, jobs=2, lost=lambda task: f"lost {task[:6]}"))
    assert sorted(map(str, results)) == ["2", "4", "6", "lost __impo"]


def test_one_job_that_may_end_its_process_has_one_of_its_own() -> None:
    tasks = ["__import__('os')._exit(1)", "2 + 2"]
    found = run_all(eval, tasks, jobs=1, lost=lambda task: "lost", tries=1, apart=True)
    assert sorted(map(str, found)) == ["4", "lost"]


def test_a_task_whose_worker_dies_once_runs_again(tmp_path: Path) -> None:
    mark = str(tmp_path / "mark")
    tasks = [
        f"__import__('os').path.exists({mark!r}) or (open({mark!r}, 'w').close(), __import__('os')._exit(1))"
    ]
    results = list(run_all(eval, [*tasks, "1", "2"], jobs=2, lost=lambda task: "lost"))
    assert sorted(map(str, results)) == ["1", "2", "True"]


def test_a_task_that_takes_too_long_or_too_much_ends() -> None:
    def busy(seconds: float) -> str:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            with contextlib.suppress(Exception):
                time.sleep(0.01)
        return "done"

    limited = Limited(busy, lambda task: "late", seconds=0.3)
    assert [limited(t) for t in (0.0, 60.0, 0.01)] == ["done", "late", "done"]
    if Path("/proc/self/statm").exists():
        small = Limited(lambda size: np.ones(size, np.uint8).sum(), lambda task: 0, megabytes=200.0)
        with pytest.raises(MemoryError):
            small(2**30)
        assert small(10) == 10


def test_a_preparation_without_end_ends_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pool, "PREPARING", 0.1)
    begun: list[str] = []

    def endless(task: str) -> None:
        begun.append(task)
        while True:
            time.sleep(0.01)

    limited = Limited(str, lambda task: "late", seconds=30.0, prepare=begun.append)
    assert limited("first") == "first" and begun == ["first"]
    limited = Limited(str, lambda task: "late", seconds=0.2, prepare=endless)
    assert limited("second") == "second" and begun == ["first", "second"]


def test_a_swallowed_end_of_time_does_not_wait_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a finalizer is hit by is only printed: the task goes on, and is told again or ends by itself."""
    monkeypatch.setattr(pool, "AGAIN", 0.05)

    def swallowing(times: int) -> str:
        while times:
            try:
                while True:
                    time.sleep(0.001)
            except pool.CellTimeoutError:
                times -= 1
        return "done"

    limited = Limited(swallowing, lambda task: "late", seconds=0.02)
    assert [limited(times) for times in (1, 3)] == ["late", "late"]
    monkeypatch.undo()
    assert limited(1) == "late"


TRACED = """
import sys, time
from layoutexplore.benchmark.pool import Limited

def work(seconds):
    time.sleep(seconds)
    return seconds

limited = Limited(work, seconds={limit}, late=lambda task: "late")
print([limited(0.0), limited({task})])

def step():
    return 1

sys.settrace(lambda *_: None)
print(step())
"""


@pytest.mark.parametrize(("limit", "task", "last"), [(60.0, 0.0, "0.0"), (0.05, 0.2, "'late'")])
def test_a_process_can_be_traced_after_a_limited_task(limit: float, task: float, last: str) -> None:
    code = TRACED.format(limit=limit, task=task)
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30)
    assert ended.stdout.splitlines() == [f"[0.0, {last}]", "1"], ended.stderr


def test_a_task_that_ends_as_its_time_does() -> None:
    """Whoever wins, the outcome is one of the two, and nothing is raised after it."""
    rng = np.random.default_rng(0)

    def busy(seconds: float) -> str:
        end = time.perf_counter() + seconds
        while time.perf_counter() < end:
            pass
        return "done"

    for _ in range(100):
        seconds = rng.uniform(0.006, 0.012)
        assert Limited(busy, lambda task: "late", seconds=seconds)(rng.uniform(0, 2 * seconds)) in (
            "done",
            "late",
        )


def test_short_tasks_go_out_several_at_a_time() -> None:
    handout = Handout(range(10_000), 2)
    sizes = []
    while handout:
        batch = handout.batch()
        sizes.append(len(batch))
        handout.learn((batch, 1e-4 * len(batch)))
    assert sizes[0] == 1 and max(sizes) == 1000 and sizes[-1] == 1 and sum(sizes) == 10_000
