"""Processes: how this one was started, how many workers the machine has room for, and when they end."""

from __future__ import annotations

import contextlib
import ctypes
import multiprocessing
import os
import shlex
import signal
import sys
import threading
import time
import types
from collections.abc import Callable, Iterator
from multiprocessing import resource_tracker
from multiprocessing.process import BaseProcess
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "NUMBA_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)


def command_line() -> str:
    """The command that started this process, as a shell takes it."""
    name = Path(sys.argv[0]).name.replace("__main__.py", "layoutexplore")
    return shlex.join([name, *sys.argv[1:]])


def usable_cores() -> int:
    """Number of processor cores that this process may use: of its machine, its container and its job."""
    from joblib import cpu_count

    return int(cpu_count())


_WAITS = "layoutexplore waits for the end"
"""Name of threads that do nothing but that, and end the process then."""


def runs_alone() -> bool:
    """Whether no other thread of this process runs, but for those that wait for its end."""
    here = threading.current_thread()
    return all(thread is here or thread.name == _WAITS for thread in threading.enumerate())


def end_with_parent() -> None:
    """End this worker as soon as the process that started it has ended, even when that was killed.

    For `initializer=`.

    A worker of a pool waits for its next task, and nothing tells it that there is nobody any more.
    """
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_follow, args=(parent,), name=_WAITS, daemon=True).start()


def _follow(parent: BaseProcess) -> None:
    parent.join()
    os._exit(1)


@contextlib.contextmanager
def single_threaded() -> Iterator[None]:
    """Processes started inside the block keep to one thread each."""
    before = {name: os.environ.get(name) for name in THREAD_VARIABLES}
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
    try:
        yield
    finally:
        restore_environment(before)


def restore_environment(before: dict[str, str | None]) -> None:
    """Give variables the values that they had; those that had none have none again."""
    for name, value in before.items():
        if value is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = value


_swapping = threading.RLock()


@contextlib.contextmanager
def without_main() -> Iterator[None]:
    """Processes started inside the block do not import the program's main module.

    They need nothing of it, and it may have no file (a program that is read from stdin) or no guard: each of
    them would begin the program anew. What is handed to them inside the block must not be defined in it.
    """
    with _swapping:  # two threads that put theirs back in the wrong order would leave an empty one
        main = sys.modules["__main__"]
        sys.modules["__main__"] = types.ModuleType("__main__")
        try:
            yield
        finally:
            sys.modules["__main__"] = main


GRACE = 3.0
"""Seconds that a command has to end by itself once it was asked to."""

ASKING = (signal.SIGINT, signal.SIGTERM)
"""Signals that ask a command to end: Ctrl-C, and what a cluster or a service sends."""

_asked: list[int] = []
_grace = [GRACE]


def asked_to_stop() -> int:
    """The signal that asked this process to end, 0 where none did."""
    return _asked[0] if _asked else 0


def end_on_signals() -> None:
    """From now on SIGINT and SIGTERM end this process, and all it has started, within `GRACE` seconds.

    The first one raises KeyboardInterrupt in the main thread, so that files are closed; a second one, or the
    end of the grace, ends everything at once. Other threads and compiled code cannot put it off: a thread
    waits for the signal itself.
    """
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    threading.Thread(target=_guard, args=(reader,), name=_WAITS, daemon=True).start()
    before = {number: signal.signal(number, _ask) for number in ASKING}

    def forget() -> None:
        signal.set_wakeup_fd(-1)
        for number, handler in before.items():
            signal.signal(number, handler)

    if hasattr(os, "register_at_fork"):
        # A signal to a process that own code forks (a Pool ends its workers by SIGTERM) would be read here.
        os.register_at_fork(after_in_child=forget)


def _ask(number: int, frame: FrameType | None) -> None:
    _note(number)
    raise KeyboardInterrupt


def _note(number: int) -> None:
    """Remember the signal; what fails from now on fails because of it, and is not told."""
    if not _asked:
        _asked.append(number)
        sys.excepthook = lambda *error: None
        sys.unraisablehook = lambda *error: None
        threading.excepthook = lambda *error: None


def _guard(reader: int) -> None:
    """End the process when the grace after the first signal is over, or at the second signal."""
    while (number := os.read(reader, 1)[0]) not in ASKING:
        pass
    _note(number)
    end = time.monotonic() + _grace[0]
    os.set_blocking(reader, False)
    while time.monotonic() < end:
        time.sleep(0.05)
        with contextlib.suppress(BlockingIOError):
            if any(again in ASKING for again in os.read(reader, 64)):
                break
    end_at_once()


@contextlib.contextmanager
def more_time(seconds: float) -> Iterator[None]:
    """Inside the block, ending takes up to so many seconds: something has to be written first."""
    before, _grace[0] = _grace[0], seconds
    try:
        yield
    finally:
        _grace[0] = before


@contextlib.contextmanager
def uninterrupted() -> Iterator[None]:
    """Ctrl-C and SIGTERM that come inside the block are answered at its end: nothing there is left half done.

    It has to be short. In other threads than the main one, which signals do not interrupt, it does nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handlers: dict[int, Callable[[int, FrameType | None], Any]] = {}
    came: list[tuple[int, FrameType | None]] = []
    try:
        for asking in ASKING:
            if callable(handler := signal.getsignal(asking)):
                handlers[asking] = handler
                signal.signal(asking, lambda *what: came.append(what))
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for number, frame in came[:1]:
            handlers[number](number, frame)


def end_at_once() -> NoReturn:
    """End this process and all that it has started, with the status that a shell gives to its signal."""
    for process in descendants(os.getpid()):
        with contextlib.suppress(OSError):
            os.kill(process, getattr(signal, "SIGKILL", signal.SIGTERM))  # Windows has but one way to end
    with contextlib.suppress(Exception):
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(128 + asked_to_stop())


def descendants(process: int) -> list[int]:
    """Ids of the processes that one has started, and those that these have started, where /proc tells."""
    children: dict[int, list[int]] = {}
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError, ValueError, IndexError):
            fields = (folder / "stat").read_bytes().rpartition(b")")[2].split()
            children.setdefault(int(fields[1]), []).append(int(folder.name))
    if not children:
        return [child.pid for child in multiprocessing.active_children() if child.pid]
    found, waiting = [], [process]
    while waiting:
        below = children.get(waiting.pop(), [])
        found += below
        waiting += below
    return found


@contextlib.contextmanager
def deaf_children() -> Iterator[None]:
    """Processes that this thread starts inside the block never get SIGINT: Ctrl-C is for who started them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # It starts with the first process and then lets SIGINT through again: it has to run before.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def release_memory() -> None:
    """Give memory that is free back to the system, where the C library (glibc) would keep it."""
    with contextlib.suppress(OSError, AttributeError, TypeError):  # musl, macOS, Windows
        ctypes.CDLL(None).malloc_trim(0)


def peak_memory() -> int:
    """The most bytes of memory that this process has held at once (`VmHWM` where /proc tells).

    0 where nobody can tell (Windows).
    """
    with contextlib.suppress(OSError, ValueError, StopIteration):
        lines = Path("/proc/self/status").read_text().splitlines()
        # What `getrusage` tells begins with the memory of the process that started this one.
        return 1024 * next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:"))
    try:
        import resource
    except ImportError:
        return 0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak
