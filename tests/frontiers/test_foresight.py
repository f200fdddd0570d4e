"""Foresight: the known wins, what is hidden and contradicted, bad arrays, and that it is asked for once."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from layoutexplore.errors import LayoutExploreError, MapError
from layoutexplore.frontiers.foresight import Foresight
from layoutexplore.grids.grid import UNKNOWN
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.simulation.simulation import Simulation
from tests.plans import TWO_ROOMS

CELLS = np.array([[0, 0, 100, -1]], np.int8)
ROOMS = np.array([[1, 1, 0, 0]], np.int32)


def foresight(**changes: object) -> Foresight:
    given = {"cells": CELLS, "room_ids": ROOMS, "confidence": 0.5, "predictor": "drawn", "resolution": 0.5}
    return Foresight(**(given | changes))  # type: ignore[arg-type]


def test_what_is_known_wins() -> None:
    known = np.array([[100, -1, 0, -1]], np.int8)
    assert foresight().completed(known).tolist() == [[100, 0, 0, -1]]
    assert foresight().hidden(known).tolist() == [[False, True, False, False]]
    assert foresight().contradicted(known).tolist() == [[True, False, True, False]]
    assert known.tolist() == [[100, -1, 0, -1]]


def test_what_lies_far_from_known_floor_is_left_out() -> None:
    row = np.zeros((1, 6), np.int8)
    ahead = foresight(cells=row, room_ids=np.ones((1, 6), np.int32))
    known = np.array([[-1, 0, 100, -1, -1, -1]], np.int8)
    near = ahead.within(1.4, known)  # cells of half a metre: two cells away, not three
    assert near.cells.tolist() == [[0, 0, 0, 0, -1, -1]] and near.room_ids.tolist() == [[1, 1, 1, 1, 0, 0]]
    assert (ahead.cells == 0).all() and (near.confidence, near.predictor) == (ahead.confidence, "drawn")
    assert ahead.within(100.0, known).cells is ahead.cells
    assert (ahead.within(0.0, np.full_like(known, -1)).cells == UNKNOWN).all()


def test_areas_are_of_free_cells() -> None:
    assert foresight().areas.tolist() == [0.0, 0.5]


@pytest.mark.parametrize(
    "changes",
    [
        {"cells": CELLS.astype(np.int64)},
        {"room_ids": ROOMS[:, :2]},
        {"confidence": 1.5},
        {"confidence": float("nan")},
        {"resolution": 0.0},
        {"room_ids": -ROOMS},
        {"cells": CELLS + np.int8(1)},
    ],
)
def test_what_does_not_fit_is_named(changes: dict[str, object]) -> None:
    with pytest.raises(LayoutExploreError, match="drawn"):
        foresight(**changes)


def test_a_decision_asks_once_and_only_when_asked() -> None:
    decision = Simulation(floorplan_from_ascii(TWO_ROOMS, resolution=1.0)).reset()
    assert decision.foresight is None
    asked = []

    def foresee() -> Foresight:
        asked.append(1)
        nothing = np.full(decision.grid.shape, UNKNOWN, np.int8)
        return foresight(cells=nothing, room_ids=np.zeros(decision.grid.shape, np.int32))

    ahead = dataclasses.replace(decision, foresee=foresee)
    assert not asked
    assert ahead.foresight is ahead.foresight
    assert asked == [1]
    with pytest.raises(MapError, match=r"foresight of 'drawn' has \(1, 4\) cells, the grid"):
        _ = dataclasses.replace(decision, foresee=foresight).foresight
