"""Independent tasks on worker processes, where a worker that dies costs one task and not the run.

Workers are spawned, not forked (threads and compiled kernels do not survive a fork), and keep to one thread
each: BLAS, OpenMP and OpenCV would otherwise start as many as there are cores in every worker. A worker ends
with the process that started it, even when that one was killed: it would wait for work for ever.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any, TypeVar

from layoutexplore.processes import end_with_parent
from layoutexplore.processes import single_threaded as single_threaded
from layoutexplore.processes import usable_cores as usable_cores

T = TypeVar("T")
R = TypeVar("R")

AHEAD = 2
"""Tasks handed out per worker: one runs, the others wait so that no worker idles."""


def run_all(
    function: Callable[[T], R],
    tasks: Sequence[T],
    *,
    jobs: int,
    lost: Callable[[T], R],
    initializer: Callable[..., None],
    arguments: tuple[Any, ...] = (),
) -> Iterator[R]:
    """Results of `function` over the tasks, in the order in which they end.

    Args:
        function: Picklable; it must not raise.
        tasks: Picklable.
        jobs: Worker processes; with 1, all runs in this process.
        lost: The result of a task whose worker died twice.
        initializer: Called once in every worker (and here, with one job).
        arguments: For the initializer.
    """
    if jobs == 1:
        initializer(*arguments)
        yield from map(function, tasks)
        return
    queue = list(reversed(tasks))
    suspects: list[T] = []
    while queue or suspects:
        careful = bool(
            suspects
        )  # tasks that were in flight when a worker died run alone, to find the one that kills
        source, workers = (suspects, 1) if careful else (queue, min(jobs, len(queue)))
        with single_threaded():
            spawn = multiprocessing.get_context("spawn")
            pool = ProcessPoolExecutor(workers, spawn, initializer=_begin, initargs=(initializer, arguments))
            flying: dict[Future[R], T] = {}
            try:
                while source or flying:
                    while source and len(flying) < (1 if careful else AHEAD * workers):
                        task = source.pop()
                        flying[pool.submit(function, task)] = task
                    for future in wait(flying, return_when=FIRST_COMPLETED).done:
                        result = future.result()
                        del flying[future]
                        yield result
            except BrokenProcessPool:
                if careful:
                    yield from (lost(task) for task in flying.values())
                else:
                    suspects.extend(flying.values())
            finally:
                _stop(pool)


def _begin(initializer: Callable[..., None], arguments: tuple[Any, ...]) -> None:
    """What a worker does first."""
    end_with_parent()
    initializer(*arguments)


def _stop(pool: ProcessPoolExecutor) -> None:
    """Do not wait for tasks nobody asks for any more (the user pressed Ctrl-C)."""
    processes = list((getattr(pool, "_processes", None) or {}).values())
    pool.shutdown(wait=False, cancel_futures=True)
    for process in processes:
        process.join(timeout=0.2)
        if process.is_alive():
            process.terminate()
