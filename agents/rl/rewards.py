"""The reward that the policies are trained with: the metres that the benchmark counts, and nothing else."""

from __future__ import annotations

from dataclasses import dataclass

from layoutexplore.envs.rewards import Transition
from layoutexplore.errors import ConfigError


@dataclass(frozen=True, kw_only=True)
class MetresToGo:
    """Minus the metres walked until 95 % and until 99 % is seen, as a share of the budget.

    The return of an episode is -scale (w95 d95 + w99 d99) / ((w95 + w99) budget). The budget, which grows with the building,
    makes buildings count alike; the policy does not know it. An end before 99 %, other than for lack of frontiers, costs the
    rest of the budget, as in the benchmark.

    Attributes:
        w95: Weight of d95.
        w99: Weight of d99.
        scale: Reward of walking the whole budget, with the sign changed.

    Example:
        >>> MetresToGo(scale=10.0)(Transition(20.0, 5.0, 0.97, 0.01, distance=60.0, budget=400.0))
        -0.25
    """

    w95: float = 1.0
    w99: float = 1.0
    scale: float = 20.0

    def __post_init__(self) -> None:
        if min(self.w95, self.w99) < 0 or self.w95 + self.w99 <= 0 or self.scale <= 0:
            raise ConfigError(f"reward weights must not be negative nor all zero, and the scale above 0: {self}")

    def __call__(self, transition: Transition) -> float:
        """The reward of a step; a level reached within it is charged the whole step."""
        before = transition.coverage - transition.coverage_gain
        early, late = before < 0.95, before < 0.99
        metres = transition.metres
        if transition.stop_reason not in ("", "coverage", "no_frontier"):
            metres += max(0.0, transition.budget - transition.distance)
        weight = self.w95 * early + self.w99 * late
        return -self.scale * weight / (self.w95 + self.w99) * metres / transition.budget
