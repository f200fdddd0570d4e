"""Foresight: the known wins, what is hidden and contradicted, bad arrays, and that it is asked for once."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.errors import LayoutExploreError, MapError
from layoutexplore.frontiers.detection import FrontierClusters
from layoutexplore.frontiers.foresight import Beside, Foresight
from layoutexplore.grids.arrays import Cells
from layoutexplore.grids.grid import FREE, UNKNOWN
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.simulation.simulation import Simulation
from tests.plans import TWO_ROOMS

CELLS = np.array([[0, 0, 100, -1]], np.int8)
ROOMS = np.array([[1, 1, 0, 0]], np.int32)


def foresight(**changes: object) -> Foresight:
    told = {"cells": CELLS, "room_ids": ROOMS, "confidence": 0.5, "predictor": "drawn", "resolution": 0.5}
    return Foresight(**(told | changes))  # type: ignore[arg-type]


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


def shares_cell_by_cell(known: Cells, foreseen: Cells, clusters: FrontierClusters) -> Beside:
    around = np.pad(np.where(known == UNKNOWN, foreseen, np.int8(1)), 1, constant_values=1)
    shares = []
    for k in range(len(clusters)):
        beside = [
            {around[r, c + 1], around[r + 2, c + 1], around[r + 1, c], around[r + 1, c + 2]}
            for r, c in clusters.cluster(k)
        ]
        shares.append([np.mean([value in values for values in beside]) for value in (FREE, UNKNOWN)])
    floor, nothing = np.array(shares).reshape(-1, 2).T
    return Beside(floor, nothing)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_what_is_foreseen_beside_frontiers(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(1, 12, 2))
    known, cells = rng.choice(np.array([-1, 0, 100], np.int8), (2, *shape))
    members = [np.argwhere(rng.random(shape) < 0.2).astype(np.int32) for _ in range(3)]
    clusters = FrontierClusters.of([cluster for cluster in members if len(cluster)])
    found = foresight(cells=cells, room_ids=np.zeros(shape, np.int32)).beside(known, clusters)
    for shares, expected in zip(found, shares_cell_by_cell(known, cells, clusters), strict=True):
        assert np.allclose(shares, expected)


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
