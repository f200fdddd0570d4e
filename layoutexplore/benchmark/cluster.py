"""The benchmark's tasks on a Dask or Ray cluster instead of local processes (the `cluster` extra).

The results folder must lie where all workers can write to it. A task whose worker dies is handed out again by
the cluster; when it keeps failing, its row says so and the run goes on.

Whoever reaches a Dask scheduler or a Ray head can run code on it: those that are started here listen on this
machine alone.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

from layoutexplore.benchmark.pool import AHEAD, TRIES, Answer, Handout, run_batch
from layoutexplore.errors import ConfigError, LayoutExploreError, require, unknown_name
from layoutexplore.processes import ASKING, deaf_children, single_threaded, without_main

RUNS_CODE = (
    "whoever reaches a Dask or Ray cluster can run any code on its machines: keep it to a trusted network"
)
"""What is said where the cluster is not on this machine."""

LOOPBACK = "127.0.0.1"
"""Where a cluster on this machine listens."""

_MODULES = {"dask": "distributed", "ray": "ray"}
"""What drives each kind of cluster."""

T = TypeVar("T")
R = TypeVar("R")
K = TypeVar("K")


def run_on_cluster(
    function: Callable[[T], R],
    tasks: Sequence[T],
    *,
    cluster: str,
    jobs: int,
    lost: Callable[[T], R],
    tries: int = TRIES,
) -> Iterator[R]:
    """Results of `function` over the tasks, in the order in which they end.

    Args:
        function: Picklable; it must not raise.
        tasks: Picklable.
        cluster: "dask" or "ray" for one on this machine, or "dask:ADDRESS" or "ray:ADDRESS" for one that is
            running.
        jobs: Workers of a cluster on this machine.
        lost: The result of a task whose workers died `tries` times.
        tries: How often the cluster runs such a task.

    Raises:
        UnknownNameError: The cluster is neither Dask nor Ray.
        ConfigError: Nothing answers at the address.
        MissingExtraError: The `cluster` extra is not installed.
    """
    check_cluster(cluster)
    kind, _, address = cluster.partition(":")
    run = _dask if kind == "dask" else _ray
    with single_threaded():
        yield from run(function, tasks, address, jobs, lost, tries)


def check_cluster(cluster: str) -> None:
    """See whether there is such a cluster, before anything is done for it.

    Raises:
        UnknownNameError: The name does not begin with a kind of cluster that exists.
        MissingExtraError: The `cluster` extra is not installed.
    """
    kind = cluster.partition(":")[0]
    if kind not in _MODULES:
        raise unknown_name("cluster", kind, _MODULES)
    if cluster == "ray":
        # Ray listens on all interfaces unless it thinks that machines of this kind form no clusters
        os.environ.setdefault("RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER", "0")
    require(_MODULES[kind], "cluster")


def _dask(
    function: Callable[[T], R],
    tasks: Sequence[T],
    address: str,
    jobs: int,
    lost: Callable[[T], R],
    tries: int,
) -> Iterator[R]:
    distributed, dask = require("distributed", "cluster"), require("dask", "cluster")
    with dask.config.set({"distributed.scheduler.allowed-failures": tries - 1}):
        try:
            with deaf_children(), without_main():
                client = (
                    distributed.Client(address, timeout=10) if address else distributed.Client(**_own(jobs))
                )
        except (OSError, ValueError) as error:
            raise ConfigError(f"no Dask scheduler answers at {address!r}: {error}") from error
        with client:
            ended = distributed.as_completed()

            def submit(batch: list[T]) -> str:
                ended.add(future := client.submit(run_batch, function, batch, pure=False))
                return str(future.key)

            def wait(_: list[str]) -> tuple[str, Answer[R] | None]:
                future = next(ended)
                if future.status != "error":
                    return future.key, future.result()
                if isinstance(failure := future.exception(), LayoutExploreError):
                    raise failure
                return future.key, None

            workers = max(len(client.scheduler_info(n_workers=-1)["workers"]), 1)
            yield from _hand_out(tasks, workers, submit, wait, lost)


def _own(jobs: int) -> dict[str, Any]:
    """A cluster on this machine that nobody else can reach: it runs any code that it is sent."""
    return {
        "n_workers": jobs,
        "threads_per_worker": 1,
        "dashboard_address": None,
        "memory_limit": None,
        "host": LOOPBACK,
    }


def _ray(
    function: Callable[[T], R],
    tasks: Sequence[T],
    address: str,
    jobs: int,
    lost: Callable[[T], R],
    tries: int,
) -> Iterator[R]:
    ray = require("ray", "cluster")
    own = {"num_cpus": jobs, "include_dashboard": False}
    handlers = {number: signal.getsignal(number) for number in ASKING}
    try:
        with deaf_children():
            ray.init(address=address or "local", **({} if address else own))
    except ConnectionError as error:
        raise ConfigError(f"no Ray cluster answers at {address!r}: {error}") from error
    try:
        if threading.current_thread() is threading.main_thread():
            for number, handler in handlers.items():  # Ray's own would end the process without a word
                signal.signal(number, handler)
        remote = ray.remote(max_retries=tries - 1)(lambda batch: run_batch(function, batch))

        def wait(flying: list[Any]) -> tuple[Any, Answer[R] | None]:
            (done,), _ = ray.wait(flying, num_returns=1)
            try:
                return done, ray.get(done)
            except ray.exceptions.RayError as error:
                if isinstance(cause := getattr(error, "cause", None), LayoutExploreError):
                    raise cause from None
                return done, None

        workers = max(int(ray.cluster_resources().get("CPU", 1)), 1)
        yield from _hand_out(tasks, workers, remote.remote, wait, lost)
    finally:
        ray.shutdown()


def _hand_out(
    tasks: Sequence[T],
    workers: int,
    submit: Callable[[list[T]], K],
    wait: Callable[[list[K]], tuple[K, Answer[R] | None]],
    lost: Callable[[T], R],
) -> Iterator[R]:
    """The results of all tasks, handed out in batches.

    `submit` sends a batch out and gives its name; `wait` gives the name of a batch that has ended, of those
    under way, with its results, or None where its worker died.
    """
    handout = Handout(tasks, workers)
    flying: dict[K, list[T]] = {}
    while handout or flying:
        while handout and len(flying) < AHEAD * workers:
            batch = handout.batch()
            flying[submit(batch)] = batch
        name, answer = wait(list(flying))
        batch = flying.pop(name)
        if answer is not None:
            yield from handout.learn(answer)
        elif len(batch) > 1:
            handout.split(batch)
        else:
            yield lost(batch[0])
