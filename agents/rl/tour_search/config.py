"""What decides a search for the parameters of a tour."""

from __future__ import annotations

from dataclasses import dataclass

from layoutexplore.errors import ConfigError
from layoutexplore.options import Rule, check


@dataclass(frozen=True, kw_only=True)
class SearchConfig:
    """Search for the parameters of a tour by whole explorations; see `layoutexplore.agents.rl.tour_search`.

    Attributes:
        round: Explorations between two moves of the centre.
        pairs: Mirrored pairs of draws that explore the same floor plan from the same start.
        spread: Standard deviation of the draws around the centre, in units of each parameter's scale.
        trust: How far the centre moves at most in a round, in the same units.
        outlier: Logarithm of metres; what deviates by more from the mean of its floor plan counts as this
            much.
    """

    round: int = 240
    pairs: int = 2
    spread: float = 0.7
    trust: float = 0.7
    outlier: float = 0.4

    def __post_init__(self) -> None:
        count, length = Rule(kind=int, low=1, high=1e5), Rule(above=0.0, high=10.0)
        check(self, "search.", round=count, pairs=count, spread=length, trust=length, outlier=length)
        if self.round % (2 * self.pairs):
            raise ConfigError(
                f"search.round must be a multiple of twice search.pairs, got {self.round} and {self.pairs}"
            )
