"""Rooms of a user's own predictor: ids of any kind, or a word about those that are none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from layoutexplore.errors import ConfigError
from layoutexplore.frontiers.decision import Decision
from layoutexplore.predictors import RoomLabels
from layoutexplore.predictors.own_predictor import OwnPredictor
from layoutexplore.predictors.protocol import with_rooms


class Numbered:
    """Everything known to be free is the room of one id."""

    def __init__(self, number: int, dtype: Any = np.int64, *, as_labels: bool = False) -> None:
        self.number, self.dtype, self.as_labels = number, dtype, as_labels

    def rooms(self, decision: Decision) -> Any:
        free = decision.grid.free
        ids = np.where(free, self.dtype(self.number), self.dtype(0))
        return RoomLabels(ids, free) if self.as_labels else ids


@pytest.mark.parametrize(
    ("number", "dtype"), [(2**31 - 1, np.int32), (2**40, np.int64), (2**63 + 1, np.uint64)]
)
def test_high_ids_are_as_good_as_low_ones(decision: Decision, number: int, dtype: Any) -> None:
    plain = OwnPredictor("own", Numbered(1)).predict(decision)
    high = OwnPredictor("own", Numbered(number, dtype)).predict(decision)
    assert [f.expected_area for f in high.frontiers] == [f.expected_area for f in plain.frontiers]
    kept = OwnPredictor("own", Numbered(70_000)).rooms(decision)
    assert set(np.unique(kept.room_ids)) - {0, kept.rest} == {70_000}


@pytest.mark.parametrize(
    "inner",
    [
        Numbered(-1),
        Numbered(-1, as_labels=True),
        Numbered(2**40, as_labels=True),
        Numbered(1, np.float64),
        Numbered(1, np.float64, as_labels=True),
    ],
)
def test_what_are_no_ids_is_named(decision: Decision, inner: Numbered) -> None:
    with pytest.raises(ConfigError, match="predictor 'own'"):
        OwnPredictor("own", inner).predict(decision)


@pytest.mark.parametrize("rooms", [None, (np.zeros((3, 3), int), 2), np.zeros((2, 2), int)])
def test_what_are_no_rooms_is_named(decision: Decision, rooms: Any) -> None:
    class Odd:
        def rooms(self, decision: Decision) -> Any:
            return rooms

    with pytest.raises(ConfigError, match="predictor 'own': the room of each cell is a whole number"):
        OwnPredictor("own", Odd()).predict(decision)


@pytest.mark.parametrize("as_labels", [False, True])
def test_arrays_of_any_kind_become_those_that_kernels_know(decision: Decision, as_labels: bool) -> None:
    class Other:
        def rooms(self, decision: Decision) -> Any:
            ids = np.asfortranarray(decision.grid.free.astype(np.int64))
            return RoomLabels(ids, ids) if as_labels else ids

    rooms = OwnPredictor("own", Other()).rooms(decision)
    assert rooms.room_ids.dtype == np.int32 and rooms.passable.dtype == np.bool_
    assert rooms.room_ids.flags.c_contiguous and rooms.passable.flags.c_contiguous


def test_of_the_unseen_rest_an_open_frontier_promises_what_is_in_sight(decision: Decision) -> None:
    predictor = OwnPredictor("own", Numbered(1))
    rest = predictor.rooms(decision).rest
    beyond = [f for f in predictor.predict(decision).frontiers if f.room == rest]
    assert beyond and all(f.expected_area == f.visible_area for f in beyond)


def test_labels_of_lists_are_those_of_arrays(decision: Decision) -> None:
    free = decision.grid.free
    kept = [
        with_rooms(decision, "own", RoomLabels(*given))
        for given in ((free.astype(np.int32), free), (free.astype(int).tolist(), free.tolist()))
    ]
    areas = [[f.expected_area for f in judged.frontiers] for judged in kept]
    assert areas[0] == areas[1]


def test_labels_that_do_not_fit_are_refused(decision: Decision) -> None:
    """A kernel would read beyond them, and hang or worse."""
    with pytest.raises(ConfigError, match="must have one shape"):
        RoomLabels(np.zeros((2, 2), np.int32), np.zeros((3, 2), np.bool_))
    free = decision.grid.free
    for odd in (
        RoomLabels(np.zeros((3, 3), np.int32), np.zeros((3, 3), np.bool_)),
        RoomLabels(free * 1.0, free),
    ):
        with pytest.raises(ConfigError, match="whole numbers of the grid's shape"):
            with_rooms(decision, "own", odd)
