"""Which floor plan an episode takes place in."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from layoutexplore.errors import ConfigError, shortened
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.library import cached_plan
from layoutexplore.options import check_kind

OnePlan = FloorPlan | str | Path
"""A floor plan, or the name or path of one."""

PlanSpec = OnePlan | Sequence[OnePlan] | Callable[[np.random.Generator], FloorPlan]
"""One plan, several, the name of a split, a folder, or a function that draws a plan."""


@runtime_checkable
class Curriculum(Protocol):
    """A function that draws a plan and is told how far the training is."""

    def draw(self, rng: np.random.Generator, progress: float) -> FloorPlan:
        """A plan for a progress of 0 ... 1."""


class PlanSource:
    """Draws the floor plan of each episode.

    Plans are loaded when they are first drawn and are shared by all environments of the process.

    Args:
        spec: A `FloorPlan`; the name of a shipped plan, of a split ("train", "validation", "test") or of a
            generated plan ("office:7"); a path to a plan or to a folder of them; a sequence of these; or a
            callable that is given a random generator and returns a plan.

    Raises:
        ConfigError: There is no plan to draw from.
        MapError: A name or path does not exist.
    """

    def __init__(self, spec: PlanSpec) -> None:
        self._function: Any = spec if callable(spec) else None
        self._plans: list[FloorPlan | str] = [] if callable(spec) else _expand(spec)
        if self._function is None and not self._plans:
            raise ConfigError(f"no floor plan to explore in {shortened(spec)}")

    def draw(self, rng: np.random.Generator, progress: float = 1.0) -> tuple[int, FloorPlan]:
        """A plan, and its index among those given (0 of a callable); a `Curriculum` gets the progress."""
        if self._function is not None:
            curriculum = isinstance(self._function, Curriculum)
            drawn = self._function.draw(rng, progress) if curriculum else self._function(rng)
            check_kind("what a plan sampler draws", drawn, FloorPlan)
            return 0, drawn
        index = int(rng.integers(len(self._plans)))
        return index, load(self._plans[index])


def load(plan: OnePlan) -> FloorPlan:
    """A floor plan; what is read from a file or generated is kept for the next episode."""
    return plan if isinstance(plan, FloorPlan) else cached_plan(plan)


def _expand(spec: OnePlan | Sequence[OnePlan]) -> list[FloorPlan | str]:
    if isinstance(spec, FloorPlan):
        return [spec]
    if isinstance(spec, (str, Path)):
        from layoutexplore.maps import expand_plans

        return list(expand_plans(str(spec)))
    try:
        if isinstance(spec, Iterable) and not isinstance(spec, (bytes, Mapping)):
            return [plan for one in spec for plan in _expand(one)]
    except (TypeError, RecursionError):  # an array without elements, a list that is in itself
        pass
    raise ConfigError(
        f"a plan is a FloorPlan, a name, a path, a sequence of these or a function, got {shortened(spec)}"
    )
