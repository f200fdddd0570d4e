"""Predicts, at a decision, the rooms, and from them each frontier's class and the area behind it."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from layoutexplore.errors import ConfigError, checks_arguments, checks_making
from layoutexplore.frontiers.classes import FrontierClasses, classify_frontiers
from layoutexplore.frontiers.decision import Decision, PredictedRooms
from layoutexplore.frontiers.table import FrontierList
from layoutexplore.grids.arrays import Floats, Floats32, Ints32, Mask, check_alike, shows_shapes
from layoutexplore.grids.grid import UNKNOWN, OccupancyGrid
from layoutexplore.layout.outlines import layout_of_labels
from layoutexplore.layout.timing import StageTimer
from layoutexplore.layout.types import Layout


@checks_making
@shows_shapes
@dataclass(frozen=True, eq=False)
class RoomLabels:
    """Predicted rooms; lists become arrays.

    Attributes:
        room_ids: int32 (rows, cols), the room of each cell, 0 for none.
        passable: bool (rows, cols), cells that are free, known or predicted.
        rest: The id that stands for the unseen rest of the building, 0 where there is none.

    Raises:
        ConfigError: The two have different shapes.
    """

    room_ids: Ints32
    passable: Mask
    rest: int = 0

    def __post_init__(self) -> None:
        for name in ("room_ids", "passable"):
            object.__setattr__(self, name, np.asarray(getattr(self, name)))
        check_alike("RoomLabels", room_ids=self.room_ids, passable=self.passable)


class RoomsOnGrid:
    """Predicted rooms of a grid, completed when they are asked for.

    It keeps the protocol `layoutexplore.frontiers.decision.PredictedRooms`.

    Args:
        name: Of the predictor.
        grid: What the robot knows; its cells are not copied.
    """

    def __init__(self, name: str, grid: OccupancyGrid) -> None:
        self._name, self._grid = name, grid

    @property
    def rooms(self) -> RoomLabels:
        """The completed rooms, and the unseen rest of the building as one more where there is one."""
        raise NotImplementedError

    @property
    def labels(self) -> Ints32:
        """int32 (rows, cols): the predicted room of each cell, seen or not, 0 for none."""
        ids, rest = self.rooms.room_ids, self.rooms.rest
        return np.where(ids == rest, np.int32(0), ids)

    @property
    def sketch(self) -> Ints32:
        """int32 (rows, cols): the rooms as `labels`, or a sketch of them where that is had for less."""
        return self.labels

    @cached_property
    def inside(self) -> Floats32:
        """float32 (rows, cols): 1 where an unknown cell is predicted to belong to a room, 0 elsewhere."""
        hidden: Mask = (self.labels > 0) & (self._grid.cells == UNKNOWN)
        return hidden.astype(np.float32)

    @cached_property
    def layout(self) -> Layout:
        """The rooms with their polygons."""
        labels = np.where(self.rooms.passable, self.labels, np.int32(0))
        return layout_of_labels(self._name, self._grid, labels, StageTimer())


class GivenRooms(RoomsOnGrid):
    """Rooms that are known at once.

    Args:
        name: Of the predictor.
        grid: What the robot knows.
        rooms: The rooms.
    """

    def __init__(self, name: str, grid: OccupancyGrid, rooms: RoomLabels) -> None:
        super().__init__(name, grid)
        self._rooms = rooms

    @property
    def rooms(self) -> RoomLabels:
        """As given."""
        return self._rooms


class RoomPredictor(Protocol):
    """A predictor that says what the rooms look like."""

    name: str

    def rooms(self, decision: Decision) -> RoomLabels:
        """The predicted rooms of a decision with at least one frontier."""

    def predict(self, decision: Decision) -> Decision:
        """The decision with a class and an expected area for every frontier."""


@checks_arguments
def classes_in(rooms: RoomLabels, decision: Decision) -> FrontierClasses:
    """The classes of frontiers against predicted rooms, by the rule that holds for the true ones.

    The unseen rest of the building ends where the array does: of it, what is in sight can be expected.

    Raises:
        ConfigError: The rooms do not fit the decision's grid, or their ids are no whole numbers.
    """
    grid, clusters, ids = decision.grid, decision.clusters, rooms.room_ids
    if ids.shape != grid.shape or ids.dtype.kind not in "iu":
        raise ConfigError(
            f"room_ids of RoomLabels are whole numbers of the grid's shape {grid.shape}, got {ids.dtype} "
            f"{ids.shape}"
        )
    classes = classify_frontiers(grid.cells, clusters, ids, rooms.passable, grid.resolution)
    beyond = (classes.room == rooms.rest) & (classes.room > 0)
    area = np.where(beyond, decision.table.visible_area, classes.remaining_area)
    return dataclasses.replace(classes, remaining_area=area)


@checks_arguments
def with_classes(
    decision: Decision, classes: FrontierClasses, rooms: PredictedRooms, confidence: Floats | None = None
) -> Decision:
    """The decision with predicted rooms, and with classes and areas written into its frontiers.

    Args:
        decision: The decision.
        classes: One entry a frontier.
        rooms: What they come from.
        confidence: float64 (k,), probability that each class is right; 1 when None.
    """
    count = len(decision.frontiers)
    frontiers = FrontierList(decision.clusters, np.arange(count), decision.table, decision.viewpoints)
    sure = np.ones(count) if confidence is None else confidence
    judged = frontiers.judged(classes.is_closed, classes.remaining_area, sure, classes.room)
    return dataclasses.replace(decision, frontiers=judged, rooms=rooms)


@checks_arguments
def with_rooms(decision: Decision, name: str, rooms: RoomLabels) -> Decision:
    """The decision with the rooms of the predictor of that name, and the classes that follow from them."""
    return with_classes(decision, classes_in(rooms, decision), GivenRooms(name, decision.grid, rooms))
