"""Rectangles that may be the room behind a door."""

from __future__ import annotations

import numpy as np
import pytest

from layoutexplore.closed_doors.candidates import rectangles
from layoutexplore.closed_doors.features import FEATURES, describe
from layoutexplore.closed_doors.prediction import find_closed_doors, turned_scenes
from tests.closed_doors.cases import DEPTH, WALL, WIDTH, office


def test_one_of_the_rectangles_is_the_room() -> None:
    seen, _ = office((2,))
    doors = find_closed_doors(
        seen, 0.05, lambda turns, edges, features: (features[:, 7] > 0.1) * (features[:, 0] < 2.0) * 1.0
    )
    (door,) = doors[0]
    scene = next(iter(turned_scenes(seen, 0.05, doors)))
    boxes = rectangles(scene, door)
    room = np.array([10, 10 + 2 * (WIDTH + WALL), 10 + DEPTH, 10 + 2 * (WIDTH + WALL) + WIDTH])
    near = np.abs(boxes - room).max(1)
    assert near.min() <= 2
    known = dict(zip(FEATURES, describe(scene, door, boxes)[near.argmin()].tolist(), strict=True))
    assert known["left_contact"] > 0.9
    assert known["right_contact"] > 0.9
    assert known["near_contact"] > 0.9
    assert known["hull"] == 1
    assert known["width"] == pytest.approx(WIDTH * 0.05, abs=0.15) and known["depth"] == pytest.approx(
        DEPTH * 0.05, abs=0.15
    )
