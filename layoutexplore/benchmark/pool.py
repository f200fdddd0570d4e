"""Independent tasks on worker processes, where a worker that dies costs one task and not the run."""

from __future__ import annotations

import contextlib
import ctypes
import functools
import mmap
import multiprocessing
import os
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from layoutexplore.plugins.transport import begin_quietly, starting_workers
from layoutexplore.processes.pools import start_pool, stop_pool

T = TypeVar("T")
R = TypeVar("R")

AHEAD = 2
"""Batches handed out per worker: one runs, the others wait so that no worker idles."""

BATCH_SECONDS, LARGEST_BATCH = 0.2, 1000
"""Tasks that take less than this go out several at a time."""

TRIES = 3
"""A task whose worker dies is run so often before it is given up."""

Answer = tuple[list[R], float]
"""The results of a batch, and the seconds that it took."""


class Handout(Generic[T]):
    """Which tasks go out next: one at a time, and several where they turn out to be short.

    Args:
        tasks: In the order in which they go out.
        workers: How many share them.
        largest: Batch.
    """

    def __init__(self, tasks: Iterable[T], workers: int, largest: int = LARGEST_BATCH) -> None:
        self.waiting = deque(tasks)
        self._workers, self._largest, self._size = workers, largest, 1

    def __bool__(self) -> bool:
        return bool(self.waiting)

    def batch(self) -> list[T]:
        """The next tasks; towards the end fewer, so that all workers end together."""
        size = min(self._size, len(self.waiting) // (2 * AHEAD * self._workers) + 1)
        return [self.waiting.popleft() for _ in range(size)]

    def take_back(self, batch: Sequence[T]) -> None:
        """A batch that did not go out is the next again."""
        self.waiting.extendleft(reversed(batch))

    def split(self, batch: Sequence[T]) -> None:
        """One task of a batch ends its worker: they go out one at a time."""
        self._size = self._largest = 1
        self.take_back(batch)

    def learn(self, answer: Answer[Any]) -> list[Any]:
        """The results of a batch, once it is noted how long it took."""
        results, seconds = answer
        fitting = BATCH_SECONDS * len(results) / max(seconds, 1e-9)
        self._size = int(min(max(fitting, 1), self._largest, 2 * self._size))
        return results


def run_batch(function: Callable[[T], R], batch: Sequence[T]) -> Answer[R]:
    """What a worker does with a batch."""
    begin = time.perf_counter()
    return [function(task) for task in batch], time.perf_counter() - begin


def run_all(
    function: Callable[[T], R],
    tasks: Sequence[T],
    *,
    jobs: int,
    lost: Callable[[T], R],
    begin: Callable[[], object] = int,
    tries: int = TRIES,
    apart: bool = False,
) -> Iterator[R]:
    """Results of `function` over the tasks, in the order in which they end.

    Args:
        function: Picklable, and not of the program's main module, which workers do not import; it must not
            raise.
        tasks: Picklable.
        jobs: Worker processes; with 1, all runs in this process.
        lost: The result of a task whose worker died `tries` times while it ran nothing else.
        begin: Called once in every worker (and here, with one job).
        tries: How often such a task is run by itself.
        apart: Whether one job, too, has a process of its own: one that may end its process.
    """
    if jobs == 1 and not apart:
        begin()
        yield from map(function, tasks)
        return
    handout, suspects = Handout(tasks, jobs), Handout[T]([], 1, largest=1)
    deaths: Counter[int] = Counter()
    while handout or suspects:
        if not suspects:
            broken = yield from _run_pool(function, handout, min(jobs, len(handout.waiting)), AHEAD, begin)
            suspects.waiting.extend(broken)
            continue
        # tasks that were in flight when a worker died run alone, to find the one that kills
        for task in (yield from _run_pool(function, suspects, 1, 1, begin)):
            deaths[id(task)] += 1
            if deaths[id(task)] < tries:
                suspects.waiting.appendleft(task)
            else:
                yield lost(task)


def _run_pool(
    function: Callable[[T], R], handout: Handout[T], workers: int, ahead: int, begin: Callable[[], object]
) -> Generator[R, None, list[T]]:
    """Run what is handed out on one pool until all is done or a worker dies; returns what was in flight."""
    flying: dict[Future[Answer[R]], list[T]] = {}
    with starting_workers():
        pool = start_pool(workers, functools.partial(begin_quietly, begin))
    try:
        while handout or flying:
            while handout and len(flying) < ahead * workers:
                batch = handout.batch()
                try:
                    flying[pool.submit(run_batch, function, batch)] = batch
                except BrokenProcessPool:
                    handout.take_back(batch)
                    raise
            for future in wait(flying, return_when=FIRST_COMPLETED).done:
                answer = future.result()
                del flying[future]
                yield from handout.learn(answer)
    except BrokenProcessPool:
        pass
    finally:
        stop_pool(pool)
    return [task for batch in flying.values() for task in batch]


AGAIN = 1.0
"""Seconds after which a task whose time is over is told so again."""

STUCK = 30.0
"""Seconds after which a worker is ended whose task does not hear that its time is over."""


PREPARING = 120.0
"""Seconds more than its task that a preparation may take: kernels may have to be compiled."""


class CellTimeoutError(KeyboardInterrupt):
    """A task has taken longer than it may; as with Ctrl-C, no `except Exception` takes it for its own."""


@dataclass(frozen=True)
class Limited(Generic[T, R]):
    """A function of one task that ends in time and within its memory.

    Attributes:
        function: What it does with a task.
        late: The result of a task that took too long.
        seconds: At most so many, 0 for as long as it takes.
        megabytes: At most so much more memory than the process has at the beginning, 0 for any; then
            MemoryError is raised (Linux only).
        prepare: Called with the task before either limit counts, if given; it must not raise. Where time is
            limited, it ends `PREPARING` seconds after that time.
    """

    function: Callable[[T], R]
    late: Callable[[T], R]
    seconds: float = 0.0
    megabytes: float = 0.0
    prepare: Callable[[T], object] | None = None

    def __call__(self, task: T) -> R:
        """The result of a task."""
        if self.prepare:
            _in_time(self.prepare, task, _Deadline(PREPARING + self.seconds) if self.seconds else None)
        # A thread takes memory of its own: the deadline's is there before the limit is.
        deadline = _Deadline(self.seconds) if self.seconds else None
        with _memory(self.megabytes):
            found = _in_time(self.function, task, deadline)
            return found[0] if found else self.late(task)


def _in_time(function: Callable[[T], R], task: T, deadline: _Deadline | None) -> tuple[R] | tuple[()]:
    """The result of a task, if it ends in time."""
    if deadline is None:
        return (function(task),)
    # In one frame, without a context manager in between: the error may come between any two steps.
    try:
        try:
            try:
                deadline.begin()
                result = function(task)
            finally:
                deadline.settle()
        finally:
            deadline.settle()  # where the error came just before the first one began
    except CellTimeoutError:
        return ()
    return () if deadline.late else (result,)


class _Deadline:
    """Raises `CellTimeoutError` in the thread that makes it once its time is over, between two Python steps.

    It is raised again every `AGAIN` seconds: a finalizer or a callback of compiled code that it happens to
    hit swallows it. A worker that is in compiled code for `STUCK` seconds more is ended.
    """

    def __init__(self, seconds: float) -> None:
        self.late = False
        self._seconds, self._thread = seconds, threading.get_ident()
        self._lock, self._over, self._begun = threading.Lock(), threading.Event(), threading.Event()
        threading.Thread(target=self._watch, daemon=True).start()

    def begin(self) -> None:
        """The time runs from now on."""
        self._begun.set()

    def settle(self) -> None:
        """Nothing is raised any more once this has returned."""
        while not self._over.is_set():  # the error itself may come in here once more
            with contextlib.suppress(CellTimeoutError), self._lock:
                self._over.set()
                if self.late:
                    # One that is still to come is replaced by one that comes now. It must not be taken back:
                    # Python 3.11 would look for it at every step, and hang in a thread that is traced.
                    _raise_in(self._thread, CellTimeoutError)
                    for _ in range(100):
                        pass

    def _watch(self) -> None:
        self._begun.wait()
        wait, end = self._seconds, time.monotonic() + self._seconds + STUCK
        while not self._over.wait(wait):
            with self._lock:
                if not self._over.is_set():
                    self.late = True
                    _raise_in(self._thread, CellTimeoutError)
            wait = AGAIN
            if time.monotonic() > end and multiprocessing.parent_process() is not None:
                os._exit(1)


def _raise_in(thread: int, error: type[BaseException]) -> None:
    """Let a thread raise an error at its next step."""
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(error))


def taken_megabytes() -> float:
    """Memory of this process (its address space, which a limit counts) in MB; 0 where nobody can tell."""
    statm = Path("/proc/self/statm")
    return int(statm.read_text().split()[0]) * mmap.PAGESIZE / 2**20 if statm.exists() else 0.0


@contextlib.contextmanager
def _memory(megabytes: float) -> Iterator[None]:
    """The process may take so much more memory inside the block."""
    taken = taken_megabytes()
    if not megabytes or not taken:
        yield
        return
    import resource

    before = resource.getrlimit(resource.RLIMIT_AS)
    most = int((taken + megabytes) * 2**20)
    if before[0] != resource.RLIM_INFINITY:
        most = min(most, before[0])
    resource.setrlimit(resource.RLIMIT_AS, (most, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)
