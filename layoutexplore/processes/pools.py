"""Pools of worker processes.

Workers are spawned, not forked (threads and compiled kernels do not survive a fork), and keep to one thread
each: BLAS, OpenMP and OpenCV would otherwise start as many as there are cores in every worker. A worker ends
with the process that started it, even when that one was killed: it would wait for work for ever. Ctrl-C is
for the process that started them: it does not reach the workers.

They do not import the program's main module: it may come from stdin, or lack a guard.
"""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor

from layoutexplore.processes import deaf_children, end_with_parent, single_threaded, without_main


def start_pool(workers: int, begin: Callable[[], object]) -> ProcessPoolExecutor:
    """A pool all of whose processes have been started.

    Args:
        workers: Processes.
        begin: What each of them does first; picklable, and not of the program's main module.

    Raises:
        BrokenProcessPool: A process has died already.
    """
    with single_threaded(), deaf_children(), without_main():
        spawn = multiprocessing.get_context("spawn")
        pool = ProcessPoolExecutor(workers, spawn, initializer=_begin, initargs=(begin,))
        for _ in range(workers):  # A process is started when something is handed out and no other idles.
            pool.submit(int)
    return pool


def stop_pool(pool: ProcessPoolExecutor) -> None:
    """End a pool without waiting for tasks nobody asks for any more (the user pressed Ctrl-C)."""
    processes = list((getattr(pool, "_processes", None) or {}).values())
    pool.shutdown(wait=False, cancel_futures=True)
    for process in processes:
        process.join(timeout=0.2)
        if process.is_alive():
            process.terminate()


def _begin(begin: Callable[[], object]) -> None:
    """What a worker does first."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
    begin()
