"""Rooms behind closed doors: found, completed, and left alone where nothing is known."""

from __future__ import annotations

import numpy as np
import pytest

from layoutexplore.closed_doors import predict_closed_rooms
from layoutexplore.closed_doors.models import shipped_models
from layoutexplore.closed_doors.prediction import door_probability, find_closed_doors
from layoutexplore.evaluation.closed_doors import score_prediction
from layoutexplore.grids.arrays import Cells
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from tests.closed_doors.cases import DEPTH, WALL, WIDTH, office


def test_closed_doors_are_found_and_open_ones_are_not() -> None:
    def doors(shut: tuple[int, ...]) -> list[tuple[int, int]]:
        models = shipped_models()
        found = find_closed_doors(
            office(shut)[0], 0.05, lambda turns, edges, features: door_probability(features, models)
        )
        assert not any(found[1:])
        return [(door.start, door.stop) for door in found[0]]

    assert doors((1, 4)) == [(10 + k * (WIDTH + WALL) + 25, 10 + k * (WIDTH + WALL) + 45) for k in (1, 4)]
    assert doors(()) == []


def test_what_is_seen_through_a_chink_does_not_part_a_door() -> None:
    def doors(cells: Cells) -> list[tuple[int, int, int]]:
        found = find_closed_doors(cells, 0.05, lambda turns, edges, features: np.ones(len(edges)))[0]
        return [(door.row, door.start, door.stop) for door in found]

    seen = office((2,))[0]
    chink = seen.copy()
    row, left = 12 + DEPTH, 10 + 2 * (WIDTH + WALL) + 25
    assert (chink[row, left : left + 20] == OCCUPIED).all()
    chink[row - 1, left + 7 : left + 14] = FREE
    assert doors(chink) == doors(seen) and (row, left, left + 20) in doors(seen)


@pytest.mark.parametrize("turns", range(4))
def test_a_shut_room_between_its_neighbours_is_predicted(turns: int) -> None:
    seen, truth = (np.ascontiguousarray(np.rot90(cells, turns)) for cells in office((2,)))
    predicted = predict_closed_rooms(OccupancyGrid(seen, 0.05))
    score = score_prediction(predicted.grid.free, seen == FREE, truth == FREE)
    assert score.iou > 0.8
    assert np.array_equal(predicted.grid.cells[seen != UNKNOWN], seen[seen != UNKNOWN])


@pytest.mark.parametrize("resolution", [0.025, 0.05, 0.1])
def test_a_drawn_scene_gives_the_same_doors_and_rooms_on_every_grid(resolution: float) -> None:
    seen, truth = office((2,), resolution=resolution)
    models = shipped_models()
    found = find_closed_doors(
        seen, resolution, lambda turns, edges, features: door_probability(features, models)
    )
    assert [len(doors) for doors in found] == [1, 0, 0, 0]
    left = 10 + 2 * (WIDTH + WALL)
    assert abs(found[0][0].start * resolution - 0.05 * (left + 25)) <= resolution
    assert abs(found[0][0].stop * resolution - 0.05 * (left + 45)) <= resolution
    predicted = predict_closed_rooms(OccupancyGrid(seen, resolution))
    assert score_prediction(predicted.grid.free, seen == FREE, truth == FREE).iou > 0.8
    area = (predicted.rooms & (truth == FREE)).sum() * resolution**2
    assert area == pytest.approx(WIDTH * DEPTH * 0.05**2, rel=0.15)


def test_a_grid_without_anything_known_stays_as_it_is() -> None:
    predicted = predict_closed_rooms(OccupancyGrid(np.full((50, 60), UNKNOWN, np.int8), 0.05))
    assert predicted.doors == 0 and not predicted.rooms.any()


def test_rooms_are_predicted_in_a_map_of_probabilities() -> None:
    seen = office((2,))[0]
    likely = np.where(seen == OCCUPIED, 90, np.where(seen == FREE, 5, seen)).astype(np.int8)
    found, soft = (predict_closed_rooms(OccupancyGrid(cells, 0.05)) for cells in (seen, likely))
    assert found.rooms.any() and np.array_equal(soft.grid.cells, found.grid.cells)
