"""How the list of kernels is made: what is compiled is watched, in processes that begin with none."""

from __future__ import annotations

import functools
import gc
import json
import sys
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from numba.core import sigutils
from numba.core.caching import Cache
from numba.core.dispatcher import Dispatcher

from layoutexplore.processes.kernel_list import Kernel, spelled
from layoutexplore.processes.pools import start_pool, stop_pool

_parts: Any = sigutils.normalize_signature

Calls = dict[Kernel, set[Kernel]]
"""Kernels by those that call them."""


def record_kernels(uses: Sequence[str], do: Callable[[str], object]) -> str:
    """The text of a list of kernels.

    Args:
        uses: Names of what kernels are needed for.
        do: Does what is so called; picklable.
    """
    calls = _apart(_calls, uses, do)
    needed: dict[Kernel, set[int]] = defaultdict(set)
    for number, use in enumerate(uses):
        for kernel in _below(_apart(used_kernels, use, do), calls):
            needed[kernel].add(number)

    @functools.cache
    def height(kernel: Kernel) -> int:
        """The longest way to it from one that no other calls."""
        return max((height(caller) + 1 for caller, called in calls.items() if kernel in called), default=0)

    order = sorted(needed, key=lambda kernel: (-height(kernel), kernel))
    lines = [f'["{k.name}", {k.types}, {sorted(needed[k])}]' for k in order]
    return f'{{"uses": {json.dumps(uses)},\n"kernels": [\n' + ",\n".join(lines) + "\n]}\n"


def _apart(function: Callable[..., Any], *arguments: Any) -> Any:
    """What a function returns in a new process."""
    pool = start_pool(1, int)
    try:
        return pool.submit(function, *arguments).result()
    finally:
        stop_pool(pool)


def _calls(uses: Iterable[str], do: Callable[[str], object]) -> Calls:
    """All kernels that are compiled, in a process that finds none in the cache, and those that each calls."""
    calls: Calls = {}
    callers: list[Kernel | None] = []
    compiled: Any = Dispatcher.compile

    def compile(dispatcher: Any, signature: Any) -> Any:
        kernel = _kernel(dispatcher, _parts(signature)[0])
        if kernel is not None:
            calls.setdefault(kernel, set())
            # What a function without a name of its own calls, its caller calls.
            if (caller := next(filter(None, reversed(callers)), None)) is not None:
                calls[caller].add(kernel)
        callers.append(kernel)
        try:
            return compiled(dispatcher, signature)
        finally:
            callers.pop()

    Dispatcher.compile = compile  # type: ignore[assignment, method-assign]
    Cache.load_overload = lambda *arguments: None  # type: ignore[method-assign]
    for use in uses:
        do(use)
    return calls


def used_kernels(use: str, do: Callable[[str], object]) -> set[Kernel]:
    """The kernels that this process has after one use, but for those of the cache that others call."""
    do(use)
    found = [it for it in gc.get_objects() if isinstance(it, Dispatcher)]
    kernels = {_kernel(it, signature) for it in found for signature in it.signatures}
    return {kernel for kernel in kernels if kernel is not None}


def _kernel(dispatcher: Any, types: Sequence[Any]) -> Kernel | None:
    """None of another package, and of what no list can name: functions in functions, rare types."""
    function = dispatcher.py_func
    if not function.__module__.startswith("layoutexplore."):
        return None
    if getattr(sys.modules[function.__module__], function.__name__, None) is not dispatcher:
        return None
    name = f"{function.__module__}:{function.__qualname__}"
    try:
        return Kernel(name, json.dumps([spelled(kind) for kind in types]))
    except TypeError:
        return None


def _below(kernels: Iterable[Kernel], calls: Calls) -> set[Kernel]:
    """Kernels, all that they call, and so on."""
    found: set[Kernel] = set()
    waiting = list(kernels)
    while waiting:
        kernel = waiting.pop()
        if kernel not in found:
            found.add(kernel)
            waiting += calls.get(kernel, ())
    return found
