"""Explorations side by side in worker processes: those of a search, and those of an evaluation."""

from __future__ import annotations

import contextlib
import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_EXCEPTION, Executor, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.synchronize import Event
from typing import TypeVar

from layoutexplore.errors import WorkerError
from layoutexplore.plugins.transport import OwnCode, pack_own_code
from layoutexplore.processes import deaf_children, end_with_parent, single_threaded, usable_cores

Job = TypeVar("Job")
Result = TypeVar("Result")
Stop = Callable[[], bool]

ASKED_EVERY = 0.1
"""Seconds between two looks whether somebody asked to stop."""

_worker: list[tuple[Event, OwnCode]] = []
"""In a worker: what tells it that its exploration is not wanted any more, and the user's own code."""


@contextlib.contextmanager
def explorers(workers: int) -> Iterator[Executor | None]:
    """Worker processes, as many as there are cores for 0; none for 1."""
    count = workers or usable_cores()
    if count == 1:
        yield None
        return
    with (
        single_threaded(),
        ProcessPoolExecutor(count, multiprocessing.get_context("spawn"), end_with_parent) as executor,
    ):
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
    spawn = multiprocessing.get_context("spawn")
    unwanted = spawn.Event()
    begin = (unwanted, pack_own_code())
    with single_threaded(), ProcessPoolExecutor(count, spawn, _begin, begin) as pool:
        try:
            try:
                with deaf_children():
                    waiting = futures = [pool.submit(_explore, explore, job) for job in jobs]
                while waiting and not stop():
                    done, left = wait(waiting, ASKED_EVERY, FIRST_EXCEPTION)
                    waiting = [] if any(future.exception() for future in done) else list(left)
            finally:  # an interruption, too, must not wait until all jobs are done
                unwanted.set()
                pool.shutdown(cancel_futures=True)
            return [future.result() for future in futures if not future.cancelled()]
        except BrokenProcessPool as error:
            raise WorkerError(
                f"one of {count} processes that explore for an evaluation was killed (out of memory?); "
                "fewer workers need less memory"
            ) from error


def _begin(unwanted: Event, code: OwnCode) -> None:
    """Make ready a worker process."""
    end_with_parent()
    _worker.append((unwanted, code))


def _explore(explore: Callable[[Job, Stop], Result], job: Job) -> Result:
    """Do a job in a worker process."""
    unwanted, code = _worker[-1]
    with code.installed():
        return explore(job, unwanted.is_set)
