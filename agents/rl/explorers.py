"""Explorations side by side in worker processes: those of a search, and those of an evaluation."""

from __future__ import annotations

import contextlib
import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_EXCEPTION, Executor, wait
from functools import partial
from multiprocessing.synchronize import Event
from typing import TypeVar

from layoutexplore.plugins.transport import worker_pool
from layoutexplore.processes import usable_cores

Job = TypeVar("Job")
Result = TypeVar("Result")
Stop = Callable[[], bool]

ASKED_EVERY = 0.1
"""Seconds between two looks whether somebody asked to stop."""

_worker: list[Event] = []
"""In a worker: what tells it that its exploration is not wanted any more."""


@contextlib.contextmanager
def explorers(workers: int) -> Iterator[Executor | None]:
    """Worker processes, as many as there are cores for 0; none for 1."""
    count = workers or usable_cores()
    if count == 1:
        yield None
        return
    with worker_pool(count) as executor:
        yield executor


def explore_all(
    explore: Callable[[Job, Stop], Result], jobs: Sequence[Job], stop: Stop, workers: int
) -> list[Result]:
    """The results of all jobs, in their order, whoever is done first; fewer when asked to stop.

    Args:
        explore: Does one job, and asks now and then whether to give up; a function of a module.
        jobs: What there is to do; they travel to the workers.
        stop: Asked all the time whether to give up.
        workers: How many jobs are done at a time; as many as there are cores for 0.

    Raises:
        WorkerError: A worker process died.
    """
    count = min(workers or usable_cores(), len(jobs))
    if count <= 1:
        return [explore(job, stop) for job in jobs if not stop()]
    unwanted = multiprocessing.get_context("spawn").Event()
    with worker_pool(count, partial(_begin, unwanted)) as pool:
        try:
            waiting = futures = [pool.submit(_explore, explore, job) for job in jobs]
            while waiting and not stop():
                done, left = wait(waiting, ASKED_EVERY, FIRST_EXCEPTION)
                waiting = [] if any(future.exception() for future in done) else list(left)
        finally:  # an interruption, too, must not wait until all jobs are done
            for future in futures:
                future.cancel()
            unwanted.set()  # not before: whoever gives up would begin the next
            pool.shutdown()
        ended = [future.result() for future in futures if not future.cancelled()]
        return [result for begun in ended for result in begun]


def _begin(unwanted: Event) -> None:
    """Make ready a worker process."""
    _worker.append(unwanted)


def _explore(explore: Callable[[Job, Stop], Result], job: Job) -> list[Result]:
    """Do a job in a worker process; nothing comes of one that nobody wants any more when it begins."""
    stop = _worker[-1].is_set
    return [] if stop() else [explore(job, stop)]
