"""Polygonal buildings: sound plans, walls in many directions, a way to every room."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from layoutexplore.training.polygonal_buildings.polygonal_floors import polygonal_floor


@pytest.mark.parametrize("seed", range(8))
def test_rooms_lie_side_by_side_and_every_one_is_reached(seed: int) -> None:
    plan = polygonal_floor(seed)
    floors = [room.polygon for room in plan.rooms]
    assert len(floors) >= 3 and all(floor.is_valid and floor.area > 3.0 for floor in floors)
    assert sum(floor.area for floor in floors) == pytest.approx(shapely.union_all(floors).area)
    assert plan.walls.intersection(shapely.union_all(floors)).area < 0.1
    assert {room.id for room in plan.rooms} == {key for door in plan.doors for key in door.rooms}
    raster = plan.rasterize(0.05)
    free = raster.free
    assert free.any() and not (free[0].any() or free[-1].any() or free[:, 0].any() or free[:, -1].any())


def test_the_same_seed_gives_the_same_plan() -> None:
    one, other, third = polygonal_floor(3), polygonal_floor(3), polygonal_floor(4)
    assert one.content_hash == other.content_hash != third.content_hash


def test_walls_run_in_more_than_two_directions() -> None:
    counts = []
    for seed in range(6):
        angles = []
        for room in polygonal_floor(seed).rooms:
            steps = np.diff(shapely.get_coordinates(room.polygon.exterior), axis=0)
            steps = steps[np.hypot(*steps.T) > 1.0]
            angles += np.mod(np.degrees(np.arctan2(steps[:, 1], steps[:, 0])), 90.0).round(-1).tolist()
        counts.append(len(set(angles)))
    assert np.median(counts) >= 3
