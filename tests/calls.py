"""How much work something is, whatever the machine: its calls."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def counted_calls() -> Iterator[Counter[str]]:
    """Calls within the block that our code makes or takes, of Python ("call") and compiled ("c_call").

    What a library does inside differs from one version to the next.
    """
    calls: Counter[str] = Counter()

    def count(frame: FrameType, event: str, arg: object) -> None:
        if event.endswith("call") and frame.f_globals.get("__name__", "").startswith("layoutexplore"):
            calls[event] += 1

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        yield calls
    finally:
        sys.setprofile(before)
