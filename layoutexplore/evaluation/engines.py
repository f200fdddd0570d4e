"""What a benchmark costs beside its runs: rows a second by each engine, and what a second process adds."""

from __future__ import annotations

import dataclasses
import tempfile
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from layoutexplore.benchmark.cluster import run_on_cluster
from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.pool import run_all
from layoutexplore.benchmark.rows import Row
from layoutexplore.benchmark.runner import BenchmarkProgress, BenchmarkWatcher, run_benchmark
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.errors import checks_arguments
from layoutexplore.processes import peak_memory, usable_cores
from layoutexplore.speed.measurement import SpeedRow

CELLS = 400_000
"""Empty cells that each engine brings back."""

JOBS = 2

STARTS = 60
"""Runs of the benchmark that is made by one process and by `JOBS`."""

_ENGINES = {"": "local processes", "dask": "Dask", "ray": "Ray"}

_NUMBERS = tuple(field.name for field in dataclasses.fields(Row) if field.type == "float")

_MODULES = {"": "layoutexplore", "dask": "distributed", "ray": "ray"}


def engines() -> Iterator[SpeedRow]:
    """Empty cells by each engine that is installed, into a table; then a small benchmark by two processes."""
    for cluster, name in _ENGINES.items():
        if find_spec(_MODULES[cluster]):
            rate, seconds, megabytes = empty_cells(cluster, CELLS)
            yield SpeedRow(
                name=f"{CELLS} empty cells, {name}",
                ours=rate,
                unit="rows/s",
                goal=">= 5 000 rows/s",
                reached=rate / 5000.0,
                note=f"{seconds:.0f} s in all, workers started; {megabytes:.0f} MB in the caller",
            )
    alone, shared = (run_seconds(jobs, STARTS) for jobs in (1, JOBS))
    efficiency = alone / (JOBS * shared)
    yield SpeedRow(
        name=f"efficiency of {JOBS} processes",
        ours=efficiency,
        unit="",
        goal=f">= 0.8 on {JOBS} cores",
        reached=efficiency / 0.8 if usable_cores() >= JOBS else None,
        note=f"{1e3 * alone:.0f} ms a run with one process, {1e3 * shared:.0f} ms with {JOBS}, once warm",
    )


@checks_arguments
def empty_cells(cluster: str, count: int) -> tuple[float, float, float]:
    """Bring back cells that do nothing, each once, and write a row of results.csv for each.

    Args:
        cluster: "" for local processes, or "dask" or "ray" for a cluster on this machine.
        count: Number of cells.

    Returns:
        Rows a second from the first row on, all seconds, and the most memory of this process so far in MB.
    """
    begun, times, rows = time.perf_counter(), [0.0, 0.0], {}
    with tempfile.TemporaryDirectory() as name:
        folder = ResultsFolder(Path(name))
        folder.rewrite([])
        with folder.appending() as append:
            for row in _results(cluster, range(count)):
                times[0] = times[0] or time.perf_counter()
                append(row)
                rows[row.key] = row
            times[1] = time.perf_counter()
        folder.rewrite(rows.values())
        with folder.table.open("rb") as table:
            lines = sum(1 for _ in table) - 1
    if not len(rows) == lines == count:
        raise RuntimeError(f"{count} cells became {len(rows)} rows and {lines} lines")
    return (count - 1) / (times[1] - times[0]), time.perf_counter() - begun, peak_memory() / 1e6


@checks_arguments
def run_seconds(jobs: int, starts: int) -> float:
    """Wall seconds a run of `nearest` in a small office, from when all processes have ended their first."""
    ends: list[float] = []

    def note(progress: BenchmarkProgress) -> None:
        ends.append(time.perf_counter())

    config = BenchmarkConfig(plans=("office:1",), starts=starts, agents=("nearest",), baseline="nearest")
    with tempfile.TemporaryDirectory() as name:
        run_benchmark(config, Path(name), jobs=jobs, watcher=BenchmarkWatcher(advance=note))
    # Each process loads its kernels and the plan before its first run ends.
    warm = 2 * jobs
    return (ends[-1] - ends[warm]) / (len(ends) - 1 - warm)


def _results(cluster: str, tasks: range) -> Iterator[Row]:
    lost: Callable[[int], Row] = _empty_cell
    if cluster:
        return run_on_cluster(_empty_cell, tasks, cluster=cluster, jobs=JOBS, lost=lost)
    return run_all(_empty_cell, tasks, jobs=JOBS, lost=lost)


def _empty_cell(number: int) -> Row:
    """A row as long as those of real runs."""
    value = number + 1 / 3
    numbers: dict[str, Any] = dict.fromkeys(_NUMBERS, value)
    return Row(
        plan=f"plan-{number % 50}",
        start=number,
        sensor="stage",
        agent="nearest",
        seed=0,
        stop_reason="coverage",
        **numbers,
    )
