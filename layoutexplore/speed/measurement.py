"""The row of a speed table, and the stopwatch."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

MARGIN = 0.8
"""A goal counts as missed when less than this share of it is reached."""


@dataclass(frozen=True, kw_only=True)
class SpeedRow:
    """One figure beside what it is compared with.

    Attributes:
        name: What was measured.
        ours: The figure.
        unit: Of `ours` and of `reference`.
        reference: The same figure of the reference, or None where the goal is absolute.
        reference_name: What the reference is.
        goal: The goal, in words.
        reached: Share of the goal that is reached; 1 or more is good. None where there is no goal.
        note: Where the time goes, or the like.
    """

    name: str
    ours: float
    unit: str
    reference: float | None = None
    reference_name: str = ""
    goal: str = ""
    reached: float | None = None
    note: str = ""

    @property
    def ratio(self) -> float | None:
        """How many times better than the reference, faster or quicker; None without one."""
        if self.reference is None:
            return None
        return self.ours / self.reference if self.unit.endswith("/s") else self.reference / self.ours

    @property
    def missed(self) -> bool:
        """Whether the goal is missed by more than the margin."""
        return self.reached is not None and self.reached < MARGIN

    def as_dict(self) -> dict[str, Any]:
        """The row as plain data."""
        return {**asdict(self), "ratio": self.ratio, "missed": self.missed}


@dataclass(frozen=True)
class Measurement:
    """A named function that gives rows."""

    name: str
    run: Callable[[], Iterator[SpeedRow]]


def milliseconds(*functions: Callable[[], object], repeats: int = 7, inner: int = 1) -> list[float]:
    """Median CPU time of each function in milliseconds.

    The functions take turns, after one call each to warm up.

    Args:
        functions: What to time.
        repeats: Number of turns.
        inner: Calls per turn.
    """
    taken: list[list[float]] = [[] for _ in functions]
    for function in functions:
        function()
    for _ in range(repeats):
        for function, times in zip(functions, taken, strict=True):
            start = time.process_time()
            for _ in range(inner):
                function()
            times.append((time.process_time() - start) / inner * 1e3)
    return [statistics.median(times) for times in taken]
