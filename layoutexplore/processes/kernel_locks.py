"""Kernels are compiled once, however many processes need them at the same time."""

from __future__ import annotations

import contextlib
import hashlib
import os
import time
from typing import Any

from numba.core import event
from numba.core.caching import Cache
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher

from layoutexplore.processes.compilation import WAITING

PATIENCE = 60.0
"""Seconds after which a process no longer waits for one that may have been stopped, but compiles as well."""

_FILE = "layoutexplore.lock"
_LOOK_AGAIN = 0.02
_compile: Any = Dispatcher.compile
_load: Any = Cache.load_overload
_files: dict[str, int] = {}
"""Open files of locks by the folder of kernels. They stay open: to close one gives up all locks in it."""

_held: list[tuple[int, int]] = []
"""Locks of this process, as file and place in it, innermost last."""


def compile_kernels_once() -> None:
    """From now on, who needs a kernel of this package that another process compiles waits for it.

    A kernel locks one byte of a file beside it, so that a process that dies holds nothing. Nobody waits in a
    ring: while a kernel is compiled only those are that it calls. Where files cannot be locked (Windows,
    some network drives, read-only folders), each process compiles for itself.
    """
    with contextlib.suppress(ImportError):
        import fcntl  # noqa: F401

        Dispatcher.compile = _compile_locked  # type: ignore[assignment, method-assign]
        Cache.load_overload = _load_or_lock  # type: ignore[method-assign]


def _compile_locked(dispatcher: Any, signature: Any) -> Any:
    """Compile, or load; locks that were taken for it are given up."""
    with global_compiler_lock:
        outer = len(_held)
        try:
            return _compile(dispatcher, signature)
        finally:
            while len(_held) > outer:
                _release(*_held.pop())


def _load_or_lock(cache: Any, signature: Any, context: Any) -> Any:
    """What the cache has; if it has nothing, the caller may compile it, since nobody else does."""
    found = _load(cache, signature, context)
    name = f"{cache._py_func.__module__}.{cache._py_func.__qualname__}"
    if found is not None or not name.startswith("layoutexplore."):
        return found
    with contextlib.suppress(OSError):
        place = int.from_bytes(hashlib.sha256(name.encode()).digest()[:6])
        _lock(_file(cache.cache_path), place)
    return _load(cache, signature, context)


def _file(folder: str) -> int:
    """The open file of locks of a folder."""
    if folder not in _files:
        os.makedirs(folder, exist_ok=True)  # noqa: PTH103
        flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC
        _files[folder] = os.open(os.path.join(folder, _FILE), flags, 0o644)  # noqa: PTH118
    return _files[folder]


def _lock(file: int, place: int) -> None:
    """Wait until no other process holds a lock, and take it, unless that takes too long."""
    if (file, place) in _held or _take(file, place):
        return
    with event.trigger_event(WAITING):
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end and not _take(file, place):
            time.sleep(_LOOK_AGAIN)


def _take(file: int, place: int) -> bool:
    """Take a lock if it is free."""
    import fcntl

    try:
        fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, place)
    except (BlockingIOError, PermissionError):
        return False
    _held.append((file, place))
    return True


def _release(file: int, place: int) -> None:
    import fcntl

    fcntl.lockf(file, fcntl.LOCK_UN, 1, place)
