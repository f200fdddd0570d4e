"""Rooms as far as they are seen: regions that part at doors, and the one that a frontier belongs to."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.layout.doorways import Regions, doorway_regions, find_doors
from layoutexplore.layout.pipeline import reconstruct
from layoutexplore.maps.tracing import floorplan_from_ascii
from tests.plans import THREE_OFFICES


def test_regions_part_at_doors() -> None:
    raster = floorplan_from_ascii(THREE_OFFICES, resolution=0.9).rasterize(0.1)
    cells = np.where(raster.occupied, 100, 0).astype(np.int8)
    regions = doorway_regions(cells, 0.1)
    assert regions.count == 4
    for room in range(1, 5):
        owners = regions.labels[(raster.room_ids == room) & raster.free]
        assert (owners == np.bincount(owners).argmax()).mean() > 0.98
    boxes = regions.boxes
    for region in range(1, 5):
        rows, cols = np.nonzero(regions.labels == region)
        assert boxes[region].tolist() == [len(rows), rows.min(), cols.min(), rows.max() + 1, cols.max() + 1]


def test_the_method_leaves_out_what_is_too_small_for_a_room() -> None:
    raster = floorplan_from_ascii(THREE_OFFICES, resolution=0.9).rasterize(0.1)
    cells = np.where(raster.occupied, 100, 0).astype(np.int8)
    cells = np.pad(cells, 20, constant_values=-1)
    cells[4:9, 4:9] = 0  # a quarter of a square metre that a beam has seen
    grid = OccupancyGrid(cells, 0.1)
    layout = reconstruct(grid, "doorways")
    assert len(layout.rooms) == 4 and not layout.labels[:12, :12].any()
    assert (layout.labels[12:][cells[12:] == 0] > 0).all()
    assert len(reconstruct(grid, "doorways", {"room_area": 0.0}).rooms) == 5


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 100_000))
def test_sums_of_regions_against_slow_ones(seed: int) -> None:
    """Labels in runs of all lengths, shorter and longer than what is compared at once; doors at few cells."""
    rng = np.random.default_rng(seed)
    labels = rng.integers(0, 5, (6, 60)).repeat(rng.integers(1, 30, 60), axis=1).astype(np.int32)
    gaps = np.where(rng.random(labels.shape) < 0.02, rng.integers(5, 20, labels.shape), 0).astype(np.uint8)
    regions = Regions(labels, 4, gaps, 0.1)
    width = regions.door_width
    for region in range(1, 5):
        rows, cols = np.nonzero(labels == region)
        expected = (
            [len(rows), rows.min(), cols.min(), rows.max() + 1, cols.max() + 1] if len(rows) else [0] * 5
        )
        assert regions.boxes[region].tolist() == expected
        total = 0.0
        for value in width[rows, cols]:
            total += 1.0 / np.float64(value) if value > 0 else 0.0
        assert regions.doors[region] == pytest.approx(total, rel=1e-6)


def test_doors_are_the_narrower_of_two_gaps() -> None:
    rows = ["#########", "#...#...#", "#.......#", "#...#...#", "#########"]
    cells = np.array([[c == "#" for c in row] for row in rows])
    width = find_doors(np.kron(cells, np.ones((8, 8), np.bool_)), 0.1)
    assert width.dtype == np.uint8 and np.unique(width).tolist() == [0, 8]
    assert (width[18:22, 34:38] > 0).all() and not width[:16].any() and not width[24:].any()
