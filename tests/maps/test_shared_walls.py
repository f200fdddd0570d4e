"""Walls and doors of rooms that share their outlines."""

from __future__ import annotations

import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.errors import MapError, MapWarning
from layoutexplore.maps.shared_walls import Opening, plan_from_outlines
from tests.maps.cases import share_reached


@settings(deadline=None, max_examples=20)
@given(
    st.lists(st.floats(2.0, 8.0), min_size=2, max_size=4),
    st.floats(0.7, 1.4),
    st.floats(0.25, 0.75),
    st.floats(0.0, 0.3),
)
def test_a_row_of_rooms_can_be_walked_through_its_doors(
    sides: list[float], width: float, share: float, slit: float
) -> None:
    """Whatever the sizes, the place of the door and a slit between the outlines."""
    outlines, openings, left = {}, [], 0.0
    for number, side in enumerate(sides, start=1):
        outlines[number] = shapely.box(left, 0.0, left + side, 4.0)
        left += side + slit
        openings.append(Opening((left - slit / 2, 4.0 * share), width))
    plan = plan_from_outlines(outlines, {}, openings[:-1], name="row")
    assert [door.rooms for door in plan.doors] == [(k, k + 1) for k in range(1, len(sides))]
    assert all(door.width == pytest.approx(width) for door in plan.doors)
    assert share_reached(plan) > 0.99
    shut = plan.with_doors_closed(range(len(plan.doors)))
    assert share_reached(shut) < 0.99


def test_doors_to_the_outside_and_doors_on_no_wall() -> None:
    room = {5: shapely.box(0, 0, 6, 4)}
    with pytest.warns(MapWarning, match="1 of 2 doors lie on no wall"):
        plan = plan_from_outlines(room, {5: "hall"}, [Opening((3.0, 0.1)), Opening((3.0, 2.0))], name="hall")
    (door,) = plan.doors
    assert door.rooms == (0, 5) and {round(v, 6) for v in (door.start[1], door.end[1])} == {0.0}
    with pytest.raises(MapError, match="no room"):
        plan_from_outlines({}, {}, [], name="nothing")
