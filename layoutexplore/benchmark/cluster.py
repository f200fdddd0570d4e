"""The benchmark's tasks on a Dask or Ray cluster instead of local processes (the `cluster` extra).

The results folder must lie where all workers can write to it. A task whose worker dies is handed out again by
the cluster; when it keeps failing, its row says so and the run goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from layoutexplore.benchmark.pool import single_threaded
from layoutexplore.errors import ConfigError, require, unknown_name

_MODULES = {"dask": "distributed", "ray": "ray"}
"""What drives each kind of cluster."""

T = TypeVar("T")
R = TypeVar("R")


def run_on_cluster(
    function: Callable[[T], R], tasks: Sequence[T], *, cluster: str, jobs: int, lost: Callable[[T], R]
) -> Iterator[R]:
    """Results of `function` over the tasks, in the order in which they end.

    Args:
        function: Picklable; it must not raise.
        tasks: Picklable.
        cluster: "dask" or "ray" for one on this machine, or "dask:ADDRESS" or "ray:ADDRESS" for one that is
            running.
        jobs: Workers of a cluster on this machine.
        lost: The result of a task whose worker died.

    Raises:
        UnknownNameError: The cluster is neither Dask nor Ray.
        ConfigError: Nothing answers at the address.
        MissingExtraError: The `cluster` extra is not installed.
    """
    check_cluster(cluster)
    kind, _, address = cluster.partition(":")
    run = _dask if kind == "dask" else _ray
    with single_threaded():
        yield from run(function, tasks, address, jobs, lost)


def check_cluster(cluster: str) -> None:
    """See whether there is such a cluster, before anything is done for it.

    Raises:
        UnknownNameError: The name does not begin with a kind of cluster that exists.
        MissingExtraError: The `cluster` extra is not installed.
    """
    kind = cluster.partition(":")[0]
    if kind not in _MODULES:
        raise unknown_name("cluster", kind, _MODULES)
    require(_MODULES[kind], "cluster")


def _dask(
    function: Callable[[T], R], tasks: Sequence[T], address: str, jobs: int, lost: Callable[[T], R]
) -> Iterator[R]:
    distributed = require("distributed", "cluster")
    try:
        own = {"n_workers": jobs, "threads_per_worker": 1, "dashboard_address": None, "memory_limit": None}
        client = distributed.Client(address, timeout=10) if address else distributed.Client(**own)
    except (OSError, ValueError) as error:
        raise ConfigError(f"no Dask scheduler answers at {address!r}: {error}") from error
    with client:
        futures = client.map(function, tasks, pure=False)
        by_key = {future.key: task for future, task in zip(futures, tasks, strict=True)}
        for future in distributed.as_completed(futures):
            yield lost(by_key[future.key]) if future.status == "error" else future.result()


def _ray(
    function: Callable[[T], R], tasks: Sequence[T], address: str, jobs: int, lost: Callable[[T], R]
) -> Iterator[R]:
    ray = require("ray", "cluster")
    try:
        ray.init(
            address=address or "local", **({} if address else {"num_cpus": jobs, "include_dashboard": False})
        )
    except ConnectionError as error:
        raise ConfigError(f"no Ray cluster answers at {address!r}: {error}") from error
    try:
        remote = ray.remote(_plain(function))
        flying = {remote.remote(task): task for task in tasks}
        while flying:
            done, _ = ray.wait(list(flying), num_returns=1)
            task = flying.pop(done[0])
            try:
                yield ray.get(done[0])
            except ray.exceptions.RayError:
                yield lost(task)
    finally:
        ray.shutdown()


def _plain(function: Callable[[T], R]) -> Callable[[T], R]:
    """Ray wants a plain function."""

    def call(task: T) -> R:
        return function(task)

    return call
