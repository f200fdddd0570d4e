"""What is to be corrected in an imported plan."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np
import pytest
import shapely

from layoutexplore.importing.findings import find_faults, resolution_for
from layoutexplore.maps import load_plan
from layoutexplore.maps.floorplan import Door, FloorPlan, Room
from layoutexplore.maps.tracing import floorplan_from_ascii

FLAT = """
###################
#aaaaaaa#bbbbbbbbb#
#aaaaaaa#bbbbbbbbb#
#aaaaaaa..bbbbbbbb#
#aaaaaaa##bbbbbbbb#
########.####.#####
#cccccccccccccccdd#
#cccccccccccccccdd#
#####.########.####
#eeeeeee##fffffff##
#eeeeeee##fffffff##
###################
"""


def kinds(plan: FloorPlan) -> list[str]:
    return sorted({finding.kind for finding in find_faults(plan)})


def test_a_good_plan_has_nothing_to_correct() -> None:
    assert kinds(load_plan("office-01")) == []


def flat_of_boxes(gap: float) -> FloorPlan:
    """Three rooms of 4 m in a row with doors between them, and a gap between the rooms."""
    lefts = [(4.0 + gap) * k for k in range(3)]
    rooms = [Room(id=k + 1, polygon=shapely.box(left, 0.0, left + 4.0, 4.0)) for k, left in enumerate(lefts)]
    middles = [left - gap / 2 for left in lefts[1:]]
    doors = [Door(start=(x, 1.5), end=(x, 2.4), rooms=(k + 1, k + 2)) for k, x in enumerate(middles)]
    return FloorPlan(name="flat", rooms=rooms, doors=doors)


def test_rooms_that_touch_without_walls_are_told() -> None:
    found = find_faults(flat_of_boxes(0.0))
    assert [finding.kind for finding in found] == ["no wall"]
    assert "rooms 1 and 2 (and 1 more pair) touch" in found[0].text and (found[0].x % 4.0) == 0.0
    assert kinds(flat_of_boxes(0.2)) == []


@pytest.mark.parametrize(("factor", "word"), [(0.4, "narrower"), (3.0, "wider")])
def test_a_wrong_scale_shows_in_the_doors(factor: float, word: str) -> None:
    plan = load_plan("office-01").stretched(factor, factor)
    scale = find_faults(plan)[0]
    assert scale.kind == "scale" and word in scale.text
    # What the text proposes is about what went wrong.
    assert float(scale.text.rsplit(" times", 1)[0].rsplit(" ", 1)[1]) == pytest.approx(1 / factor, rel=0.15)


@pytest.mark.parametrize(
    ("unit", "metres"), [("ft", 0.3048), ("cm", 0.01), ("mm", 0.001), ("inches", 0.0254)]
)
def test_other_units_than_metres_are_recognised(unit: str, metres: float) -> None:
    plan = load_plan("apartment-01").stretched(1 / metres, 1 / metres)
    scale = next(finding for finding in find_faults(plan) if finding.kind == "scale")
    word = {"inches": "in"}.get(unit, unit)  # as --scale-by takes it
    assert f"is it in {unit}? --scale-by '1 {word} = 1 unit'" in scale.text


def test_a_wall_that_is_left_where_two_rooms_became_one_is_found() -> None:
    left, right, both = (shapely.box(x0, 0, x1, 3) for x0, x1 in ((0, 4), (4.2, 9), (0, 9)))
    walls = shapely.box(-0.2, -0.2, 9.2, 3.2).difference(left.union(right))
    one = FloorPlan(name="one", rooms=(Room(id=1, polygon=both, label="office"),), walls=walls)
    found = next(finding for finding in find_faults(one) if finding.kind == "parted room")
    assert "walls part room 1 (office)" in found.text and 4 < found.x < 4.2 and 0 < found.y < 3
    pillar = dataclasses.replace(one, walls=walls.difference(shapely.box(4, 0, 4.2, 1.5)))
    assert "parted room" not in kinds(pillar)
    assert "parted room" not in kinds(load_plan("office-01"))


def test_rooms_without_doors_have_their_places() -> None:
    plan = floorplan_from_ascii(FLAT.replace(".", "#"), 0.9)
    found = [finding for finding in find_faults(plan) if finding.kind == "no door"]
    assert len(found) == 4  # c and d touch
    for finding in found:
        assert any(
            room.polygon.buffer(0.01).contains_properly(_point(finding.x, finding.y)) for room in plan.rooms
        )
    lost = [finding for finding in find_faults(plan) if finding.kind == "out of reach"]
    assert len(lost) == 4


def test_a_door_far_from_its_rooms_is_found() -> None:
    plan = flat_of_boxes(0.0)
    door = dataclasses.replace(plan.doors[0], start=(0.0, 40.0), end=(0.9, 40.0))
    moved = dataclasses.replace(plan, doors=(door, *plan.doors[1:]))
    assert "lost door" in kinds(moved) and "lost door" not in kinds(plan)


def test_tiny_rooms_and_narrow_doors() -> None:
    plan = floorplan_from_ascii(FLAT, 0.45)
    assert "narrow door" in kinds(plan) and "tiny room" in kinds(plan)


def _point(x: float, y: float):  # type: ignore[no-untyped-def]
    from shapely import Point

    return Point(x, y)


def test_only_the_box_of_what_is_out_of_reach_is_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    """A plan may fall into thousands of parts: looking at all of it for each would take hours."""
    rooms = "\n".join(["#" * 121] + [("#" + "aaaaa#" * 20 + "\n") * 4 + "#" * 121] * 8)
    plan = floorplan_from_ascii(rooms.replace("\n\n", "\n"), 0.5)
    looked_at: list[int] = []
    distances = cv2.distanceTransform

    def counted(mask: np.ndarray, *arguments: int) -> np.ndarray:
        looked_at.append(mask.size)
        return distances(mask, *arguments)

    monkeypatch.setattr(cv2, "distanceTransform", counted)
    lost = [finding for finding in find_faults(plan) if finding.kind == "out of reach"]
    resolution = resolution_for(plan)
    x0, y0, x1, y1 = plan.bounds
    assert len(looked_at) == len(lost) > 100
    assert sum(looked_at) < 3 * (x1 - x0) * (y1 - y0) / resolution**2
    assert len({(round(finding.x), round(finding.y)) for finding in lost}) == len(lost)


def test_floor_on_which_a_robot_fits_nowhere_is_found() -> None:
    # Bright lines on a dark ground: what is taken for floor are the walls.
    lines = floorplan_from_ascii("#####\n#aaa#\n#a###\n#####", resolution=0.1)
    found = [finding for finding in find_faults(lines) if finding.kind == "out of reach"]
    assert len(found) == 1 and "0.4 m wide fits nowhere" in found[0].text
    assert "out of reach" not in kinds(lines.stretched(20.0, 20.0))


@pytest.mark.parametrize(("unit", "metres"), [("cm", 0.01), ("inches", 0.0254)])
def test_rooms_tell_the_unit_where_all_doors_are_too_wide_to_be_doors(unit: str, metres: float) -> None:
    flat = flat_of_boxes(0.2)
    large = FloorPlan(name="large", rooms=flat.rooms, doors=()).stretched(1 / metres, 1 / metres)
    scale = find_faults(large)[0]
    assert scale.kind == "scale" and f"is it in {unit}?" in scale.text
    assert "scale" not in kinds(FloorPlan(name="flat", rooms=flat.rooms, doors=()))
