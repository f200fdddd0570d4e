"""Ways into rooms that are drawn without a door: where nobody has seen a wall, and only there."""

from __future__ import annotations

import cv2
import numpy as np

from layoutexplore.grids.arrays import Cells
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN
from layoutexplore.priors.openings import with_ways_in

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
