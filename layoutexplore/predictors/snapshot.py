"""A decision of an exploration, frozen, with the truth: what predictors are asked and learn from."""

from __future__ import annotations

from dataclasses import dataclass

from layoutexplore.frontiers.decision import Decision, Truth
from layoutexplore.grids.arrays import shows_shapes


@shows_shapes
@dataclass(frozen=True, eq=False)
class Snapshot:
    """A decision of an exploration, frozen.

    Attributes:
        plan: Name of the floor plan.
        building: Floors of one building are one cluster.
        sensor: Name of the sensor.
        seed: Of the start.
        coverage: The share of coverage it stands for.
        decision: The decision, without a prediction.
        truth: The floor plan.
    """

    plan: str
    building: str
    sensor: str
    seed: int
    coverage: float
    decision: Decision
    truth: Truth
