"""What tells apart two states of a user's own code: changed code is never taken for that of earlier results.

Of code in a file, the bytes of the file count, and of those beside and below it that it imports, wherever in
it the import stands. Of what was defined in a program or in a cell of a notebook, its own source counts, and
all that it looks up in the same place: functions, classes, values, modules beside the program. Of an object,
its attributes count, too. What is installed counts by its name.

Two processes find the same: neither the order in which a set or dictionary was filled counts, nor where in
memory something lies.
"""

from __future__ import annotations

import copyreg
import dis
import enum
import functools
import hashlib
import inspect
import linecache
import sys
import tokenize
import warnings
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FunctionType, MappingProxyType, MethodType, ModuleType
from typing import Any

from layoutexplore.plugins.own_files import (
    contents,
    digest_of_files,
    files_imported,
    files_of,
    home_of,
    own_file,
    with_imports,
)

_PLAIN = (bool, int, float, complex, str, bytes, type(None), type(...))

_PROGRAMS = ("__main__", "__mp_main__")
"""Modules of which no file is imported: what is defined there counts piece by piece."""

_WRAPPERS = (staticmethod, classmethod, functools._lru_cache_wrapper)

_WALKS = 3
"""So often labels are made anew: functions of one name and source are told apart by what they hold."""

_ASIDE = {
    *("__dict__", "__weakref__", "__module__", "__doc__", "__firstlineno__", "__static_attributes__"),
    *("_abc_impl", "__annotate_func__", "__annotations_cache__", "__slotnames__"),
}
"""Attributes of a class that say nothing of what it does; Python sets the last when an object is copied."""


def digest_of(thing: Any) -> str:
    """12 hexadecimal digits that change with the code of a class, function or object, and its attributes."""
    homes = (name for name in _homes(thing) if name.partition(".")[0] not in sys.stdlib_module_names)
    walk = _Walk({name for name in homes if not _file_of(name)})
    for _ in range(_WALKS):
        found = walk.digest(thing)
    return found[:12]


def _homes(thing: Any) -> Iterator[str]:
    """Where what was given is defined."""
    if isinstance(thing, tuple):
        for part in thing:
            yield from _homes(part)
    elif isinstance(thing, functools.partial):
        yield from _homes(thing.func)
    else:
        yield home_of(thing if _has_code(thing) else type(thing))


def _file_of(name: str) -> Path | None:
    """The own file of a module; None of a program, of what is installed, and of what has no file."""
    module = sys.modules.get(name)
    if module is None or name in _PROGRAMS or name.partition(".")[0] in sys.stdlib_module_names:
        return None
    return own_file(module)


def _has_code(thing: Any) -> bool:
    return inspect.isclass(thing) or inspect.isfunction(thing)


class _Walk:
    """A walk over all that a value reaches.

    Classes and functions may reach each other in circles: where one is met it has a label, and is described
    apart. Its label is the digest of its description in the walk before, in the first one its name. Thus no
    digest depends on where a circle is entered.

    Args:
        homes: Modules without an own file whose code counts piece by piece, beside that of programs.
    """

    def __init__(self, homes: set[str]) -> None:
        self._homes = homes
        self._modules: dict[str, str] = {}
        self._sources: dict[int, str] = {}
        self._labels: dict[int, str] = {}
        self._kept: list[Any] = []  # no other value gets the place of one in memory
        self._met: dict[int, Any] = {}
        self._found: dict[int, str] = {}

    def digest(self, thing: Any) -> str:
        """64 hexadecimal digits; after another call, they tell apart what is further away."""
        self._met, self._found = {}, {}
        text, labels = self.of(thing), dict[int, str]()
        while waiting := self._met.keys() - labels.keys():
            for key in waiting:
                code = self._met[key]
                parts = self._class(code) if inspect.isclass(code) else self._function(code)
                labels[key] = _hashed("\n".join(parts))
        self._labels = labels
        return _hashed("\n".join([text, *sorted(labels.values())]))

    def of(self, value: Any) -> str:
        """The digest of a value, or the label of a class or function."""
        self._kept.append(value)
        key, name = id(value), f"{home_of(type(value))}.{type(value).__qualname__}"
        if _has_code(value):
            self._met[key] = value
            return self._labels.get(key, f"{home_of(value)}.{value.__qualname__}")
        if key not in self._found:
            self._found[key] = f"{name}, which reaches itself"
            try:
                self._found[key] = _hashed("\n".join([name, *self._parts(value)]))
            except RecursionError:
                self._found[key] = name
        return self._found[key]

    def _parts(self, value: Any) -> Iterator[str]:
        kind = type(value)
        if kind in _PLAIN:
            # A long number has no repr, that of bytes is long.
            yield hex(value) if kind is int else _hashed(value) if kind is bytes else repr(value)
        elif kind in (list, tuple):
            yield from map(self.of, value)
        elif kind in (dict, MappingProxyType):
            yield from self._pairs(value.items())
        elif isinstance(value, (set, frozenset)):
            yield from sorted(map(self.of, value))
        elif isinstance(value, ModuleType):
            yield self._module(value.__name__) or value.__name__
        elif isinstance(value, CodeType):
            yield from self._instructions(value)
        elif isinstance(value, enum.Enum):
            yield from self._pairs(vars(value).items())
        elif isinstance(value, MethodType):
            yield from map(self.of, (value.__func__, value.__self__))
        elif isinstance(value, property):
            yield from map(self.of, (value.fget, value.fset, value.fdel))
        elif isinstance(value, _WRAPPERS):
            yield self.of(value.__wrapped__)
        elif inspect.isfunction(inner := getattr(value, "py_func", None)):  # what numba compiles
            yield self.of(inner)
        elif (array := _array_of(value)) is not None:
            yield from map(self.of, (str(value.dtype), array))
        else:
            yield from self._object(value)

    def _pairs(self, pairs: Any) -> list[str]:
        return sorted(f"{self.of(key)} = {self.of(value)}" for key, value in pairs)

    def _module(self, name: str) -> str:
        """What stands for all that a module defines; empty where that counts piece by piece."""
        if name not in self._modules:
            module = sys.modules.get(name)
            if name in _PROGRAMS or name in self._homes or module is None:
                text = ""
            else:
                text = digest_of_files(files_of(module)) if _file_of(name) else name
            self._modules[name] = text
        return self._modules[name]

    def _class(self, kind: type) -> Iterator[str]:
        yield kind.__qualname__
        if module := self._module(home_of(kind)):
            yield module
            return
        yield from map(self.of, (type(kind), *kind.__bases__))
        for name, value in sorted(vars(kind).items()):
            if name not in _ASIDE and self._counts(home_of(kind), value):
                yield f"{name} = {self.of(value)}"

    def _function(self, function: FunctionType) -> Iterator[str]:
        yield function.__qualname__
        home, inside = function.__globals__.get("__name__", ""), vars(function)
        cells = [_content(cell) for cell in function.__closure__ or ()]
        if module := self._module(home):
            # What a decorator of an installed package makes of a function reaches that.
            yield module
            yield from map(self.of, filter(_has_code, cells))
            yield from (self.of(inside[name]) for name in ("__wrapped__", "registry") if name in inside)
            return
        yield self._source(function)
        yield from map(self.of, (function.__defaults__, function.__kwdefaults__, cells, inside))
        for name in sorted(set(_names(function.__code__)) & function.__globals__.keys()):
            if self._counts(home, function.__globals__[name]):
                yield f"{name} = {self.of(function.__globals__[name])}"
        if home in _PROGRAMS:
            yield digest_of_files(_imported_late(function))

    def _source(self, function: FunctionType) -> str:
        """Its source; what stands for its instructions where there is none."""
        if id(function) not in self._sources:
            try:
                text = _source_of(function.__code__)
            except (OSError, TypeError, SyntaxError, IndexError, tokenize.TokenError):
                text = self.of(function.__code__)
            self._sources[id(function)] = text
        return self._sources[id(function)]

    def _counts(self, home: str, value: Any) -> bool:
        """Whether a value of a place counts: of programs all, else code and plain values.

        An installed package may keep in others what it has met so far.
        """
        return home in _PROGRAMS or home not in sys.modules or type(value) in _PLAIN or _has_code(value)

    def _instructions(self, code: CodeType) -> Iterator[str]:
        yield f"{code.co_code.hex()} {code.co_names} {code.co_varnames}"
        yield from map(self.of, code.co_consts)

    def _object(self, value: Any) -> Iterator[str]:
        """What an object would be pickled as: it need not be possible."""
        reduced: Any
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                pickled = copyreg.dispatch_table.get(type(value))
                reduced = pickled(value) if pickled else value.__reduce_ex__(4)
            if isinstance(reduced, str):
                reduced = type(value), reduced
        except Exception:
            reduced = type(value), (), getattr(value, "__dict__", None)
        make, arguments, state, items, pairs = (*reduced, None, None, None)[:5]
        yield from map(self.of, (make, arguments, _lasting(type(value), state)))
        yield from map(self.of, items or ())
        yield from self._pairs(pairs or ())


def _hashed(data: str | bytes) -> str:
    text = data.encode(errors="backslashreplace") if isinstance(data, str) else data
    return hashlib.sha256(text).hexdigest()


def _array_of(value: Any) -> Any:
    """The bytes of a tensor of torch as an array, else None: pickled it holds an address in memory."""
    torch = sys.modules.get("torch")
    if torch is None or not isinstance(value, torch.Tensor):
        return None
    try:
        whole = value.detach().cpu().contiguous()
        return whole.reshape(*whole.shape, 1).view(torch.uint8).numpy()
    except Exception:  # a sparse one, or one without values
        return None


def _content(cell: Any) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # nothing is in it yet
        return None


def _lasting(kind: type, state: Any) -> Any:
    """The state of an object without what it only keeps for later."""
    if type(state) is tuple:
        return tuple(_lasting(kind, part) for part in state)
    if type(state) is not dict:
        return state
    of = {name: inspect.getattr_static(kind, str(name), None) for name in state}
    kept = {k: v for k, v in state.items() if not isinstance(of[k], functools.cached_property)}
    return kept or None  # as of an object that has none yet


def _names(code: CodeType) -> Iterator[str]:
    """Global names that a function, and those within it, may look up."""
    for step in dis.get_instructions(code):
        if step.opname.startswith("LOAD_") and ("GLOBAL" in step.opname or step.opname == "LOAD_NAME"):
            yield step.argval
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def _imported_late(function: FunctionType) -> dict[Path, bytes]:
    """The files beside a program that one of its functions imports when it runs, and what these import."""
    program = getattr(sys.modules.get(function.__globals__["__name__"]), "__file__", None)
    package = function.__globals__.get("__package__") or ""
    here = Path(program).resolve().parent if isinstance(program, str) else Path.cwd()
    top = here.parents[package.count(".")] if package else here
    return with_imports(contents(files_imported(function.__code__, here, [top], top)), top)


def _source_of(code: CodeType) -> str:
    """The source of a function itself, not of what it wraps; OSError where there is none.

    Inspect would look at every module there is before it finds that there is none.
    """
    place = code.co_filename
    if place.startswith("<") and place.endswith(">") and place not in linecache.cache:
        raise OSError(f"no source of {place}")
    return inspect.getsource(code)
