"""The benchmark on Dask and Ray gives the rows that local processes give."""

from __future__ import annotations

import dataclasses
import os
import sys
from pathlib import Path

import pytest

from layoutexplore.agents.greedy import Nearest
from layoutexplore.benchmark.cluster import run_on_cluster
from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.runner import run_benchmark
from layoutexplore.errors import ConfigError, MissingExtraError, UnknownNameError
from tests.plugins.cases import write

TIMES = {"ms_decision_median", "ms_decision_p95", "wall_seconds"}


def square(value: int) -> int:
    return value * value


def die(value: int) -> int:
    os._exit(1)


@pytest.mark.parametrize("cluster", ["dask", pytest.param("ray", marks=pytest.mark.slow)])
def test_tasks_run(cluster: str) -> None:
    pytest.importorskip("distributed" if cluster == "dask" else "ray")
    assert sorted(run_on_cluster(square, [1, 2, 3], cluster=cluster, jobs=1, lost=lambda task: -1)) == [
        1,
        4,
        9,
    ]


@pytest.mark.slow
@pytest.mark.parametrize("cluster", ["dask", "ray"])
def test_a_task_that_kills_its_worker_is_lost(cluster: str) -> None:
    pytest.importorskip("distributed" if cluster == "dask" else "ray")
    assert list(run_on_cluster(die, [1], cluster=cluster, jobs=1, lost=lambda task: -task)) == [-1]


@pytest.mark.slow
@pytest.mark.parametrize("cluster", ["dask", "ray"])
def test_same_rows_as_here(cluster: str, tmp_path: Path) -> None:
    pytest.importorskip("distributed" if cluster == "dask" else "ray")
    config = BenchmarkConfig(plans=("apartment-03",), starts=1, agents=("nearest", "random"))
    here, there = (run_benchmark(config, tmp_path / name, cluster=name.strip("-")) for name in ("-", cluster))
    rows = [
        [{k: v for k, v in dataclasses.asdict(r).items() if k not in TIMES} for r in run.rows]
        for run in (here, there)
    ]
    assert rows[0] == rows[1] and not any(row["error"] for row in rows[0])


@pytest.mark.slow
@pytest.mark.parametrize("cluster", ["dask", "ray"])
def test_own_code_travels(cluster: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed" if cluster == "dask" else "ray")

    class Local(Nearest):
        """A class that no worker could import."""

    write(tmp_path)
    monkeypatch.chdir(tmp_path)
    agents = ["nearest:min_size=0.4", Local, "mine.py:Mine:skip=1"]
    config = BenchmarkConfig(plans=("apartment-03",), starts=1, agents=agents)
    rows = run_benchmark(config, tmp_path / "out", cluster=cluster).rows
    assert not any(row.error for row in rows) and len({row.d95 for row in rows}) == 3


def test_bad_clusters() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'dask'"):
        next(run_on_cluster(square, [1], cluster="dusk", jobs=1, lost=square))
    pytest.importorskip("distributed")
    with pytest.raises(ConfigError, match="no Dask scheduler answers"):
        next(run_on_cluster(square, [1], cluster="dask:nonsense", jobs=1, lost=square))


def test_a_missing_extra_is_told_before_anything_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingExtraError, match=r"layoutexplore\[cluster\]"):
        run_benchmark(BenchmarkConfig(plans=("apartment-03",)), tmp_path / "out", cluster="dask")
    assert not (tmp_path / "out").exists()
