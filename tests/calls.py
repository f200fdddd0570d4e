"""How much work something is, whatever the machine: its calls."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def counted_calls() -> Iterator[Counter[str]]:
    """Calls within the block by kind: "call" of Python, "c_call" of compiled functions."""
    calls: Counter[str] = Counter()

    def count(frame: object, event: str, arg: object) -> None:
        if event.endswith("call"):
            calls[event] += 1

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        yield calls
    finally:
        sys.setprofile(before)
