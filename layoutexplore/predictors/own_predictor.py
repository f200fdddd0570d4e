"""A user's own predictor: it says what the rooms are, and the rest follows."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError, checks_calls
from layoutexplore.frontiers.decision import Decision, Privileged
from layoutexplore.layout.outlines import HIGHEST_ID, room_numbers
from layoutexplore.plugins.signatures import check_takes
from layoutexplore.predictors.protocol import RoomLabels, RoomPredictor, with_rooms
from layoutexplore.predictors.room_completion import walled_rooms


@checks_calls
class OwnPredictor:
    """A predictor with `rooms`, `predict` or both; what it lacks follows from what it has.

    Args:
        name: What it is called where it has no name.
        inner: Has `rooms(decision)`, which returns `RoomLabels` or the room of each cell, seen or not, as
            int (rows, cols), 0 for none (walls around unseen cells of rooms follow); or `predict(decision)`,
            which returns the decision completed.

    Raises:
        ConfigError: It has neither.
    """

    def __init__(self, name: str, inner: Any) -> None:
        given = getattr(inner, "name", None)
        self.name: str = given if isinstance(given, str) else name
        self.inner = inner
        if not any(callable(getattr(inner, method, None)) for method in ("rooms", "predict")):
            raise ConfigError(
                f"predictor {name!r} is a {type(inner).__name__}, which has neither rooms(decision) nor "
                "predict(decision)"
            )
        if isinstance(inner, Privileged):
            self.reveal = inner.reveal

    def rooms(self, decision: Decision) -> RoomLabels:
        """The predicted rooms.

        Raises:
            ConfigError: It only has `predict`, or its rooms do not fit the grid.
        """
        if not hasattr(self.inner, "rooms"):
            raise ConfigError(f"predictor {self.name!r} has no rooms(decision), only predict")
        found = self.inner.rooms(decision)
        if not isinstance(found, RoomLabels):
            return _completed(self.name, found, decision)
        given, passable = np.asarray(found.room_ids), np.asarray(found.passable)
        for array in (given, passable):
            _check_shape(self.name, array, decision)
        highest = max(given.size, HIGHEST_ID)
        if not np.issubdtype(given.dtype, np.integer) or not 0 <= given.min() <= given.max() <= highest:
            raise ConfigError(
                f"predictor {self.name!r}: ids of rooms in RoomLabels are 0 for none to {highest}, got "
                f"{given.dtype} from {given.min()} to {given.max()}"
            )
        # As kernels are compiled for them.
        given, passable = np.ascontiguousarray(given, np.int32), np.ascontiguousarray(passable, np.bool_)
        return RoomLabels(given, passable, found.rest)

    def predict(self, decision: Decision) -> Decision:
        """The decision with a class and an expected area for every frontier."""
        if hasattr(self.inner, "predict"):
            completed: Decision = self.inner.predict(decision)
            return completed
        return with_rooms(decision, self.name, self.rooms(decision)) if decision.frontiers else decision


def predictor_of_own_code(name: str, made: Any) -> RoomPredictor:
    """What a user's own code made, as a predictor; one that is complete stays as it is."""
    for method, argument in (("rooms", "decision"), ("predict", "decision"), ("reveal", "truth")):
        if callable(asked := getattr(made, method, None)):
            check_takes(asked, argument, f"predictor {name!r}: its {method}")
    if all(hasattr(made, attribute) for attribute in ("name", "rooms", "predict")):
        predictor: RoomPredictor = made
        return predictor
    return OwnPredictor(name, made)


def _completed(name: str, found: Any, decision: Decision) -> RoomLabels:
    """Room ids, with walls around what they claim of the unknown."""
    ids = room_numbers(found, decision.grid.shape, f"predictor {name!r}")
    return walled_rooms(decision.grid.cells, ids, int(ids.max(initial=0)) + 1)


def _check_shape(name: str, ids: NDArray[Any], decision: Decision) -> None:
    if ids.shape != decision.grid.shape:
        raise ConfigError(
            f"predictor {name!r}: its rooms have the shape {ids.shape}, the grid {decision.grid.shape}"
        )
