"""Rectangles that may be the room behind a door."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from layoutexplore.closed_doors.candidates import rectangles
from layoutexplore.closed_doors.features import FEATURES, describe
from layoutexplore.closed_doors.prediction import find_closed_doors, turned_scenes
from tests.closed_doors.cases import DEPTH, WALL, WIDTH, office

LEARNT_FROM = [
    *(0.417, 0.417, 0.014, 1.0, 0.71, 0.568, 1.269, 0.0, 0.0, 8.333, 0.417, 0.417, 0.014),
    *(0.282, 0.208, 2.358, 3.358, 8.036, 0.636, 0.983, 1.0, 1.0, 1.0, 0.15, 0.15, 0.167),
    *(1.0, 0.925, 0.712, 0.533, 0.825, 5.0, 5.0, 0.557, 2.559, 0.0, 0.0, 0.0, 0.012),
    *(0.061, 0.417, 0.333, 0.472, 0.766, 0.589, 0.26, 0.26, 2.063, 1.963, 0.167, 0.167, 0.075),
]
"""`FEATURES` of the rectangles in the test below, their means."""


def behind_the_door(seen: NDArray[np.int8]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The rectangles behind the one door of a map, and what is known of them."""
    doors = find_closed_doors(
        seen, 0.05, lambda turns, edges, features: (features[:, 7] > 0.1) * (features[:, 0] < 2.0) * 1.0
    )
    (door,) = doors[0]
    scene = next(iter(turned_scenes(seen, 0.05, doors)))
    boxes = rectangles(scene, door)
    return boxes, describe(scene, door, boxes)


def test_one_of_the_rectangles_is_the_room() -> None:
    boxes, described = behind_the_door(office((2,))[0])
    room = np.array([10, 10 + 2 * (WIDTH + WALL), 10 + DEPTH, 10 + 2 * (WIDTH + WALL) + WIDTH])
    near = np.abs(boxes - room).max(1)
    assert near.min() <= 2
    known = dict(zip(FEATURES, described[near.argmin()].tolist(), strict=True))
    assert known["left_contact"] > 0.9
    assert known["right_contact"] > 0.9
    assert known["near_contact"] > 0.9
    assert known["hull"] == 1
    assert known["width"] == pytest.approx(WIDTH * 0.05, abs=0.15) and known["depth"] == pytest.approx(
        DEPTH * 0.05, abs=0.15
    )


def test_rectangles_and_what_is_known_of_them_are_those_that_the_trees_have_learnt_from() -> None:
    """Otherwise the trees that ship are to be trained anew: `layoutexplore evaluate train-closed-doors`."""
    boxes, described = behind_the_door(office((2,))[0])
    assert len(boxes) == 24 and boxes.sum(0).tolist() == [788, 4712, 2400, 5844]
    assert np.round(described.mean(0), 3).tolist() == pytest.approx(LEARNT_FROM, abs=0.002)
