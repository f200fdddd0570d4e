"""Reward functions: small callables that turn one step of an environment into a number.

A reward is any callable that takes a `Transition`. The ones below are known by name; they measure what the benchmark
measures (metres until 99 % is seen) or the greedier quantities of other exploration environments, for comparison.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from layoutexplore.errors import ConfigError, unknown_name


class Transition(NamedTuple):
    """What one step did.

    Attributes:
        metres: Distance travelled in this step, with what turning costs.
        new_area: Floor that became known to be free in this step, in square metres.
        coverage: Share of the target area seen after the step, 0..1.
        coverage_gain: How much of that this step added.
        distance: Metres travelled since the start of the episode.
        budget: Metres after which the episode is truncated.
        stop_reason: Why the episode ended with this step (see `STOP_REASONS`); "" while it goes on.
    """

    metres: float
    new_area: float
    coverage: float
    coverage_gain: float
    distance: float
    budget: float
    stop_reason: str = ""


Reward = Callable[[Transition], float]
"""A reward function."""


def path_length(transition: Transition) -> float:
    """Minus the metres travelled as a share of the budget, times 10; at the end 10 when all is explored.

    Every metre costs the same whenever it is walked, so the return is highest for the shortest complete exploration. An
    end before everything is explored earns half the bonus times the coverage: always less than finishing, unless that
    would take more than half of the budget.

    Example:
        >>> path_length(Transition(20.0, 5.0, 0.5, 0.1, distance=60.0, budget=400.0))
        -0.5
        >>> path_length(Transition(20.0, 5.0, 0.99, 0.1, distance=60.0, budget=400.0, stop_reason="coverage"))
        9.5
    """
    reward = -10.0 * transition.metres / transition.budget
    if transition.stop_reason in ("coverage", "no_frontier"):
        return reward + 10.0
    return reward + 5.0 * transition.coverage if transition.stop_reason else reward


def area(transition: Transition) -> float:
    """Square metres of floor that became known. Teaches greed: the last rooms are not worth the way to them."""
    return transition.new_area


def area_per_metre(transition: Transition) -> float:
    """Square metres that became known per metre travelled; shorter steps count as one metre."""
    return transition.new_area / max(transition.metres, 1.0)


def coverage(transition: Transition) -> float:
    """Gain of coverage in per cent: the return of an episode is its final coverage less that of the first scan."""
    return 100.0 * transition.coverage_gain


REWARDS: dict[str, Reward] = {f.__name__: f for f in (path_length, area, area_per_metre, coverage)}
"""The reward functions that are known by name."""


def reward(name_or_callable: str | Reward) -> Reward:
    """The reward function of that name; a callable is returned as it is.

    Raises:
        UnknownNameError: No reward has that name.
        ConfigError: It is neither a name nor callable.
    """
    if isinstance(name_or_callable, str):
        if name_or_callable not in REWARDS:
            raise unknown_name("reward", name_or_callable, REWARDS)
        return REWARDS[name_or_callable]
    if not callable(name_or_callable):
        raise ConfigError(f"a reward is a name or a callable that takes a Transition, got {name_or_callable!r}")
    return name_or_callable
