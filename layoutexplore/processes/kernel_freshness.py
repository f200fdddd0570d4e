"""Kernels are compiled anew where anything that was compiled into them has changed, in whatever file.

Numba keeps a kernel for as long as its own file is the same. The kernels that it calls and the numbers that
it reads are compiled into it as well: after an update that changed these alone, it would go on with the old
ones.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import re
import time
from collections.abc import Collection, Iterator
from enum import Enum
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import numpy as np
from numba.core.caching import Cache
from numba.core.dispatcher import Dispatcher

_NUMBERS = (bool, int, float, complex, str, bytes, np.generic, type(None))

_YOUNG = 3600.0
"""Seconds for which a file stays to which nothing leads: some process may be about to say what it wrote."""

_load: Any = getattr(Cache, "_load_overload", None)
_save: Any = getattr(Cache, "_save_overload", None)


def keep_kernels_fresh() -> None:
    """From now on, a kernel in the cache counts only if all that it has taken in is as it was.

    A numba that is built otherwise stays as it is.
    """
    if _load and _save:
        Cache._load_overload = _load_fresh  # type: ignore[method-assign]
        Cache._save_overload = _save_stamped  # type: ignore[method-assign]


def _load_fresh(cache: Any, signature: Any, context: Any) -> Any:
    look_at_sources(cache)
    return _load(cache, signature, context)


def _save_stamped(cache: Any, signature: Any, data: Any) -> None:
    look_at_sources(cache)
    _save(cache, signature, data)
    if cache._py_func.__module__.startswith("layoutexplore."):
        with contextlib.suppress(OSError):
            file = cache._cache_file
            _clear_away(Path(cache.cache_path), file._index_name, file._load_index().values())


def _clear_away(folder: Path, index: str, data: Collection[str]) -> None:
    """Remove the files of a kernel to which nothing leads any more: of its code as it was, or stood, before.

    Args:
        folder: Where they are.
        index: The name of the file that leads to the others, as `masks.erode-12.py311.nbi`.
        data: The names of those.
    """
    kernel, _, line = index.removesuffix(".nbi").rpartition("-")
    files = re.compile(rf"{re.escape(kernel)}-\d+{re.escape(line.lstrip('0123456789'))}\.(nbi|\d+\.nbc)")
    for file in folder.iterdir():
        if files.fullmatch(file.name) and file.name != index and file.name not in data:
            with contextlib.suppress(FileNotFoundError):  # another process does the same
                if file.stat().st_mtime < time.time() - _YOUNG:
                    file.unlink()


def look_at_sources(cache: Any) -> None:
    """Tell the cache of a kernel, once, what is compiled into that: at its first use all of it is there."""
    if not hasattr(cache, "taken_in"):
        cache.taken_in, file = "", cache._cache_file
        with contextlib.suppress(Exception):  # of a program's own kernels, whose globals may be anything
            cache.taken_in = taken_in(cache._py_func)
        file._source_stamp = file._source_stamp, cache.taken_in


def taken_in(kernel: FunctionType) -> str:
    """A digest of what is compiled into a kernel: it, all that it calls, and the numbers that these read."""
    found: dict[FunctionType, str] = {}
    waiting = [kernel]
    while waiting:
        function = waiting.pop()
        if function not in found:
            found[function] = _own_part(function)
            waiting += [other for _, value in _named(function) if (other := _function(value)) is not None]
    return hashlib.sha256("\n".join(sorted(found.values())).encode()).hexdigest()


@functools.cache
def _own_part(function: FunctionType) -> str:
    """A digest of a function and of the numbers that it reads."""
    read = sorted((name, text) for name, value in _named(function) if (text := _spelled(value)))
    name, defaults = f"{function.__module__}.{function.__qualname__}", _spelled(function.__defaults__)
    what = name, defaults, _code(function.__code__), read
    return hashlib.sha256(repr(what).encode()).hexdigest()


def _named(function: FunctionType) -> Iterator[tuple[str, Any]]:
    """What a function, and those inside it, may mean by the names that they use, and what it encloses."""
    waiting = [function.__code__]
    for code in waiting:
        waiting += [part for part in code.co_consts if isinstance(part, CodeType)]
        for name in code.co_names:
            if name in function.__globals__:
                yield name, function.__globals__[name]
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        yield name, cell.cell_contents


def _function(value: Any) -> FunctionType | None:
    """The function that a kernel may call: another kernel, or one that can be compiled into it."""
    inner = value.py_func if isinstance(value, Dispatcher) else value
    return inner if isinstance(inner, FunctionType) else None


def _code(code: CodeType) -> tuple[Any, ...]:
    """What a function does, without where it stands."""
    constants = [_code(part) if isinstance(part, CodeType) else _spelled(part) for part in code.co_consts]
    return code.co_code, code.co_names, code.co_varnames, constants


def _spelled(value: Any) -> str:
    """A number, or what is made of numbers, as a text; empty for what no kernel takes in by its value."""
    if isinstance(value, Dispatcher):
        return repr(sorted((name, str(option)) for name, option in value.targetoptions.items()))
    if isinstance(value, (Enum, *_NUMBERS)):
        return repr(value)
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        return f"{value.dtype}{value.shape}{hashlib.sha256(value.tobytes()).hexdigest()}"
    if isinstance(value, tuple):
        return f"{type(value).__name__}({', '.join(map(_spelled, value))})"
    if isinstance(value, frozenset):
        return f"{{{', '.join(sorted(map(_spelled, value)))}}}"
    if isinstance(value, type) and issubclass(value, Enum):
        return ", ".join(f"{one}={_spelled(one.value)}" for one in value)
    if isinstance(value, type):
        return f"{value.__qualname__}{getattr(value, '_fields', '')}"
    return ""
