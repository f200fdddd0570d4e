"""Stage timings of the layout methods."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

T = TypeVar("T")


class StageTimer:
    """Measures named stages one after the other; repeated names add up.

    Example:
        >>> timer = StageTimer()
        >>> with timer("segments"):
        ...     pass
        >>> list(timer.seconds)
        ['segments']
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        """Add the time of the body to a stage."""
        begin = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - begin

    def timed(self, stage: str, make: Callable[[], T]) -> Callable[[], T]:
        """The same function; the time of a call is added to a stage, where it is called at all."""

        def make_timed() -> T:
            with self(stage):
                return make()

        return make_timed
