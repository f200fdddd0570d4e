"""The list of kernels: several processes compile what it names, in any order."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterable
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import types

from layoutexplore.benchmark.config import QUICK_AGENTS, BenchmarkConfig
from layoutexplore.benchmark.runner import run_benchmark, uses_of
from layoutexplore.cli.warm_up import warm_up_steps
from layoutexplore.grids.grid import Pose
from layoutexplore.processes import kernel_list
from layoutexplore.processes.kernel_list import Kernel, is_kept, listed_kernels, meant, resolved, spelled
from layoutexplore.simulation.config import SimulationConfig

AGAIN = "made anew by: from layoutexplore.cli.warm_up import record; record()"

numbers = st.sampled_from([types.int64, types.uint8, types.float32, types.boolean])
arrays = st.builds(types.Array, numbers, st.integers(1, 4), st.sampled_from("CFA"), readonly=st.booleans())
plain = numbers | arrays
tuples = st.recursive(
    plain, lambda parts: st.lists(parts, min_size=1, max_size=3).map(types.BaseTuple.from_types)
)
poses = st.tuples(plain, plain, plain).map(lambda parts: types.BaseTuple.from_types(parts, Pose))


@given(tuples | poses)
def test_types_are_read_as_they_were_written(kind: types.Type) -> None:
    assert meant(spelled(kind)) == kind


@pytest.mark.parametrize("kind", [types.literal(3), types.none, types.unicode_type, types.List(types.int64)])
def test_other_types_are_not_written(kind: types.Type) -> None:
    with pytest.raises(TypeError):
        spelled(kind)


def test_all_that_is_listed_is_there() -> None:
    uses = [name for name, _ in warm_up_steps()]
    kernels = listed_kernels(uses)
    assert len(kernels) > 300
    for kernel in kernels:
        function, arguments = resolved(kernel)
        assert len(arguments) == function.py_func.__code__.co_argcount
    for use in uses:
        assert listed_kernels([use]), f"{use} is not in the list: {AGAIN}"
    assert not listed_kernels(["flying"])


@pytest.mark.parametrize("predicts", [False, True])
def test_what_a_benchmark_asks_for_is_listed(predicts: bool) -> None:
    names = [name for name, _ in warm_up_steps()]
    config = BenchmarkConfig(plans=("apartment-01",), agents=(*QUICK_AGENTS, "layout-tour:rate=1"))
    assert uses_of(config, predicts) <= set(names)
    assert ("a whole exploration" in uses_of(config, predicts)) == predicts


@pytest.mark.parametrize(("resolution", "more"), [(0.01, [["a large map"]]), (0.1, [[]])])
def test_a_benchmark_of_a_large_plan_asks_for_more(
    resolution: float, more: list[list[str]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    class StopError(Exception):
        pass

    def note(uses: Iterable[str]) -> list[Kernel]:
        asked.append(sorted(uses))
        if len(asked) > 1:
            raise StopError
        return []

    asked: list[list[str]] = []
    monkeypatch.setattr(kernel_list, "missing_kernels", note)
    settings = SimulationConfig(resolution=resolution)
    config = BenchmarkConfig(plans=("apartment-01",), agents=("nearest",), simulation=settings)
    with pytest.raises(StopError):
        run_benchmark(config, tmp_path / "out", jobs=2)
    assert asked[1:] == more and "a floor plan" in asked[0]


def test_a_worker_that_dies_ends_the_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    class Dying(Future[None]):
        def result(self, timeout: float | None = None) -> None:
            raise BrokenProcessPool

    def submit(*arguments: object) -> Dying:
        future = Dying()
        future.set_result(None)
        return future

    monkeypatch.setattr(kernel_list, "start_pool", lambda *arguments: SimpleNamespace(submit=submit))
    monkeypatch.setattr(kernel_list, "stop_pool", lambda pool: None)
    told: list[tuple[int, int]] = []
    kernel_list.compile_kernels(
        listed_kernels(["a floor plan"]), 2, lambda done, total: told.append((done, total))
    )
    assert told == [(len(listed_kernels(["a floor plan"])),) * 2]


def _run(code: str, **environment: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.splitlines()


@pytest.mark.parametrize("use", ["agent layout-tour", "layout method rose2"])
def test_what_a_step_needs_is_listed(use: str) -> None:
    """In a program of its own: in this one, other tests have compiled kernels for other types."""
    code = f"""
from layoutexplore.cli.warm_up import warm_up_steps
from layoutexplore.processes.kernel_list import listed_kernels
from layoutexplore.processes.kernel_recording import used_kernels
steps = dict(warm_up_steps())
for kernel in used_kernels({use!r}, lambda name: steps[name]()) - set(listed_kernels([{use!r}])):
    print(*kernel)
"""
    assert not _run(code), AGAIN


def test_processes_compile_what_is_missing(tmp_path: Path) -> None:
    code = """
from layoutexplore.processes.kernel_list import compile_kernels, listed_kernels, missing_kernels
uses = ["layout method distance"]
missing = missing_kernels(uses)
print(len(missing), len(listed_kernels(uses)))
compile_kernels(missing, 2, print)
print(len(missing_kernels(uses)))
compile_kernels([], 2, print)
"""
    first, *told, last = _run(code, NUMBA_CACHE_DIR=str(tmp_path))
    total = int(first.split()[1])
    assert first == f"{total} {total}" and last == "0"
    assert told == [f"{done} {total}" for done in range(1, total + 1)]


@pytest.mark.parametrize("error", [OSError, EOFError, BrokenProcessPool, AssertionError])
def test_without_workers_nothing_is_compiled_before(
    error: type[Exception], monkeypatch: pytest.MonkeyPatch
) -> None:
    def start_pool(*arguments: object) -> None:
        raise error

    monkeypatch.setattr(kernel_list, "start_pool", start_pool)
    told: list[int] = []
    kernel_list.compile_kernels(listed_kernels(["agent nearest"]), 2, lambda done, total: told.append(done))
    assert not told


def test_a_list_that_is_older_than_the_program_does_no_harm() -> None:
    [kernel, *_] = listed_kernels(["agent nearest"])
    gone: list[Any] = [
        kernel._replace(name="layoutexplore.grids.rays:gone"),
        kernel._replace(name="gone:gone"),
    ]
    assert all(map(is_kept, gone))
