"""Pools of worker processes.

Workers are not forked from this process (threads do not survive that), and keep to one thread each: BLAS,
OpenMP and OpenCV would otherwise start as many as there are cores in every worker. A worker ends with the
process that started it, even when that one was killed: it would wait for work for ever. Ctrl-C is for the
process that started them: it does not reach the workers.

They do not import the program's main module: it may come from stdin, or lack a guard.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np

from layoutexplore.processes import (
    deaf_children,
    end_with_parent,
    restore_environment,
    single_threaded,
    without_main,
)

_WHERE_MODULES_ARE = ("PYTHONPATH", "PYTHONSAFEPATH")

_PATIENCE, _ENDING = 0.2, 5.0
"""Seconds until the processes of a pool are ended by force, and until what watches them is left alone."""


def start_pool(workers: int, begin: Callable[[], object]) -> ProcessPoolExecutor:
    """A pool all of whose processes have been started.

    Args:
        workers: Processes.
        begin: What each of them does first; picklable, and not of the program's main module.

    Raises:
        BrokenProcessPool: A process has died already.
        OSError: None can be started here; so does EOFError.
    """
    with single_threaded(), deaf_children(), without_main():
        context, given = worker_context(), dict(os.environ)
        pool = ProcessPoolExecutor(workers, context, initializer=_begin, initargs=(begin, given))
        try:
            for _ in range(workers):  # A process is started when something is handed out and no other idles.
                pool.submit(int)
        except BaseException:
            stop_pool(pool)
            raise
    return pool


def worker_context() -> Any:
    """How workers are started: to be called with `single_threaded`, in the thread that starts them.

    On Linux one more process imports once what this one has imported of the package, does nothing else, and
    is forked for each worker: that takes a tenth of a second where a worker that imports it takes two, and
    its memory is shared. Elsewhere, and where that process cannot be asked, workers are spawned.
    """
    if not sys.platform.startswith("linux"):
        return multiprocessing.get_context("spawn")
    try:
        from layoutexplore.processes.forking import SERVER, ForkedContext
    except (ImportError, AttributeError, KeyError):  # a Python that forks otherwise
        return multiprocessing.get_context("spawn")
    SERVER.set_forkserver_preload([name for name in sys.modules if name.startswith("layoutexplore.")])
    # It looks for modules where this process does, and not in the folder in which it happens to be.
    before = {name: os.environ.get(name) for name in _WHERE_MODULES_ARE}
    os.environ.update(dict(zip(_WHERE_MODULES_ARE, (os.pathsep.join(sys.path), "1"), strict=True)))
    try:
        SERVER.ensure_running()
    except OSError:  # no sockets in files here, or a temporary folder whose name is too long for one
        return multiprocessing.get_context("spawn")
    finally:
        restore_environment(before)
    return ForkedContext()


def begin_worker(environment: Mapping[str, str]) -> None:
    """Make a worker its own: the environment is that of its start, and chance not that of the others.

    Args:
        environment: Of the process that starts it; a forked worker has that of the first one's start.
    """
    from layoutexplore.processes.compilation import LISTENER

    os.environ.clear()
    os.environ.update(environment)
    LISTENER.is_silent = True  # who started it says that kernels are compiled; a forked worker listens, too
    # What own code may draw from: workers that are forked from one process would all draw the same.
    np.random.seed()  # noqa: NPY002
    if "torch" in sys.modules:
        sys.modules["torch"].seed()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that owns the workers


def stop_pool(pool: ProcessPoolExecutor) -> None:
    """End a pool without waiting for tasks nobody asks for any more (the user pressed Ctrl-C).

    Nothing of it is at work any more then: a thread that still were might hold a lock while a user's own
    program is forked, whose child would wait for it for ever.
    """
    processes = list((getattr(pool, "_processes", None) or {}).values())
    manager = getattr(pool, "_executor_manager_thread", None)
    pool.shutdown(wait=False, cancel_futures=True)
    end = time.monotonic() + _PATIENCE
    for process in processes:
        process.join(max(0.0, end - time.monotonic()))
    for process in processes:
        if process.is_alive():
            process.terminate()
    if manager is not None:
        manager.join(_ENDING)


def _begin(begin: Callable[[], object], environment: dict[str, str]) -> None:
    """What a worker does first."""
    begin_worker(environment)
    end_with_parent()
    begin()
