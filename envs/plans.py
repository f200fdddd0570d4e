"""Which floor plan an episode takes place in."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence, Set
from typing import Any, Protocol, runtime_checkable

import numpy as np

from layoutexplore.errors import ConfigError, cause, shortened
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.library import cached_plan
from layoutexplore.options import check_kind
from layoutexplore.plugins.signatures import signature_of

MOST_PLANS = 200_000
"""So many floor plans an environment may draw from."""

OnePlan = FloorPlan | str | os.PathLike[str]
"""A floor plan, or the name or path of one."""


@runtime_checkable
class Curriculum(Protocol):
    """What draws a plan and is told how far the training is."""

    def draw(self, rng: np.random.Generator, progress: float) -> FloorPlan:
        """A plan for a progress of 0 ... 1."""


PlanSpec = OnePlan | Sequence[OnePlan] | Callable[[np.random.Generator], FloorPlan] | Curriculum
"""One plan, several, the name of a split, a folder, a function that draws a plan, or a `Curriculum`."""


class PlanSource:
    """Draws the floor plan of each episode.

    Plans are loaded when they are first drawn and are shared by all environments of the process.

    Args:
        spec: A `FloorPlan`; the name of a shipped plan, of a split ("train", "validation", "test") or of a
            generated plan ("office:7"); a path to a plan or to a folder of them; a sequence of these; a
            callable that is given a random generator and returns a plan; or a `Curriculum`. What a sequence
            names twice is drawn twice as often.

    Raises:
        ConfigError: There is no plan to draw from.
        MapError: A name or path does not exist.
    """

    def __init__(self, spec: PlanSpec) -> None:
        self._function: Any = None
        self._plans: list[FloorPlan | str] = []
        if callable(spec) or isinstance(spec, Curriculum):
            self._function = _drawing(spec)
        else:
            self._plans = _expand(spec)
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


def _drawing(function: Any) -> Any:
    """A function that draws plans, if it can be called as such."""
    curriculum = isinstance(function, Curriculum)
    try:
        signature = signature_of(function.draw if curriculum else function)
    except (TypeError, ValueError):  # of some that are no Python nobody knows what they take
        return function
    try:
        signature.bind(None, *[1.0] * curriculum)
    except TypeError as error:
        given = "a generator and a progress" if curriculum else "a random generator alone"
        raise ConfigError(
            f"a function that draws plans is called with {given}: {cause(error)}, got {shortened(function)}"
        ) from error
    return function


def _expand(spec: OnePlan | Sequence[OnePlan]) -> list[FloorPlan | str]:
    if isinstance(spec, FloorPlan):
        return [spec]
    if isinstance(spec, (str, os.PathLike)):
        from layoutexplore.maps import expand_plans

        return list(expand_plans(spec))
    if isinstance(spec, Iterator):
        raise ConfigError("plan is a generator, which may never end: put the plans into a list")
    try:
        if isinstance(spec, Set):
            raise ConfigError("plan is a set, whose order changes from process to process: take a list")
        if isinstance(spec, Collection) and not isinstance(spec, (bytes, Mapping)):
            plans: list[FloorPlan | str] = []
            for one in spec:
                plans += _expand(one)
                if len(plans) > MOST_PLANS:
                    raise ConfigError(f"plan holds more than {MOST_PLANS} floor plans, which is the most")
            return plans
    except (TypeError, RecursionError):  # an array without elements, a list that is in itself
        pass
    raise ConfigError(
        f"a plan is a FloorPlan, a name, a path, a sequence of these or a function, got {shortened(spec)}"
    )
