"""Predicts, at a decision, the rooms, and from them each frontier's class and the area behind it."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from layoutexplore.frontiers.classes import FrontierClasses, classify_frontiers
from layoutexplore.frontiers.decision import Decision, FrontierList


@dataclass(frozen=True, eq=False)
class RoomLabels:
    """Predicted rooms.

    Attributes:
        room_ids: int32 (rows, cols), the room of each cell, 0 for none.
        passable: bool (rows, cols), cells that are free, known or predicted.
    """

    room_ids: NDArray[np.int32]
    passable: NDArray[np.bool_]


class RoomPredictor(Protocol):
    """A predictor that says what the rooms look like."""

    name: str

    def rooms(self, decision: Decision) -> RoomLabels:
        """The predicted rooms of a decision with at least one frontier."""

    def predict(self, decision: Decision) -> Decision:
        """The decision with a class and an expected area for every frontier."""


def classes_in(rooms: RoomLabels, decision: Decision) -> FrontierClasses:
    """The classes of a decision's frontiers against predicted rooms, by the rule that holds for the true ones."""
    grid = decision.grid
    return classify_frontiers(grid.cells, decision.clusters, rooms.room_ids, rooms.passable, grid.resolution)


def with_classes(
    decision: Decision, classes: FrontierClasses, confidence: NDArray[np.float64] | None = None
) -> Decision:
    """The decision with classes, areas and rooms written into its frontiers.

    Args:
        decision: The decision.
        classes: One entry a frontier.
        confidence: float64 (k,), probability that each class is right; 1 when None.
    """
    count = len(decision.frontiers)
    frontiers = FrontierList(decision.clusters, np.arange(count), decision.table, decision.viewpoints)
    sure = np.ones(count) if confidence is None else confidence
    judged = frontiers.judged(classes.is_closed, classes.remaining_area, sure, classes.room)
    return dataclasses.replace(decision, frontiers=judged)
