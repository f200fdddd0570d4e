"""Furniture as it is drawn: at the walls of its room, and never in a door."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from layoutexplore.grids.components import label_components
from layoutexplore.training.polygonal_buildings.drawn_furniture import CLEAR, draw_furniture
from layoutexplore.training.polygonal_buildings.polygonal_floors import polygonal_floor


@pytest.mark.parametrize("seed", range(12))
def test_furniture_stands_in_rooms_and_only_legs_near_doors(seed: int) -> None:
    plan = polygonal_floor(seed)
    raster = plan.rasterize(0.05)
    occupied = draw_furniture(plan, raster, np.random.default_rng(seed))
    added = occupied & ~raster.occupied
    assert not (raster.occupied & ~occupied).any() and added.any()
    assert (raster.room_ids[added] > 0).mean() > 0.95
    rows, cols = np.nonzero(added)
    x, y = raster.origin.x + (cols + 0.5) * 0.05, raster.origin.y + (rows + 0.5) * 0.05
    doors = shapely.union_all([shapely.LineString([door.start, door.end]) for door in plan.doors])
    near = shapely.distance(doors, shapely.points(x, y)) < CLEAR - 0.1
    pieces, count = label_components(added)
    areas = np.bincount(pieces.ravel(), minlength=count + 1) * 0.05**2
    # the smallest cupboard has 0.24 square metres, legs that touch half of that at most
    assert (areas[pieces[rows[near], cols[near]]] < 0.15).all()


def test_the_same_seed_draws_the_same_furniture() -> None:
    plan = polygonal_floor(1)
    raster = plan.rasterize(0.1)
    one, other, third = (draw_furniture(plan, raster, np.random.default_rng(k)) for k in (0, 0, 1))
    assert (one == other).all() and (one != third).any()
