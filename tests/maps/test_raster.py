"""A plan on a grid: what is solid, shared, reachable, and to be seen."""

from __future__ import annotations

from typing import get_type_hints

import cv2
import numpy as np
import pytest
import shapely
from scipy import ndimage

from layoutexplore.errors import MapError
from layoutexplore.grids.arrays import Labels
from layoutexplore.grids.grid import Cell, Pose
from layoutexplore.importing.building import Building, building_of_plan
from layoutexplore.maps.floorplan import FloorPlan, PlanRaster, Room
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.metrics.exploration import rooms_finished
from layoutexplore.priors.distortion import draw_distorted
from layoutexplore.priors.evacuation_picture import draw_evacuation_plan
from tests.maps.cases import two_rooms


def test_rasters_are_shared() -> None:
    plan = two_rooms()
    assert plan.rasterize(0.1) is plan.rasterize(0.1)
    assert plan.rasterize(0.1).blocked(0.2) is plan.rasterize(0.1).blocked(0.2)
    assert plan.rasterize(0.1) is not plan.rasterize(0.1, margin=1.0)


def test_reachable_from_a_start() -> None:
    raster = two_rooms().with_doors_closed([0]).rasterize(0.1)
    left, right = raster.world_to_cell(1.0, 1.0), raster.world_to_cell(6.0, 1.0)
    assert raster.reachable(0.2, left)[left]
    assert not raster.reachable(0.2, left)[right]
    assert not raster.reachable(0.2, Cell(0, 0)).any()
    assert not raster.reachable(0.2, Cell(-1, 5)).any()
    assert not raster.coverage_target(0.2, left)[right]
    assert raster.coverage_target(0.2, left)[left]


def test_a_robot_that_fits_nowhere() -> None:
    with pytest.raises(MapError, match="fits nowhere"):
        two_rooms().rasterize(0.1).reachable(5.0)


def test_the_target_reaches_0_8_m_beyond_the_robot() -> None:
    """A slot that is too narrow for the robot counts for 0.8 m beyond the last place it can be."""
    plan = floorplan_from_ascii(
        "#" * 42 + "\n" + ("#" + "a" * 10 + "#" * 31 + "\n") * 4 + "#" + "a" * 40 + "#\n" + "#" * 42, 0.1
    )
    raster = plan.rasterize(0.1, margin=0.0)
    row = raster.world_to_cell(3.0, 0.15).row
    target, reachable = raster.coverage_target(0.2), raster.reachable(0.2)
    seen = np.flatnonzero(target[row])
    assert not reachable[row].any()
    last = np.argwhere(reachable)[:, 1].max()
    assert 0.6 < (seen.max() - last) * 0.1 <= 0.8


@pytest.mark.parametrize("resolution", [0.1, 0.2, 0.25, 0.05, 0.13])
def test_a_thin_wall_of_an_image_stays_closed_at_any_resolution(resolution: float) -> None:
    occupied = np.zeros((81, 81), np.bool_)
    occupied[[0, -1]] = occupied[:, [0, -1]] = True
    occupied[np.arange(81), np.arange(81)] = True
    occupied[np.arange(80), np.arange(1, 81)] = True  # a diagonal, 4-connected wall of 1 cell
    occupied[40, :40] = True
    plan = FloorPlan(name="thin", source=PlanRaster(occupied, np.zeros((81, 81), np.int32), 0.05))
    raster = plan.rasterize(resolution)
    assert cv2.connectedComponents(raster.free.astype(np.uint8), connectivity=8)[0] == 4


@pytest.mark.parametrize(("x", "y"), [(1.25, 0.8), (0.87, 1.13), (0.5, 1.0)])
def test_a_stretched_image_keeps_its_thin_walls_and_its_rooms(x: float, y: float) -> None:
    occupied, rooms = np.zeros((61, 81), np.bool_), np.ones((61, 81), np.int32)
    occupied[[0, -1]] = occupied[:, [0, -1]] = True
    occupied[:, 37] = occupied[23, 37:] = True  # walls of one cell
    rooms[:, 38:] = 2
    rooms[24:, 38:] = 3
    rooms[occupied] = 0
    plan = FloorPlan(name="image", source=PlanRaster(occupied, rooms, 0.05, Pose(2.0, -4.0, 0.0))).stretched(
        x, y
    )
    assert plan.source is not None and plan.source.shape == (round(61 * y), round(81 * x))
    assert plan.bounds[:2] == (2.0 * x, -4.0 * y)
    count, parts = cv2.connectedComponents(plan.source.free.astype(np.uint8), connectivity=8)
    assert count == 4
    for part in range(1, count):
        assert len(np.unique(plan.source.room_ids[parts == part])) == 1
    areas = np.bincount(plan.source.room_ids.ravel())[1:] / (x * y)
    np.testing.assert_allclose(areas, np.bincount(rooms.ravel())[1:], rtol=0.1)


def test_raster_shapes_must_fit() -> None:
    with pytest.raises(MapError, match="equal"):
        PlanRaster(np.zeros((3, 3), np.bool_), np.zeros((3, 4), np.int32), 0.1)


def test_a_turned_source_keeps_its_origin() -> None:
    source = PlanRaster(np.zeros((4, 6), np.bool_), np.ones((4, 6), np.int32), 0.5, Pose(1.0, 2.0, 0.0))
    raster = FloorPlan(
        name="moved", source=source, rooms=(Room(id=1, polygon=shapely.box(1, 2, 4, 4)),)
    ).rasterize(0.5)
    assert raster.room_ids[raster.world_to_cell(1.1, 2.1)] == 1
    assert raster.occupied[raster.world_to_cell(0.9, 2.1)]


def test_large_room_numbers_stay_what_they_are() -> None:
    for largest, kind in ((32_767, np.int16), (32_768, np.int32), (-32_769, np.int32), (100_000, np.int32)):
        raster = PlanRaster(np.eye(3, dtype=bool), np.array([[0, 0, largest]] * 3), 0.1)
        assert raster.room_ids.dtype == kind and (raster.room_ids[:, 2] == largest).all()


def test_what_takes_or_has_room_ids_of_a_raster_says_of_which_type() -> None:
    """It said int32, which they are only where the numbers do not fit into 16 bit."""
    raster = two_rooms().rasterize(0.1)
    for told in (Building, rooms_finished, draw_evacuation_plan, draw_distorted):
        assert f"{raster.room_ids.dtype} or int32 (rows, cols)" in (told.__doc__ or "")
        assert get_type_hints(told)["room_ids"] == Labels
    assert building_of_plan(two_rooms()).room_ids.dtype == raster.room_ids.dtype


def test_areas_that_are_not_connected() -> None:
    """Each start has its own area, whichever was asked for before; without one it is the largest."""
    occupied = np.ones((9, 30), bool)
    for first, last in ((1, 4), (6, 18), (20, 29)):
        occupied[1:8, first:last] = False
    raster = PlanRaster(occupied, np.zeros(occupied.shape, np.int32), 0.1)
    for col, first, last in ((2, 1, 4), (25, 20, 29), (10, 6, 18), (2, 1, 4), (None, 6, 18)):
        reached = raster.reachable(0.1, None if col is None else Cell(4, col))
        assert np.flatnonzero(reached.any(axis=0)).tolist() == list(range(first, last))
        target = raster.coverage_target(0.1, None if col is None else Cell(4, col))
        assert np.flatnonzero(target.any(axis=0)).tolist() == list(range(first, last))


@pytest.mark.parametrize("seed", range(6))
def test_areas_are_those_of_the_connected_cells(seed: int) -> None:
    """From starts in any order, in open halls and in a maze of specks; what is handed out may be changed."""
    rng = np.random.default_rng(seed)
    occupied = rng.random((int(rng.integers(5, 60)), int(rng.integers(5, 60)))) < rng.choice([0.1, 0.4, 0.6])
    raster = PlanRaster(occupied, np.zeros(occupied.shape, np.int32), 0.1)
    parts, _ = ndimage.label(~raster.blocked(0.05))
    sizes = np.bincount(parts.ravel())[1:]
    np.testing.assert_array_equal(raster.reachable(0.05), parts == sizes.argmax() + 1)
    for row, col in zip(*(rng.integers(size, size=20).tolist() for size in occupied.shape), strict=True):
        reached = raster.reachable(0.05, Cell(row, col))
        np.testing.assert_array_equal(reached, (parts == parts[row, col]) & (parts[row, col] > 0))
        reached[:] = True
