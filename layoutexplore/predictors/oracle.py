"""The true rooms: the ceiling of prediction, also with a share of the rooms classified wrongly.

It foresees, too: the true plan, as far as a number of doors beyond the rooms that have been looked into, or
so many metres beyond the floor that is known; also with a share of it wrong, for the question how far, and
how rightly, a map has to be completed to shorten the way.
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
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, in_cells
from layoutexplore.predictors.protocol import GivenRooms, RoomLabels, with_classes
from layoutexplore.predictors.room_graph import RoomGraph, cells_ahead

FALSE_CLOSED_AREA = 0.3
"""Square metres that a frontier wrongly called closed is said to have left: little enough to be put off."""


WRONG_SIDE = 0.4
"""Metres: side of the squares in which what is foreseen is wrong."""


@checks_calls
class OraclePredictor:
    """The true rooms, optionally with a share of the rooms judged wrongly for a whole run.

    Args:
        flip: Probability 0..1 that a room's frontiers are given the wrong class, drawn once for a floor plan;
            a frontier wrongly called closed is said to have 0.3 m2 left.
        horizon: Doors beyond what is seen up to which the true plan is foreseen; 0 for the rest of the rooms
            that have been looked into, infinity for the whole floor.
        within: Metres beyond known floor up to which it is foreseen.
        wrong: Probability 0..1 that a square of `WRONG_SIDE` of what is foreseen is the contrary, floor for
            wall and wall for floor, drawn once for a floor plan; the confidence of foresight is 1 less this.

    Raises:
        ConfigError: A probability is outside 0..1, the horizon is no whole number of 0 or more, or the
            distance is not above 0.
    """

    def __init__(
        self, flip: float = 0.0, horizon: float = 0.0, within: float = math.inf, wrong: float = 0.0
    ) -> None:
        for name, value in (("flip", flip), ("wrong", wrong)):
            if not (math.isfinite(value) and 0 <= value <= 1):
                raise ConfigError(f"oracle: {name} is a probability 0..1, got {value}")
        if not (horizon >= 0 and (math.isinf(horizon) or horizon == int(horizon))):
            raise ConfigError(f"oracle: horizon is a number of doors, 0, 1, ... or inf, got {horizon}")
        if not within > 0:
            raise ConfigError(f"oracle: within is a distance in metres above 0, or inf, got {within}")
        self.flip, self.horizon, self.within, self.wrong = flip, horizon, within, wrong
        given = [f"flip={flip:g}"] * bool(flip) + [f"horizon={horizon:g}"] * bool(horizon)
        given += [f"within={within:g}"] * math.isfinite(within) + [f"wrong={wrong:g}"] * bool(wrong)
        self.name = f"oracle:{','.join(given)}" if given else "oracle"
        self._truth: Truth | None = None

    def reveal(self, truth: Truth) -> None:
        """Receive the truth of the run that begins."""
        self._truth = truth
        rng = np.random.default_rng(np.frombuffer(truth.plan.content_hash.encode(), np.uint8))
        rooms = int(truth.raster.room_ids.max()) + 1
        self._flipped: Mask = rng.random(rooms) < self.flip
        self._flipped[0] = False  # What lies in no room is no room.
        self._contrary = _squares(truth.raster.shape, truth.raster.resolution, self.wrong, rng)
        self._graph: RoomGraph | None = None
        self._ahead: tuple[Mask, Foresight] | None = None

    def predict(self, decision: Decision) -> Decision:
        """The decision with the true class and remaining area of every frontier, and with foresight."""
        rooms = GivenRooms(self.name, decision.grid, self.rooms(decision))
        judged = with_classes(decision, self._wrong(true_classes(decision, self._revealed)), rooms)
        return dataclasses.replace(judged, foresee=functools.partial(self._foresee, decision))

    def _foresee(self, decision: Decision) -> Foresight:
        """What is foreseen, near what is known if need be."""
        return self._up_to_horizon(decision).within(self.within, decision.grid.cells)

    def _up_to_horizon(self, decision: Decision) -> Foresight:
        """The plan up to the horizon; the same object as before where no further part is foreseen."""
        raster = self._revealed.raster
        self._graph = self._graph or RoomGraph(raster)
        here = decision.grid.nearest_cell(decision.pose.x, decision.pose.y)
        doors = self._graph.doors_to(decision.grid.cells, here)
        foreseen = np.isfinite(doors) & (doors <= self.horizon)
        if self._ahead is None or not np.array_equal(self._ahead[0], foreseen):
            cells = cells_ahead(self._graph.parts, foreseen)
            if self.wrong:
                contrary = np.where(cells == FREE, np.int8(OCCUPIED), np.int8(FREE))
                cells = np.where(self._contrary & (cells != UNKNOWN), contrary, cells)
            is_room = foreseen[self._graph.parts] & (cells == FREE)
            ids = np.where(is_room, raster.room_ids, 0).astype(np.int32)
            self._ahead = (
                foreseen,
                Foresight(
                    cells=cells,
                    room_ids=ids,
                    confidence=1.0 - self.wrong,
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


def _squares(shape: tuple[int, int], resolution: float, share: float, rng: np.random.Generator) -> Mask:
    """A share of the squares of a grid of that shape: bool (rows, cols)."""
    side = in_cells(WRONG_SIDE, resolution)
    drawn = rng.random([-(-size // side) for size in shape]) < share
    return np.asarray(drawn.repeat(side, 0).repeat(side, 1)[: shape[0], : shape[1]])
