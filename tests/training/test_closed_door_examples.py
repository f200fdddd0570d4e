"""Rooms shut at random for training."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import shapely.affinity

from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN
from layoutexplore.maps.floorplan import FloorPlan, Room
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.training.closed_door_examples import add_outer_doors, find_doorways, plan_cells, shut_rooms
from layoutexplore.training.simulated_maps import furnish_cells
from tests.closed_doors.cases import office, with_walls


@pytest.mark.parametrize("seed", range(4))
def test_rooms_shut_at_random_are_hidden_and_nothing_else(seed: int) -> None:
    _, truth = office(())
    assert len(find_doorways(truth, 0.05)) == 6
    rng = np.random.default_rng(seed)
    seen = shut_rooms(truth, 0.05, rng)
    assert seen is not None
    hidden = (truth == FREE) & (seen != FREE)
    assert not ((seen == FREE) & (truth != FREE)).any()
    assert hidden[:110].sum() >= 80 * 85 and not hidden[115:].any()
    parts, _ = cv2.connectedComponents((seen == FREE).astype(np.uint8), connectivity=4)
    assert parts == 2
    more, true = add_outer_doors(seen, truth, 0.05, rng, 4)
    assert ((true == FREE) & (more != FREE)).sum() > hidden.sum() - 200 and more.shape == seen.shape


def test_a_map_without_doorways_shuts_nothing() -> None:
    cells = with_walls(np.pad(np.ones((60, 60), bool), 8))
    assert shut_rooms(cells, 0.05, np.random.default_rng(0)) is None


def test_a_floor_plan_becomes_a_map() -> None:
    plan = floorplan_from_ascii("#######\n#aa.bb#\n#aa#bb#\n#######", resolution=1.0)
    cells = plan_cells(plan, 0.05, np.random.default_rng(0))
    assert set(np.unique(cells)) == {FREE, OCCUPIED, UNKNOWN} and (
        cells == FREE
    ).sum() * 0.05**2 == pytest.approx(9, rel=0.25)


@pytest.mark.parametrize("degrees", [0.0, 12.0, -37.0])
def test_a_floor_plan_that_lies_askew_becomes_an_upright_map(degrees: float) -> None:
    room = Room(id=1, polygon=shapely.affinity.rotate(shapely.box(0, 0, 20, 8), degrees))
    free = plan_cells(FloorPlan(name="hall", rooms=(room,)), 0.05, np.random.default_rng(0)) == FREE
    rows, cols = np.flatnonzero(free.any(axis=1)), np.flatnonzero(free.any(axis=0))
    assert free.sum() > 0.95 * (np.ptp(rows) + 1) * (np.ptp(cols) + 1)


@pytest.mark.parametrize("resolution", [0.025, 0.05, 0.1])
def test_doorways_are_the_same_in_metres_on_every_grid(resolution: float) -> None:
    truth = office((), resolution=resolution)[1]
    found = [(d.turns, d.row, d.end, d.start, d.stop) for d in find_doorways(truth, resolution)]
    expected = [(d.turns, d.row, d.end, d.start, d.stop) for d in find_doorways(office(())[1], 0.05)]
    assert len(found) == len(expected) == 6
    for one, other in zip(sorted(found), sorted(expected), strict=True):
        assert np.abs(np.array(one[1:]) * resolution - np.array(other[1:]) * 0.05).max() <= max(
            resolution, 0.05
        )
    seen = shut_rooms(truth, resolution, np.random.default_rng(1))
    assert seen is not None
    seen, truth = (np.pad(m, round(4 / resolution), constant_values=UNKNOWN) for m in (seen, truth))
    more, true = add_outer_doors(seen, truth, resolution, np.random.default_rng(0), 4)
    outer = ((true == FREE) & (truth != FREE)).sum() * resolution**2
    assert 0.3 < outer < 4 * 1.2 * 0.95 and more.shape == seen.shape


@pytest.mark.parametrize("resolution", [0.025, 0.05, 0.1])
def test_furniture_is_as_large_on_every_grid(resolution: float) -> None:
    rooms = np.ones((round(40 / resolution), round(40 / resolution)), np.int32)
    free = np.zeros(rooms.shape, np.bool_)
    covered = furnish_cells(free, rooms, 0.05, resolution, np.random.default_rng(0)).mean()
    assert 0.015 < covered < 0.035
