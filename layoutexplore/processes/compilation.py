"""Says on the error stream that kernels are being compiled, when that is what takes so long."""

from __future__ import annotations

import multiprocessing
import sys
import time
from typing import Any

from numba.core import event

PATIENCE = 1.0
"""Seconds of compiling that pass without a word."""

WAITING = "layoutexplore:waiting for a kernel"
"""The event of waiting for another process that compiles a kernel."""

MESSAGE = (
    "layoutexplore: compiling kernels; this happens once, and takes some minutes for all of them "
    "(layoutexplore warm-up does it beforehand)"
)


class CompilationListener(event.Listener):
    """Hears of what numba really compiles, here or elsewhere; what it finds in its cache is no such event."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._began: list[float] = []
        self.is_silent = False

    def on_start(self, event: Any) -> None:
        """A kernel is compiled; those that it calls are compiled meanwhile."""
        del event
        if self.seconds > PATIENCE and not self.is_silent:
            self.is_silent = True
            print(MESSAGE, file=sys.stderr, flush=True)
        self._began.append(time.monotonic())

    def on_end(self, event: Any) -> None:
        """It has been."""
        del event
        began = self._began.pop()
        if not self._began:
            self.seconds += time.monotonic() - began


LISTENER = CompilationListener()
"""That of this process."""


def tell_of_compilation() -> None:
    """Begin to listen; in worker processes nothing is said: the one that started them does."""
    if multiprocessing.parent_process() is None:
        for kind in ("numba:compile", WAITING):
            event.register(kind, LISTENER)  # type: ignore[no-untyped-call]
