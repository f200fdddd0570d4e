"""What tells apart two states of a user's own code: changed code is never taken for that of earlier results.

Of code in a file, the bytes of the file count, and of those beside and below it that it imports, wherever in
it the import stands. Of what was defined in a program or in a cell of a notebook, its own source counts, and
what of the same place it calls. Of an object, its attributes count, too.
"""

from __future__ import annotations

import ast
import contextlib
import functools
import hashlib
import inspect
import pickle
import sys
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

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


def digest_of_files(files: dict[Path, bytes]) -> str:
    """12 hexadecimal digits that change with the content of files, wherever they lie."""
    return _short(b"".join(hashlib.sha256(files[path]).digest() for path in sorted(files)))


def files_of(module: ModuleType) -> dict[Path, bytes]:
    """The file of a module and those that it imports from its own folder, or from that of its package.

    An import within a function counts, too, and one of a mere number. Packages that are installed in an
    environment within that folder do not count, and neither does this one.
    """
    path = own_file(module)
    if path is None:
        return {}
    depth = module.__name__.count(".") + hasattr(module, "__path__")
    folder = path.parents[depth] if module.__package__ else path.parent
    found: dict[Path, bytes] = {}
    waiting = [module]
    while waiting:
        module = waiting.pop()
        path = own_file(module)
        if path is None or path in found or folder not in path.parents:
            continue
        found[path] = path.read_bytes()
        for value in list(vars(module).values()):
            home = value if isinstance(value, ModuleType) else sys.modules.get(_home(value))
            if home is not None:
                waiting.append(home)
    unread = list(found)
    while unread:
        here = unread.pop()
        for path in _imported(here, found[here], folder):
            if path not in found:
                with contextlib.suppress(OSError):  # it may never be imported
                    found[path] = path.read_bytes()
                    unread.append(path)
    return found


def _imported(here: Path, source: bytes, folder: Path) -> Iterator[Path]:
    """The files within a folder that a file's source imports anywhere; of what is no Python, none."""
    try:
        nodes = list(ast.walk(ast.parse(source)))
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return
    for node in nodes:
        if isinstance(node, ast.Import):
            names = [name.name.split(".") for name in node.names]
        elif isinstance(node, ast.ImportFrom):  # each name may be a module, too
            names = [[*(node.module or "").split("."), name.name] for name in node.names]
        else:
            continue
        if isinstance(node, ast.ImportFrom) and node.level:
            bases = set(here.parents[node.level - 1 : node.level])
        else:
            bases = {folder, here.parent}
            names = [parts for parts in names if parts[0] != "layoutexplore"]
        for parts in names:
            yield from _files_named(parts, bases, folder)


def _files_named(parts: list[str], bases: set[Path], folder: Path) -> Iterator[Path]:
    """The files of a dotted name and of the packages on the way to it, where they lie within a folder.

    The name begins with an empty part where it is relative to a package itself.
    """
    for base in bases:
        for count in range(1, len(parts) + 1):
            stem = base.joinpath(*parts[:count])
            for path in (stem / "__init__.py", stem.with_name(f"{stem.name}.py")):
                real = path.resolve()
                if folder in real.parents and "site-packages" not in real.parts and real.is_file():
                    yield real


def own_file(module: ModuleType) -> Path | None:
    """The Python file of a module, unless it is one of this package or of an installed one."""
    name = getattr(module, "__file__", None)
    top = module.__name__.partition(".")[0]
    if not isinstance(name, str) or not name.endswith(".py") or top == "layoutexplore":
        return None
    path = Path(name).resolve()
    return path if "site-packages" not in path.parts and path.is_file() else None


def _home(value: Any) -> str:
    home = getattr(value, "__module__", None)
    return home if isinstance(home, str) else ""


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
    return _has_code(getattr(value, "py_func", value)) and _home(value) == module


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
    elif _home(type(value)) == "__main__":
        yield from _code(type(value), seen)
        yield from _state(vars(value), seen)
    else:
        try:
            yield hashlib.sha256(pickle.dumps(value, protocol=4)).hexdigest()
        except Exception:  # what cannot be pickled is told apart by its kind alone
            yield type(value).__qualname__


def _short(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:12]
