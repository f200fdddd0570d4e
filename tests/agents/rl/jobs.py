"""Jobs for worker processes; no module that needs torch, which every one of them would load."""

from __future__ import annotations

import os
import time
from collections.abc import Callable

Stop = Callable[[], bool]


def where(seconds: float, stop: Stop) -> tuple[float, int]:
    """A job: what it was, and the process that did it."""
    time.sleep(seconds)
    return seconds, os.getpid()


def wait_for_stop(seconds: float, stop: Stop) -> float:
    """A job that ends early when it is not wanted."""
    end = time.monotonic() + seconds
    while time.monotonic() < end and not stop():
        time.sleep(0.01)
    return seconds


def fail(text: str, stop: Stop) -> None:
    """A job that fails with a text, unless there is none."""
    if text:
        raise ValueError(text)


def die(status: int, stop: Stop) -> None:
    os._exit(status)
