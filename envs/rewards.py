"""Reward functions: small callables that turn one step of an environment into a number.

A reward is any callable that takes a `Transition`. The ones below are known by name; they measure what the
benchmark measures (metres until 99 % is seen) or the greedier quantities of other exploration environments,
for comparison.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from layoutexplore.errors import ConfigError, shortened, unknown_name
from layoutexplore.metrics.exploration import FULLY_SEEN, NEARLY_SEEN
from layoutexplore.options import Rule, check


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
        metres_before_95: Of `metres`, those that were walked before 95 % coverage, linear between scans as in
            the benchmark.
        metres_before_99: The same for 99 %.
        reference: Metres that a fair exploration of this plan may take, about what going to the nearest
            frontier needs.
        rooms_finished: Rooms of which less than 1 m² is left to see after this step, for the first time, and
            to which the robot has not come twice.
        foreseen_area: Of `new_area`, what had been foreseen at the decision before, in square metres; 0
            without a predictor that foresees.
    """

    metres: float
    new_area: float
    coverage: float
    coverage_gain: float
    distance: float
    budget: float
    stop_reason: str = ""
    metres_before_95: float = 0.0
    metres_before_99: float = 0.0
    reference: float = 1.0
    rooms_finished: int = 0
    foreseen_area: float = 0.0


Reward = Callable[[Transition], float]
"""A reward function."""


def path_length(transition: Transition) -> float:
    """Minus the metres travelled as a share of the budget, times 10; at the end 10 when all is explored.

    All is explored where the coverage reaches its goal, or no frontier is left, whatever was missed.

    Every metre costs the same whenever it is walked, so the return is highest for the shortest complete
    exploration. An end before everything is explored earns half the bonus times the coverage: always less
    than finishing, unless that would take more than half of the budget.

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
    """Square metres of floor that became known. Teaches greed: the last rooms are not worth going there."""
    return transition.new_area


def area_per_metre(transition: Transition) -> float:
    """Square metres that became known per metre travelled; shorter steps count as one metre."""
    return transition.new_area / max(transition.metres, 1.0)


def coverage(transition: Transition) -> float:
    """Gain of coverage in per cent: an episode's return is its final coverage less that of the first scan."""
    return 100.0 * transition.coverage_gain


@dataclass(frozen=True, kw_only=True)
class PathToMarks:
    """Minus the metres travelled before 95 and 99 % coverage, as shares of the reference.

    The return of an episode is -(weight_95 d95 + weight_99 d99) / reference: the two lengths that the
    benchmark reports, but for runs that end without a frontier before a threshold, as noise can make them:
    the benchmark charges them the budget, the return the metres they have walked. The step that crosses a
    threshold is charged only for the metres up to it. Who gives up (stops, or acts invalidly until the
    episode is cut off) pays for a threshold not reached as if the rest of the budget had been walked.

    Attributes:
        weight_95: What a metre before 95 % costs.
        weight_99: What a metre before 99 % costs; before 95 % both are charged.

    Raises:
        ConfigError: A weight is not a number from 0 to a million.

    Example:
        >>> step = Transition(20.0, 5.0, 0.96, 0.1, 60.0, 400.0, "", 15.0, 20.0, reference=100.0)
        >>> PathToMarks()(step)
        -0.35
    """

    weight_95: float = 1.0
    weight_99: float = 1.0

    def __post_init__(self) -> None:
        weight = Rule(low=0.0, high=1e6)
        check(self, weight_95=weight, weight_99=weight)

    def __call__(self, transition: Transition) -> float:
        """The reward of a step."""
        early, late = transition.metres_before_95, transition.metres_before_99
        if transition.stop_reason in ("agent", "invalid_actions"):
            rest = max(0.0, transition.budget - transition.distance)
            early += rest * (transition.coverage < NEARLY_SEEN)
            late += rest * (transition.coverage < FULLY_SEEN)
        return -(self.weight_95 * early + self.weight_99 * late) / transition.reference


@dataclass(frozen=True, kw_only=True)
class RoomArea:
    """Square metres that became known per metre travelled, and a bonus for rooms that need no second visit.

    Attributes:
        bonus: For every room that is finished on the first visit, or without one.

    Example:
        >>> RoomArea()(Transition(4.0, 6.0, 0.5, 0.1, 40.0, 200.0, rooms_finished=2))
        11.5
    """

    bonus: float = 5.0

    def __call__(self, transition: Transition) -> float:
        """The reward of a step."""
        return area_per_metre(transition) + self.bonus * transition.rooms_finished


def foreseen_area(transition: Transition) -> float:
    """Square metres per metre travelled that had been foreseen and came into view; shorter steps are a metre.

    Zero wherever nothing is foreseen: a term to add to another reward.

    Example:
        >>> foreseen_area(Transition(4.0, 6.0, 0.5, 0.1, 40.0, 200.0, foreseen_area=5.0))
        1.25
    """
    return transition.foreseen_area / max(transition.metres, 1.0)


REWARDS: dict[str, Reward] = {
    "path_length": path_length,
    "path_to_marks": PathToMarks(),
    "area": area,
    "area_per_metre": area_per_metre,
    "room_area": RoomArea(),
    "coverage": coverage,
    "foreseen_area": foreseen_area,
}
"""The reward functions that are known by name."""


def reads_rooms(function: Reward) -> bool:
    """Whether a reward may read `Transition.rooms_finished`; where none does, nothing is counted."""
    return type(function) is RoomArea or not _ships(function)


def reads_foresight(function: Reward) -> bool:
    """Whether a reward may read `Transition.foreseen_area`; where none does, nothing is counted."""
    return function is foreseen_area or not _ships(function)


def _ships(function: Reward) -> bool:
    """Whether it is one of the above: of a class derived from one of theirs nobody knows what it reads."""
    return type(function) in (PathToMarks, RoomArea) or any(function is known for known in REWARDS.values())


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
        raise ConfigError(
            f"a reward is a name or a callable that takes a Transition, got {shortened(name_or_callable)}"
        )
    return name_or_callable
