"""Ways into rooms that are drawn without a door: where nobody has seen a wall, and only there."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from layoutexplore.grids.arrays import Cells
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN
from layoutexplore.grids.morphology import disc, draw_way, nearest_cells
from layoutexplore.priors.openings import DOOR, LEAST_HIDDEN, PASSAGE, THROUGH, open_rooms, with_ways_in

RESOLUTION = 0.1
CORRIDOR, ROOM = (slice(10, 30), slice(10, 110)), (slice(32, 72), slice(40, 90))
"""Rows and columns: a corridor 10 m long and a room beyond a wall of 0.2 m."""


def drawn() -> Cells:
    """A corridor and a room without a door."""
    cells = np.full((84, 120), OCCUPIED, np.int8)
    cells[CORRIDOR] = cells[ROOM] = FREE
    return cells


def seen_corridor() -> Cells:
    """The corridor as a robot knows it, none of its walls."""
    known = np.full((84, 120), UNKNOWN, np.int8)
    known[CORRIDOR] = FREE
    return known


def joined(cells: Cells) -> bool:
    """Whether a robot of 0.2 m gets from the corridor into the room."""
    clear = cv2.erode((cells == FREE).astype(np.uint8), np.ones((5, 5), np.uint8))
    _, parts = cv2.connectedComponents(clear, connectivity=4)
    return bool(parts[20, 60] and parts[20, 60] == parts[55, 65])


def completed(foreseen: Cells, known: Cells) -> Cells:
    return np.where(known == UNKNOWN, foreseen, known)


def test_a_room_without_a_door_is_opened_in_the_middle_of_its_wall() -> None:
    known = seen_corridor()
    found = with_ways_in(drawn(), known, RESOLUTION)
    assert not joined(completed(drawn(), known)) and joined(completed(found, known))
    opened = np.argwhere((found == FREE) & (drawn() == OCCUPIED))
    assert set(opened[:, 0]) == {30, 31}
    assert abs(opened[:, 1].mean() - 65) < 5 and 7 <= np.ptp(opened[:, 1]) <= 11


def test_a_wall_that_was_seen_is_not_opened_and_the_door_moves_on() -> None:
    known = seen_corridor()
    known[30, 10:75] = OCCUPIED
    found = with_ways_in(drawn(), known, RESOLUTION)
    opened = np.argwhere((completed(found, known) == FREE) & (drawn() == OCCUPIED))
    assert joined(completed(found, known)) and opened[:, 1].min() >= 75
    known[30, 10:110] = OCCUPIED
    shut = with_ways_in(drawn(), known, RESOLUTION)
    assert not joined(completed(shut, known)) and np.array_equal(shut, drawn())


def test_a_large_part_of_several_rooms_is_opened_too() -> None:
    cells = drawn()
    cells[ROOM] = OCCUPIED
    cells[32:72, 40:64] = cells[32:72, 66:90] = FREE
    cells[50:60, 64:66] = FREE
    found = with_ways_in(cells, seen_corridor(), RESOLUTION)
    assert joined(completed(found, seen_corridor()))


def test_a_doorway_that_the_robot_looks_through_is_open_whatever_is_drawn() -> None:
    cells = drawn()
    cells[30:32, 85:89] = FREE  # the drawn door
    known = seen_corridor()
    known[30, 10:50] = known[30, 60:110] = OCCUPIED
    known[30, 50:60] = FREE
    found = with_ways_in(cells, known, RESOLUTION)
    assert (found[31, 51:59] == FREE).all() and joined(completed(found, known))
    known[30, 50:60] = OCCUPIED
    assert (with_ways_in(cells, known, RESOLUTION)[31, 51:59] == OCCUPIED).all()


def test_without_anything_known_or_foreseen_nothing_is_opened() -> None:
    nothing = np.full((20, 20), UNKNOWN, np.int8)
    assert np.array_equal(with_ways_in(nothing, nothing, RESOLUTION), nothing)
    assert np.array_equal(with_ways_in(drawn(), np.full_like(drawn(), UNKNOWN), RESOLUTION), drawn())


def opened_slowly(foreseen: Cells, known: Cells) -> Cells:
    """Part by part, with distances all over the grid."""
    cells, unseen = foreseen.copy(), known == UNKNOWN
    free = (completed(cells, known) == FREE).astype(np.uint8)
    passable = cv2.erode(free, disc(PASSAGE / RESOLUTION), borderType=cv2.BORDER_CONSTANT, borderValue=0)
    count, parts = cv2.connectedComponents(passable, connectivity=4)
    main = 1 + max(range(count - 1), key=lambda k: np.count_nonzero(~unseen & (parts == k + 1)))
    distance, nearest = nearest_cells(parts == main)
    walls = cv2.dilate((known == OCCUPIED).astype(np.uint8), disc(PASSAGE / RESOLUTION))
    for part in range(1, count):
        if part == main or np.count_nonzero(unseen & (parts == part)) * RESOLUTION**2 < LEAST_HIDDEN:
            continue
        ways = []
        for r, c in np.argwhere((parts == part) & (distance <= THROUGH / RESOLUTION)).tolist():
            row, col = nearest[r, c].tolist()
            steps = max(abs(row - r), abs(col - c), 1)
            line = [
                (r + round((row - r) * k / steps), c + round((col - c) * k / steps)) for k in range(steps + 1)
            ]
            if not any(walls[cell] for cell in line):
                ways.append((known[row, col] != FREE, distance[r, c], (r, c), (row, col)))
        ways = [way for way in ways if way[0] == min(ways)[0]]
        ways = [way for way in ways if way[1] <= min(other[1] for other in ways) + 3]
        if ways:
            middle = np.median([way[2] for way in ways], axis=0)
            _, _, start, end = min(ways, key=lambda way: float(np.abs(way[2] - middle).sum()))
            ends = np.array([start, end], np.int32)
            draw_way(cells.view(np.uint8), ends[0], ends[1], DOOR / RESOLUTION, FREE)
    return cells


@pytest.mark.parametrize("seed", range(12))
def test_rooms_are_opened_as_part_by_part(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cells = np.full((110, 130), OCCUPIED, np.int8)
    for row in range(4, 90, 24):
        for col in range(4, 100, 29):
            height, width = rng.integers(9, 24, 2)
            cells[row : row + height, col : col + width] = FREE
    known = np.full(cells.shape, UNKNOWN, np.int8)
    row, col = rng.integers(0, 60, 2)
    seen = slice(row, row + 45), slice(col, col + 40)
    known[seen] = np.where((cells[seen] == FREE) | (rng.random((45, 40)) < 0.01), cells[seen], UNKNOWN)
    known[seen][rng.random((45, 40)) < 0.0005] = OCCUPIED
    found = cells.copy()
    changed = open_rooms(found, known, RESOLUTION)
    slow = opened_slowly(cells, known)
    assert np.array_equal(found, slow) and changed == (not np.array_equal(slow, cells))
