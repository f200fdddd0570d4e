"""Processes that are forked for workers by a server of the package's own; only for Linux.

That of all of multiprocessing belongs to the program: whoever asks it first decides what environment, signals
and modules the processes of both have, and those of `SubprocVecEnv` and of Python 3.14 come from there, too.
"""

from __future__ import annotations

import types
from multiprocessing import context, forkserver, popen_forkserver
from typing import Any

SERVER: Any = forkserver.ForkServer()
"""What is asked for workers."""


class _Started(popen_forkserver.Popen):
    """A process that `SERVER` has forked: begun as others are, where the global name of theirs means ours."""

    _launch = types.FunctionType(
        vars(popen_forkserver.Popen)["_launch"].__code__,
        vars(popen_forkserver)
        | {
            "forkserver": types.SimpleNamespace(
                connect_to_new_process=SERVER.connect_to_new_process, read_signed=forkserver.read_signed
            )
        },
    )


class ForkedProcess(context.ForkServerProcess):
    """A worker."""

    _Popen = staticmethod(_Started)


class ForkedContext(context.ForkServerContext):
    """What multiprocessing and pools start such workers with."""

    Process = ForkedProcess
