"""What tells apart two states of a user's own code: changed code is never taken for that of earlier results.

Of code in a file, the bytes of the file count, and of those beside and below it that it imports, wherever in
it the import stands. Of what was defined in a program or in a cell of a notebook, its own source counts, and
what of the same place it calls. Of an object, its attributes count, too.
"""

from __future__ import annotations

import functools
import hashlib
import inspect
import pickle
import sys
from collections.abc import Iterator
from types import CodeType, FunctionType
from typing import Any

from layoutexplore.plugins.own_files import digest_of_files, files_of, home_of, own_file

_PLAIN = (bool, int, float, complex, str, bytes, tuple, type(None))


def digest_of(thing: Any) -> str:
    """12 hexadecimal digits that change with the code of a class, function or object, and its attributes."""
    if isinstance(thing, (tuple, functools.partial)):
        parts = thing if isinstance(thing, tuple) else (thing.func, thing.args, thing.keywords)
        return _short(" ".join(map(digest_of, parts)).encode())
    root = thing if _has_code(thing) else type(thing)
    module = sys.modules.get(root.__module__)
    seen: set[int] = set()
    if module is not None and module.__name__ not in ("__main__", "__mp_main__") and own_file(module):
        found = [digest_of_files(files_of(module)), root.__qualname__]
    else:
        found = list(_code(root, seen))
    if root is not thing:
        found += list(_state(vars(thing) if hasattr(thing, "__dict__") else thing, seen))
    return _short("\n".join(found).encode())


def _has_code(thing: Any) -> bool:
    return inspect.isclass(thing) or inspect.isfunction(thing)


def _code(thing: Any, seen: set[int]) -> Iterator[str]:
    """What a class or function consists of, and what it reaches in the place where it was defined."""
    if id(thing) in seen:
        return
    seen.add(id(thing))
    yield thing.__qualname__
    if inspect.isclass(thing):
        for name, value in vars(thing).items():
            value = getattr(value, "__func__", value)
            value = value.fget if isinstance(value, property) else value
            if isinstance(value, _PLAIN) and not name.startswith("__"):
                yield f"{name} = {value!r}"
            elif _reaches(value, thing.__module__):
                yield from _code(value, seen)
        for base in thing.__bases__:
            if base.__module__ == thing.__module__:
                yield from _code(base, seen)
        return
    function: FunctionType = getattr(thing, "py_func", thing)
    yield _source(function)
    yield from _state([function.__defaults__, function.__kwdefaults__], seen)
    for name in _names(function.__code__):
        value = function.__globals__.get(name)
        if _reaches(value, function.__module__):
            yield from _code(value, seen)
        elif isinstance(value, _PLAIN):
            yield f"{name} = {value!r}"


def _reaches(value: Any, module: str) -> bool:
    """Whether a value is a function or class of that module; functions that numba compiles have `py_func`."""
    return _has_code(getattr(value, "py_func", value)) and home_of(value) == module


def _source(function: FunctionType) -> str:
    """Its source; its instructions where there is none."""
    try:
        return inspect.getsource(function)
    except (OSError, TypeError):
        return _instructions(function.__code__)


def _instructions(code: CodeType) -> str:
    constants = [
        _instructions(c) if isinstance(c, CodeType) else " ".join(_state(c, set())) for c in code.co_consts
    ]
    return f"{code.co_code.hex()} {code.co_names} {code.co_varnames} {constants}"


def _names(code: CodeType) -> Iterator[str]:
    """Global names that a function, and those within it, may look up."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def _state(value: Any, seen: set[int]) -> Iterator[str]:
    """What tells apart the attributes of two objects."""
    if isinstance(value, dict):
        for key, part in value.items():
            yield repr(key)
            yield from _state(part, seen)
    elif isinstance(value, (list, tuple)):
        for part in value:
            yield from _state(part, seen)
    elif isinstance(value, (set, frozenset)):
        yield from sorted(map(repr, value))
    elif _has_code(value):
        yield from _code(value, seen)
    elif home_of(type(value)) == "__main__":
        yield from _code(type(value), seen)
        yield from _state(vars(value), seen)
    else:
        try:
            yield hashlib.sha256(pickle.dumps(value, protocol=4)).hexdigest()
        except Exception:  # what cannot be pickled is told apart by its kind alone
            yield type(value).__qualname__


def _short(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:12]
