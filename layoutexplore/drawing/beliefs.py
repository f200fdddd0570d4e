"""What a run believed of a plan known beforehand: how sure it was on the way, and where the plan lay.

A benchmark keeps it in a file of its own beside the run's, for the pictures of its report.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from layoutexplore.files import ArrayRule, read_arrays, write_arrays
from layoutexplore.grids.arrays import Bytes, Floats32, Ints32, shows_shapes
from layoutexplore.predictors.prior_plan import PriorPredictor
from layoutexplore.priors.completion import Compared, compared
from layoutexplore.simulation.episode import untimed
from layoutexplore.simulation.simulation import Simulation

SUFFIX = ".prior.npz"
"""Ending of the files."""

SHARES = (0.1, 0.3, 0.6)
"""Coverages at which the plan is kept as it was believed to lie."""


@shows_shapes
@dataclass(frozen=True, eq=False)
class BelievedPlan:
    """What one run believed.

    Attributes:
        way: float32 (decisions, 3), metres, coverage and confidence at each decision.
        at: int32 (pictures,), numbers of the decisions at which `maps` were kept.
        maps: uint8 (pictures, rows, cols), values of `layoutexplore.priors.completion.Compared`.
        resolution: Metres a cell.
    """

    way: Floats32
    at: Ints32
    maps: Bytes
    resolution: float


_RULES = {
    "way": ArrayRule(shape=("decisions", 3), low=0, high=1e9),
    "at": ArrayRule(kinds="iu", shape=("pictures",), low=0, high=1e6),
    "maps": ArrayRule(kinds="u", shape=("pictures", "rows", "cols"), high=len(Compared) - 1),
    "resolution": ArrayRule(shape=(1,), low=1e-6, high=1e6),
}


class BeliefNotes:
    """Notes one run: give `note` to `play`. Nothing is noted of runs without a plan known beforehand.

    Attributes:
        seconds: Time that noting took.
    """

    def __init__(self) -> None:
        self.seconds = 0.0
        self._way: list[tuple[float, float, float]] = []
        self._maps: list[tuple[int, Bytes]] = []
        self._resolution = 1.0

    def note(self, simulation: Simulation) -> None:
        """A decision is due, or the run is over."""
        predictor = untimed(simulation.predictor)
        if not isinstance(predictor, PriorPredictor) or simulation.done:
            return
        began = time.perf_counter()
        # The decision asks the predictor: what it believes is of now only afterwards.
        grid = simulation.decision.grid
        self._resolution = grid.resolution
        self._way.append((simulation.distance, simulation.coverage, predictor.confidence))
        due = SHARES[len(self._maps)] if len(self._maps) < len(SHARES) else 2.0
        if simulation.coverage >= due and predictor.registration is not None:
            self._maps.append((len(self._way) - 1, compared(grid, predictor.registration)))
        self.seconds += time.perf_counter() - began

    def noting_after(self, first: Callable[[Simulation], None]) -> Callable[[Simulation], None]:
        """For `play`: what calls another one before it notes."""

        def both(simulation: Simulation) -> None:
            first(simulation)
            self.note(simulation)

        return both

    def save(self, path: Path) -> None:
        """Write what was noted, if anything was, into a file that ends in `SUFFIX`."""
        if self._way:
            shape = self._maps[0][1].shape if self._maps else (0, 0)
            arrays: dict[str, NDArray[Any]] = {
                "way": np.array(self._way, np.float32),
                "at": np.array([k for k, _ in self._maps], np.int32),
                "maps": np.array([codes for _, codes in self._maps], np.uint8).reshape(-1, *shape),
                "resolution": np.array([self._resolution], np.float64),
            }
            write_arrays(path, arrays)


def believed_plan(path: str | os.PathLike[str]) -> BelievedPlan | None:
    """What a run believed; None where there is no such file: it had no plan known beforehand.

    Raises:
        ResultsError: The file is damaged.
    """
    path = Path(path)
    if not path.is_file():
        return None
    data = read_arrays(path, *_RULES, rules=_RULES)
    way, at = data["way"].astype(np.float32), data["at"].astype(np.int32)
    return BelievedPlan(way, at, data["maps"], float(data["resolution"][0]))
