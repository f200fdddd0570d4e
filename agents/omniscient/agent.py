"""An agent that knows the floor plan: how short an exploration could be.

No online strategy can be expected to reach it. It is an estimate from above of the shortest exploration: its
route is short, not provably shortest.
"""

from __future__ import annotations

from dataclasses import dataclass

from layoutexplore.agents.base import register
from layoutexplore.agents.greedy import Nearest, NearestOptions
from layoutexplore.agents.omniscient.route_planner import RouteConfig, RoutePlanner
from layoutexplore.errors import ConfigError
from layoutexplore.frontiers.decision import STOP, Choice, Decision, Truth
from layoutexplore.grids.arrays import Ints32
from layoutexplore.grids.grid import Cell
from layoutexplore.metrics.exploration import FULLY_SEEN, NEARLY_SEEN
from layoutexplore.options import SEED, Options, check_kind, option
from layoutexplore.planning.shortest_paths import descend, geodesic_distances


@dataclass(frozen=True, kw_only=True)
class ClairvoyantOptions(Options):
    """Parameters of `Clairvoyant`."""

    coverage: float = option(
        FULLY_SEEN, "share of the target that the route is planned to see", low=0.01, high=1.0
    )
    early: float = option(NEARLY_SEEN, "share that is planned to be seen early", low=0.0, high=1.0)
    early_weight: float = option(1.5, "what a metre before that costs more than one after it", low=0.0)
    rounds: int = option(30, "how often a stretch of the route is planned anew", low=0)


class Clairvoyant:
    """Follows a short route from which the wanted share of the true plan is seen, then goes to the nearest.

    Args:
        name: What it is called in results.
        options: Its parameters.
    """

    def __init__(self, name: str, options: ClairvoyantOptions) -> None:
        self.name = name
        self.options = options
        self._rest = Nearest(name, NearestOptions())
        self.reset(0)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.name}>"

    def reset(self, seed: int) -> None:
        """Forget the floor plan; `reveal` must follow."""
        SEED.convert("seed", seed)
        self._truth: Truth | None = None
        self._stops: Ints32 | None = None
        self._next = 0

    def reveal(self, truth: Truth) -> None:
        """Receive the floor plan of the run that begins."""
        check_kind("truth", truth, Truth)
        self._truth = truth
        self._stops = None
        self._next = 0

    def act(self, decision: Decision) -> Choice:
        """The way to the next stop of the route; the nearest frontier after the last.

        Raises:
            ConfigError: The floor plan was not revealed.
        """
        if self._truth is None:
            raise ConfigError(
                f"agent {self.name!r} has to know the floor plan: call reveal(simulation.truth) after reset"
            )
        check_kind("decision", decision, Decision)
        here = decision.grid.world_to_cell(decision.pose.x, decision.pose.y)
        if self._stops is None:
            config = RouteConfig(
                coverage=self.options.coverage,
                early_coverage=self.options.early,
                early_weight=self.options.early_weight,
                rounds=self.options.rounds,
            )
            self._stops = RoutePlanner.of(self._truth, config).plan(here)
        while self._next < len(self._stops):
            row, col = self._stops[self._next]
            self._next += 1
            if (row, col) != here:
                distances = geodesic_distances(self._truth.reachable, here, decision.grid.resolution)
                return descend(distances, self._truth.reachable, Cell(int(row), int(col)))
        return self._rest.act(decision) if decision.frontiers else STOP


register(
    "clairvoyant",
    "knows the floor plan: a short route that sees 99 % (a bound, not a strategy)",
    Clairvoyant,
    ClairvoyantOptions(),
)
