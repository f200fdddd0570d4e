"""The true rooms: the ceiling of prediction, also with a share of the rooms classified wrongly.

It foresees, too: the true plan, as far as a number of doors beyond the rooms that have been looked into.
"""

from __future__ import annotations

import dataclasses
import functools
import math

import numpy as np

from layoutexplore.errors import ConfigError, checks_calls
from layoutexplore.frontiers.classes import FrontierClasses, true_classes
from layoutexplore.frontiers.decision import Decision, Truth
from layoutexplore.frontiers.foresight import Foresight
from layoutexplore.grids.arrays import Mask
from layoutexplore.predictors.protocol import GivenRooms, RoomLabels, with_classes
from layoutexplore.predictors.room_graph import RoomGraph, cells_ahead

FALSE_CLOSED_AREA = 0.3
"""Square metres that a frontier wrongly called closed is said to have left: little enough to be put off."""


@checks_calls
class OraclePredictor:
    """The true rooms, optionally with a share of the rooms judged wrongly for a whole run.

    Args:
        flip: Probability 0..1 that a room's frontiers are given the wrong class, drawn once for a floor plan;
            a frontier wrongly called closed is said to have 0.3 m2 left.
        horizon: Doors beyond what is seen up to which the true plan is foreseen; 0 for the rest of the rooms
            that have been looked into, infinity for the whole floor.

    Raises:
        ConfigError: The probability is outside 0..1, or the horizon is no whole number of 0 or more.
    """

    def __init__(self, flip: float = 0.0, horizon: float = 0.0) -> None:
        if not (math.isfinite(flip) and 0 <= flip <= 1):
            raise ConfigError(f"oracle: flip is a probability 0..1, got {flip}")
        if not (horizon >= 0 and (math.isinf(horizon) or horizon == int(horizon))):
            raise ConfigError(f"oracle: horizon is a number of doors, 0, 1, ... or inf, got {horizon}")
        self.flip, self.horizon = flip, horizon
        given = [f"flip={flip:g}"] * bool(flip) + [f"horizon={horizon:g}"] * bool(horizon)
        self.name = f"oracle:{','.join(given)}" if given else "oracle"
        self._truth: Truth | None = None

    def reveal(self, truth: Truth) -> None:
        """Receive the truth of the run that begins."""
        self._truth = truth
        rng = np.random.default_rng(np.frombuffer(truth.plan.content_hash.encode(), np.uint8))
        rooms = int(truth.raster.room_ids.max()) + 1
        self._flipped: Mask = rng.random(rooms) < self.flip
        self._flipped[0] = False  # What lies in no room is no room.
        self._graph: RoomGraph | None = None
        self._ahead: tuple[Mask, Foresight] | None = None

    def predict(self, decision: Decision) -> Decision:
        """The decision with the true class and remaining area of every frontier, and with foresight."""
        rooms = GivenRooms(self.name, decision.grid, self.rooms(decision))
        judged = with_classes(decision, self._wrong(true_classes(decision, self._revealed)), rooms)
        return dataclasses.replace(judged, foresee=functools.partial(self._foresee, decision))

    def _foresee(self, decision: Decision) -> Foresight:
        """The true plan up to the horizon; the same object as before where no further part is foreseen."""
        raster = self._revealed.raster
        self._graph = self._graph or RoomGraph(raster)
        here = decision.grid.nearest_cell(decision.pose.x, decision.pose.y)
        doors = self._graph.doors_to(decision.grid.cells, here)
        foreseen = np.isfinite(doors) & (doors <= self.horizon)
        if self._ahead is None or not np.array_equal(self._ahead[0], foreseen):
            cells = cells_ahead(self._graph.parts, foreseen)
            ids = np.where(foreseen[self._graph.parts], raster.room_ids, 0).astype(np.int32)
            self._ahead = (
                foreseen,
                Foresight(
                    cells=cells,
                    room_ids=ids,
                    confidence=1.0,
                    predictor=self.name,
                    resolution=raster.resolution,
                ),
            )
        return self._ahead[1]

    def rooms(self, decision: Decision) -> RoomLabels:
        """The true rooms."""
        raster = self._revealed.raster
        return RoomLabels(raster.room_ids.astype(np.int32), raster.free)

    @property
    def _revealed(self) -> Truth:
        if self._truth is None:
            raise ConfigError(f"{self.name} knows no plan yet: a simulation reveals it when a run begins")
        return self._truth

    def _wrong(self, classes: FrontierClasses) -> FrontierClasses:
        wrong = self._flipped[classes.room]
        if not wrong.any():
            return classes
        is_closed = classes.is_closed ^ wrong
        area = np.where(wrong & is_closed, FALSE_CLOSED_AREA, classes.remaining_area)
        return dataclasses.replace(classes, is_closed=is_closed, remaining_area=area)
