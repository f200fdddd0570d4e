"""Processes that are forked for workers by a server of the package's own; only for Linux.

That of all of multiprocessing belongs to the program: whoever asks it first decides what environment, signals
and modules the processes of both have, and those of `SubprocVecEnv` and of Python 3.14 come from there, too.
"""

from __future__ import annotations

import contextlib
import types
from multiprocessing import context, forkserver, popen_forkserver
from typing import Any

from layoutexplore.processes import uninterrupted

SERVER: Any = forkserver.ForkServer()
"""What is asked for workers."""


_LAUNCH = vars(popen_forkserver.Popen)["_launch"].__code__


class _Started(popen_forkserver.Popen):
    """A process that `SERVER` has forked: begun as others are, where the global name of theirs means ours.

    Ctrl-C waits while the server and the worker are told what they need: whoever hears but half of it
    complains in a traceback of its own.
    """

    def _launch(self, process: Any) -> None:
        with contextlib.ExitStack() as telling:

            def connect(files: Any) -> Any:
                telling.enter_context(uninterrupted())
                return SERVER.connect_to_new_process(files)

            def hear(worker: int) -> Any:
                telling.close()
                return forkserver.read_signed(worker)

            ours = types.SimpleNamespace(connect_to_new_process=connect, read_signed=hear)
            types.FunctionType(_LAUNCH, vars(popen_forkserver) | {"forkserver": ours})(self, process)


class ForkedProcess(context.ForkServerProcess):
    """A worker."""

    _Popen = staticmethod(_Started)


class ForkedContext(context.ForkServerContext):
    """What multiprocessing and pools start such workers with."""

    Process = ForkedProcess
