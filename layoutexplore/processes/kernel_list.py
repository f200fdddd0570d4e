"""A list of kernels and what they are compiled for, so that several processes compile them in any order.

At their first use kernels are compiled one after another, as the work comes to them: two processes that do so
wait for each other most of the time.
"""

from __future__ import annotations

import functools
import importlib
import json
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import as_completed
from concurrent.futures.process import BrokenProcessPool
from importlib import resources
from typing import Any, NamedTuple

import numpy as np
from numba import from_dtype, types

from layoutexplore.processes.kernel_freshness import look_at_sources
from layoutexplore.processes.pools import start_pool, stop_pool

FILE = "kernels.json"

LARGE_MAP = "a large map"
"""What is needed of the list besides where a floor plan `is_large` (see `layoutexplore.simulation.state`)."""

_PLAIN = (types.Number, types.Boolean)
_NAMED: Any = types.BaseNamedTuple
_TUPLE: Any = types.BaseTuple

Told = Callable[[int, int], object]
"""Is told how many kernels of how many have been compiled, or given up."""


class Kernel(NamedTuple):
    """A kernel for arguments of certain types.

    Attributes:
        name: Of its module and of the function in it.
        types: Of its arguments, as JSON (see `spelled`).
    """

    name: str
    types: str


def compile_kernels(kernels: Sequence[Kernel], jobs: int, told: Told = lambda done, total: None) -> None:
    """Compile kernels, for the cache; what a worker that dies leaves is compiled at its first use.

    Args:
        kernels: None before one that it calls.
        jobs: Processes.
        told: See `Told`.
    """
    if not kernels:
        return
    try:
        pool = start_pool(min(jobs, len(kernels)), int)
    except (BrokenProcessPool, OSError, EOFError, AssertionError):  # the last in a multiprocessing.Pool
        return
    try:
        for done, future in enumerate(as_completed([pool.submit(_compile, k) for k in kernels]), 1):
            future.result()
            told(done, len(kernels))
    except BrokenProcessPool:
        told(len(kernels), len(kernels))
    finally:
        stop_pool(pool)


def compile_before(
    uses: Iterable[str], jobs: int, say: Callable[[str], object], told: Told = lambda done, total: None
) -> None:
    """Compile what some uses need and no cache has, unless there is one process only to do it.

    Args:
        uses: As of `missing_kernels`.
        jobs: Processes.
        say: Told that it begins.
        told: See `Told`.
    """
    if jobs > 1 and (missing := missing_kernels(uses)):
        say(f"compiling {len(missing)} kernel{'s' * (len(missing) > 1)}, kept for the next time")
        compile_kernels(missing, jobs, told)


def missing_kernels(uses: Iterable[str]) -> list[Kernel]:
    """The kernels of the list that some of these uses need, and that no cache has yet."""
    return [kernel for kernel in listed_kernels(uses) if not is_kept(kernel)]


def uses_of_runs(agents: Iterable[str], sensors: Iterable[str], *, predicts: bool) -> set[str]:
    """What explorations need of what the list knows; own agents and sensors it does not know.

    Args:
        agents: Their agents, with or without options.
        sensors: Their lidars.
        predicts: Whether rooms are predicted.
    """
    uses = {f"agent {agent.partition(':')[0]}" for agent in agents} | {f"sensor {name}" for name in sensors}
    return uses | {"a floor plan"} | ({"a whole exploration"} if predicts else set())


def listed_kernels(uses: Iterable[str]) -> list[Kernel]:
    """The kernels of the list that some of these uses need; none comes before one that it calls."""
    listed, wanted = _read(), set(uses)
    numbers = {k for k, use in enumerate(listed["uses"]) if use in wanted}
    return [Kernel(name, json.dumps(of)) for name, of, needed in listed["kernels"] if numbers & set(needed)]


@functools.cache
def _read() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(resources.files(__package__).joinpath(FILE).read_text("utf-8"))
    return found


def is_kept(kernel: Kernel) -> bool:
    """Whether the cache of this machine has a kernel; True, too, of one that the program no longer has."""
    try:
        dispatcher, arguments = resolved(kernel)
        cache = dispatcher._cache
        look_at_sources(cache)
        key = cache._index_key(arguments, dispatcher.targetctx.codegen())
        return key in cache._cache_file._load_index()
    except Exception:  # another numba, or a list that is older than the program
        return True


def _compile(kernel: Kernel) -> None:
    """What a worker does. A kernel that is not compiled here is at its first use, where its error is told."""
    try:
        dispatcher, arguments = resolved(kernel)
        dispatcher.compile(arguments)
    except Exception:
        return


def resolved(kernel: Kernel) -> tuple[Any, tuple[types.Type, ...]]:
    """The function of a kernel, and the types of its arguments.

    Raises:
        ImportError: There is no such module.
        AttributeError: There is no such function, or class of a named tuple.
    """
    dispatcher = _named(kernel.name)
    return dispatcher, tuple(meant(text) for text in json.loads(kernel.types))


def _named(name: str) -> Any:
    module, _, function = name.partition(":")
    return getattr(importlib.import_module(module), function)


def spelled(kind: Any) -> Any:
    """A type as JSON: `int64`, `uint8 2C` (array; with `!` one that is only read), lists and named tuples.

    Raises:
        TypeError: It is of another kind.

    Example:
        >>> spelled(types.UniTuple(types.Array(types.uint8, 2, "C"), 2))
        ['uint8 2C', 'uint8 2C']
    """
    if isinstance(kind, types.Array) and kind.aligned and isinstance(kind.dtype, _PLAIN):
        return f"{kind.dtype} {kind.ndim}{kind.layout}{'' if kind.mutable else '!'}"
    if isinstance(kind, _NAMED):
        of = kind.instance_class
        return {f"{of.__module__}:{of.__qualname__}": [spelled(part) for part in kind.types]}
    if isinstance(kind, _TUPLE):
        return [spelled(part) for part in kind.types]
    if isinstance(kind, _PLAIN) and not isinstance(kind, types.Literal):
        return str(kind)
    raise TypeError(str(kind))


def meant(text: Any) -> Any:
    """The type that `spelled` made a text of."""
    if isinstance(text, list):
        return _TUPLE.from_types([meant(part) for part in text])
    if isinstance(text, dict):
        [(name, parts)] = text.items()
        return _TUPLE.from_types([meant(part) for part in parts], _named(name))
    name, _, shape = text.partition(" ")
    number = from_dtype(np.dtype(name))
    return types.Array(number, int(shape[0]), shape[1], readonly=shape.endswith("!")) if shape else number
