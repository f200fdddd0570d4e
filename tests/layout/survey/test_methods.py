"""The classic segmentations: small plans with a known answer, ties, hard inputs."""

from __future__ import annotations

import numpy as np
import pytest

from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.layout.pipeline import reconstruct

METHODS = ("morphological", "distance", "voronoi")


def two_rooms() -> OccupancyGrid:
    """Two rooms of 7 m x 8 m with a door of 0.9 m between them, at 0.1 m."""
    cells = np.full((90, 152), 100, np.int8)
    cells[5:85, 5:75] = 0
    cells[5:85, 77:147] = 0
    cells[40:49, 75:77] = 0
    return OccupancyGrid(cells, 0.1)


@pytest.mark.parametrize("method", METHODS)
def test_two_rooms_are_two_rooms(method: str) -> None:
    grid = two_rooms()
    layout = reconstruct(grid, method)
    assert len(layout.rooms) == 2
    assert not layout.labels[grid.occupied].any()
    assert layout.labels[45, 30] != layout.labels[45, 120]
    assert all(room.polygon.is_valid for room in layout.rooms)
    assert layout.rooms[0].polygon.intersection(layout.rooms[1].polygon).area == 0


@pytest.mark.parametrize("method", ["morphological", "voronoi"])
def test_a_closed_room_that_a_corridor_runs_around_is_a_room(method: str) -> None:
    cells = np.full((94, 114), 100, np.int8)
    cells[2:92, 2:112] = 0
    cells[6:88, 6:108] = 100
    cells[8:86, 8:106] = 0
    layout = reconstruct(OccupancyGrid(cells, 0.1), method)
    assert len(layout.rooms) == 2
    assert layout.labels[47, 57] not in (0, layout.labels[3, 57])
