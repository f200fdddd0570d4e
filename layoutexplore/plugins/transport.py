"""A user's own code on its way to worker processes: references as they are pinned, definitions by value."""

from __future__ import annotations

import atexit
import contextlib
import importlib
import multiprocessing
import pickle
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from layoutexplore.errors import MapWarning, OwnCodeError, WorkerError, cause
from layoutexplore.plugins.own_code import Pin, pinned, pins
from layoutexplore.plugins.registry import Entry, Registry
from layoutexplore.processes.pools import start_pool, stop_pool

Travelling = tuple[str, str, Entry[object]]
"""The module and the kind of a registry, and an entry of it."""


@dataclass(frozen=True)
class OwnCode:
    """What a worker needs to make what users have added.

    Attributes:
        pins: References by their places.
        registered: What was registered in the session, pickled; empty where it is not needed.
    """

    pins: dict[str, Pin] = field(default_factory=dict)
    registered: bytes = b""

    @contextlib.contextmanager
    def installed(self) -> Iterator[None]:
        """Inside the block, names and references mean what they meant where this was packed."""
        if self.registered and self.registered not in _restored:
            entries: list[Travelling] = pickle.loads(self.registered)
            for module, kind, entry in entries:
                importlib.import_module(module)
                Registry.by_kind[kind].restore(entry)
            _restored.add(self.registered)
        with pinned(self.pins):
            yield


NO_CODE = OwnCode()
"""What it takes where only what ships is used."""

_restored: set[bytes] = set()


def pack_own_code(*, registered: bool = True) -> OwnCode:
    """What workers of this process need, of all that it has loaded and registered.

    References travel as such, definitions of a notebook or a program by value.

    Args:
        registered: Whether what was registered in this process has to travel.

    Raises:
        OwnCodeError: Something registered cannot travel.
    """
    registries = Registry.by_kind.items() if registered else ()
    entries = [(r.module, kind, _bare(entry)) for kind, r in registries for entry in r.own()]
    return OwnCode(pins(), _pickled(entries) if entries else b"")


_WITHOUT = (
    'one process needs none: --jobs 1, --workers 0, jobs=1, or backend="threads" of a vector environment'
)


@contextlib.contextmanager
def starting_workers() -> Iterator[None]:
    """What keeps worker processes from being started inside the block is told as such.

    Raises:
        WorkerError: This is a process that must not start others, or the system refuses: without /dev/shm,
            with too few open files or processes.
    """
    if multiprocessing.current_process().daemon:
        raise WorkerError(f"daemonic processes (of a multiprocessing.Pool) cannot start others; {_WITHOUT}")
    try:
        yield
    except (OSError, EOFError) as error:  # EOFError: the process that forks them could not, and has ended
        raise WorkerError(
            f"cannot start worker processes ({cause(error)}): they need room in /dev/shm, open files "
            f"(ulimit -n) and processes (ulimit -u); {_WITHOUT}"
        ) from error


def begin_quietly(begin: Callable[[], object]) -> None:
    """What a worker does first; who started it has read the floor plans, and has said what they lack."""
    warnings.filterwarnings("ignore", category=MapWarning)
    begin()


def worker_killed(workers: int) -> WorkerError:
    """What is told where one of so many worker processes was killed."""
    return WorkerError(
        f"one of {workers} worker processes was killed (out of memory?); fewer of them (--jobs or --workers) "
        "need less memory"
    )


@contextlib.contextmanager
def worker_pool(workers: int, begin: Callable[[], object] = int) -> Iterator[ProcessPoolExecutor]:
    """Worker processes that know the user's own code; they end with the block, whatever they are doing.

    What is handed out must not be defined in the program's main module, which they do not import.

    Args:
        workers: Processes, of one thread each.
        begin: What each of them does first.

    Raises:
        OwnCodeError: Something registered cannot travel.
        WorkerError: A process died, or none can be started here.
    """
    try:
        with starting_workers():
            pool = start_pool(workers, partial(_install, pack_own_code(), begin))
        try:
            yield pool
        finally:
            stop_pool(pool)
    except BrokenProcessPool as error:
        raise worker_killed(workers) from error


@contextlib.contextmanager
def worker_map(workers: int, begin: Callable[[], object] = int) -> Iterator[Callable[..., Iterator[Any]]]:
    """What `map` does, in this process or in a `worker_pool` of several, in the order of what is given.

    Args:
        workers: Processes; 1 or none for this one.
        begin: What each of them does first.
    """
    if workers <= 1:
        begin()
        yield map
        return
    with worker_pool(workers, begin) as pool:
        yield pool.map


_installed = contextlib.ExitStack()
"""In a worker: the user's own code, for as long as it lives."""


def _install(code: OwnCode, begin: Callable[[], object]) -> None:
    _installed.enter_context(code.installed())
    atexit.register(_installed.close)  # later there are no modules any more that it could leave as they were
    begin_quietly(begin)


def _pickled(entries: list[Travelling]) -> bytes:
    import cloudpickle  # type: ignore[import-untyped]

    for _, kind, entry in entries:
        try:
            cloudpickle.dumps(entry)
        except Exception as error:
            where = f"{kind} {entry.name!r} cannot be sent to worker processes"
            raise OwnCodeError(f"{where}: {error}") from error
    data: bytes = cloudpickle.dumps(entries)
    return data


def _bare(entry: Entry[object]) -> Entry[object]:
    """An entry without what follows from the thing itself."""
    options = entry.options if entry.given else None
    return Entry(entry.name, entry.doc, entry.thing, options, entry.thing, entry.given, entry.digest)
