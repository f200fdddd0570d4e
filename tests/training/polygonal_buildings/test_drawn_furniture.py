"""Furniture as it is drawn: at the walls of its room, and never in a door."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from layoutexplore.training.polygonal_buildings.drawn_furniture import CLEAR, draw_furniture
from layoutexplore.training.polygonal_buildings.polygonal_floors import polygonal_floor


@pytest.mark.parametrize("seed", range(4))
def test_furniture_stands_in_rooms_and_leaves_the_doors_clear(seed: int) -> None:
    plan = polygonal_floor(seed)
    raster = plan.rasterize(0.05)
    occupied = draw_furniture(plan, raster, np.random.default_rng(seed))
    added = occupied & ~raster.occupied
    assert not (raster.occupied & ~occupied).any() and added.any()
    rows, cols = np.nonzero(added)
    x, y = raster.origin.x + (cols + 0.5) * 0.05, raster.origin.y + (rows + 0.5) * 0.05
    doors = shapely.union_all([shapely.LineString([door.start, door.end]) for door in plan.doors])
    legs, solid = (raster.room_ids[added] > 0), shapely.distance(doors, shapely.points(x, y)) < CLEAR - 0.1
    assert legs.mean() > 0.95
    # only legs stand near doors
    assert solid.mean() < 0.2


def test_the_same_seed_draws_the_same_furniture() -> None:
    plan = polygonal_floor(1)
    raster = plan.rasterize(0.1)
    one, other, third = (draw_furniture(plan, raster, np.random.default_rng(k)) for k in (0, 0, 1))
    assert (one == other).all() and (one != third).any()
