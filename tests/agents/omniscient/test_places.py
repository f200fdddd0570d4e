"""Views on a floor that changes: kept where a face moves by a cell, made anew where a door opens or shuts."""

from __future__ import annotations

import numpy as np

from layoutexplore.agents.omniscient.places import Places
from layoutexplore.agents.omniscient.visibility import FloorInView, Visibility
from layoutexplore.grids.arrays import Mask, Words
from layoutexplore.sensing.lidar import sensor

SHAPE, DOOR = (60, 120), (slice(25, 35), slice(58, 62))


def two_rooms(*, door: bool, thicker: bool = False) -> FloorInView:
    """Two rooms side by side, 5 m by 5 m each, a wall of 0.4 m between them."""
    solid = np.ones(SHAPE, np.bool_)
    solid[5:55, 5:58] = solid[5:55, 62:115] = False
    if door:
        solid[DOOR] = False
    if thicker:
        solid[5:55, 5] = True
    return FloorInView(solid, ~solid, ~solid, 0.1, sensor("stage"))


def views_after(first: FloorInView, then: FloorInView) -> tuple[Places, Words]:
    places = Places(first, Visibility(first, 0.5, 5000, fixed=False), 0.8)
    before = places.views.copy()
    places.adapt(then)
    return places, before


def beyond(places: Places) -> Mask:
    """Whether each place of the left room sees any of the right one."""
    right = np.zeros(SHAPE, np.bool_)
    right[:, 62:] = True
    bits = places.visibility.set_of(right)
    return np.asarray((places.views & bits).any(axis=1) & (places.cells[:, 1] < 58))


def test_a_door_that_opens_or_shuts_is_seen_through_or_not() -> None:
    opened, _ = views_after(two_rooms(door=False), two_rooms(door=True))
    assert beyond(opened).sum() > 5
    shut, before = views_after(two_rooms(door=True), two_rooms(door=False))
    assert not beyond(shut).any() and before.any()


def test_views_are_kept_where_a_face_moves_by_a_cell() -> None:
    places, before = views_after(two_rooms(door=True), two_rooms(door=True, thicker=True))
    fresh = Places(two_rooms(door=True, thicker=True), places.visibility, 0.8)
    same = [np.array_equal(view, old) for view, old in zip(places.views, before, strict=False)]
    assert np.mean(same) > 0.9
    # What is kept differs from what would be seen by no more than the strip.
    apart = np.bitwise_count(places.views ^ fresh.views).sum(axis=1)
    assert apart.max() <= 50 and len(fresh.cells) == len(places.cells)
