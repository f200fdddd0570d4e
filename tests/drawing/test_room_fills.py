"""Fills of rooms: no two neighbours alike while there are colours for it, each its own where that can be."""

from __future__ import annotations

import itertools
import time

import cv2
import numpy as np
import pytest

from layoutexplore.drawing import palette
from layoutexplore.drawing.layouts import draw_layout
from layoutexplore.drawing.pictures import draw_plan
from layoutexplore.drawing.room_fills import colour_numbers, fills_of_rooms
from layoutexplore.errors import ConfigError
from layoutexplore.grids.arrays import Labels
from layoutexplore.layout.pipeline import reconstruct
from layoutexplore.maps.library import load_plan


def near(room_ids: Labels, metres: float, resolution: float) -> set[tuple[int, int]]:
    """Pairs of rooms within so many metres of each other, the slow way."""
    reach = round(metres / resolution)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    pairs = set()
    for room in np.unique(room_ids[room_ids > 0]).tolist():
        grown = cv2.dilate((room_ids == room).astype(np.uint8), disc) > 0
        pairs |= {(room, other) for other in np.unique(room_ids[grown]).tolist() if other > room}
    return pairs


@pytest.mark.parametrize("name", ["office-01", "school:3", "hospital:2"])
def test_neighbours_have_different_colours(name: str) -> None:
    raster = load_plan(name).rasterize(0.1)
    fills = fills_of_rooms(raster.room_ids, raster.resolution)
    pairs = near(raster.room_ids, 0.3, raster.resolution)
    assert len(pairs) > 20
    assert not [(a, b) for a, b in pairs if tuple(fills[a]) == tuple(fills[b])]
    image = draw_plan(raster)[::-1]
    inside = (raster.room_ids > 0) & raster.free
    assert (image[inside] == fills[raster.room_ids[inside]]).all()
    np.testing.assert_array_equal(fills, fills_of_rooms(raster.room_ids.astype(np.int32), raster.resolution))


def test_a_room_without_a_like_neighbour_keeps_its_own_colour() -> None:
    fills = fills_of_rooms(np.array([[1, 0, 2, -1, 0, 0, 0, 0, 12]], np.int32), 0.2)
    assert [tuple(fills[room]) for room in (1, 2, 12)] == [palette.room_colour(room) for room in (1, 2, 12)]
    assert tuple(fills[0]) == palette.FREE
    assert fills_of_rooms(np.zeros((3, 3), np.int32), 0.1).shape == (1, 3)


def test_a_corridor_may_have_more_neighbours_than_there_are_colours() -> None:
    rooms = {k: {k - 1, k + 1, 1} - {1 if k == 2 else 0, 61} | {1} for k in range(2, 61)}
    numbers = colour_numbers({1: set(rooms), **rooms}, 3)
    assert len({numbers[1]} | {numbers[k] for k in rooms}) == 3
    assert all(numbers[a] != numbers[b] for a, others in rooms.items() for b in others)


def test_with_too_few_colours_as_few_as_possible_are_alike() -> None:
    complete = {a: set(range(1, 5)) - {a} for a in range(1, 5)}
    numbers = colour_numbers(complete, 3)
    assert sum(numbers[a] == numbers[b] for a, b in itertools.combinations(complete, 2)) == 1


def test_rooms_of_a_layout_have_different_colours_from_their_neighbours() -> None:
    grid = load_plan("office-01").rasterize(0.1).grid
    layout = reconstruct(grid, "morphological")
    labels = layout.room_labels(grid)
    image = draw_layout(layout, grid, panel=max(grid.shape))
    shown = {tuple(colour) for colour in image.reshape(-1, 3).tolist()}
    fills = fills_of_rooms(labels, grid.resolution)
    assert {tuple(fills[room]) for room in np.unique(labels[labels > 0]).tolist()} <= shown
    assert all(tuple(fills[a]) != tuple(fills[b]) for a, b in near(labels, 0.3, grid.resolution))


def test_a_large_office_is_coloured_quickly() -> None:
    plan = load_plan("office:7").stretched(3.0, 3.0)
    raster = plan.rasterize(0.05)
    fills_of_rooms(raster.room_ids, 0.05)
    began = time.perf_counter()
    fills_of_rooms(raster.room_ids, 0.05)
    per_cell = (time.perf_counter() - began) / raster.room_ids.size
    assert per_cell < 1e-7  # a tenth of that takes 8,000 m2 some 30 ms


def test_a_resolution_is_above_0() -> None:
    with pytest.raises(ConfigError, match="resolution"):
        fills_of_rooms(np.zeros((3, 3), np.int32), 0.0)
