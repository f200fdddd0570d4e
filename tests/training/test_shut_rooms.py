"""Rooms shut at random for training."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.training.shut_rooms import add_outer_doors, find_doorways, plan_cells, shut_rooms
from tests.closed_doors.cases import _with_walls, office


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
    cells = _with_walls(np.pad(np.ones((60, 60), bool), 8))
    assert shut_rooms(cells, 0.05, np.random.default_rng(0)) is None


def test_a_floor_plan_becomes_a_map() -> None:
    plan = floorplan_from_ascii("#######\n#aa.bb#\n#aa#bb#\n#######", resolution=1.0)
    cells = plan_cells(plan, np.random.default_rng(0))
    assert set(np.unique(cells)) == {FREE, OCCUPIED, UNKNOWN} and (
        cells == FREE
    ).sum() * 0.05**2 == pytest.approx(9, rel=0.25)
