"""The true rooms: the ceiling of prediction, also with a share of the rooms classified wrongly."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from layoutexplore.errors import ConfigError
from layoutexplore.frontiers.classes import FrontierClasses, true_classes
from layoutexplore.frontiers.decision import Decision, Truth
from layoutexplore.grids.arrays import Mask
from layoutexplore.predictors.protocol import GivenRooms, RoomLabels, with_classes

FALSE_CLOSED_AREA = 0.3
"""Square metres that a frontier wrongly called closed is said to have left: little enough to be put off."""


class OraclePredictor:
    """The true rooms, optionally with a share of the rooms judged wrongly for a whole run.

    Args:
        flip: Probability 0..1 that a room's frontiers are given the wrong class; a frontier wrongly called
            closed is said to have 0.3 m2 left.

    Raises:
        ConfigError: The probability is outside 0..1.
    """

    def __init__(self, flip: float = 0.0) -> None:
        if not (math.isfinite(flip) and 0 <= flip <= 1):
            raise ConfigError(f"oracle: flip is a probability 0..1, got {flip}")
        self.flip = flip
        self.name = f"oracle:flip={flip:g}" if flip else "oracle"
        self._truth: Truth | None = None

    def reveal(self, truth: Truth) -> None:
        """Receive the truth of the run that begins."""
        self._truth = truth
        rng = np.random.default_rng(np.frombuffer(truth.plan.content_hash.encode(), np.uint8))
        rooms = int(truth.raster.room_ids.max()) + 1
        self._flipped: Mask = rng.random(rooms) < self.flip

    def predict(self, decision: Decision) -> Decision:
        """The decision with the true class and remaining area of every frontier."""
        assert self._truth is not None, "a simulation reveals the truth before the first decision"
        rooms = GivenRooms(self.name, decision.grid, self.rooms(decision))
        return with_classes(decision, self._wrong(true_classes(decision, self._truth)), rooms)

    def rooms(self, decision: Decision) -> RoomLabels:
        """The true rooms."""
        assert self._truth is not None, "a simulation reveals the truth before the first decision"
        return RoomLabels(self._truth.raster.room_ids, self._truth.raster.free)

    def _wrong(self, classes: FrontierClasses) -> FrontierClasses:
        wrong = self._flipped[classes.room]
        if not wrong.any():
            return classes
        is_closed = classes.is_closed ^ wrong
        area = np.where(wrong & is_closed, FALSE_CLOSED_AREA, classes.remaining_area)
        return dataclasses.replace(classes, is_closed=is_closed, remaining_area=area)
