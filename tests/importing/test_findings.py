"""What is to be corrected in an imported plan."""

from __future__ import annotations

import pytest

from layoutexplore.importing.findings import find_faults
from layoutexplore.maps import load_plan
from layoutexplore.maps.floorplan import FloorPlan
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


@pytest.mark.parametrize(("factor", "word"), [(0.4, "narrower"), (3.0, "wider")])
def test_a_wrong_scale_shows_in_the_doors(factor: float, word: str) -> None:
    plan = load_plan("office-01").stretched(factor, factor)
    scale = find_faults(plan)[0]
    assert scale.kind == "scale" and word in scale.text
    # What the text proposes is about what went wrong.
    assert float(scale.text.rsplit(" times", 1)[0].rsplit(" ", 1)[1]) == pytest.approx(1 / factor, rel=0.15)


@pytest.mark.parametrize(("unit", "metres"), [("ft", 0.3048), ("cm", 0.01), ("mm", 0.001)])
def test_other_units_than_metres_are_recognised(unit: str, metres: float) -> None:
    plan = load_plan("apartment-01").stretched(1 / metres, 1 / metres)
    scale = next(finding for finding in find_faults(plan) if finding.kind == "scale")
    assert f"is it in {unit}?" in scale.text


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


def test_tiny_rooms_and_narrow_doors() -> None:
    plan = floorplan_from_ascii(FLAT, 0.45)
    assert "narrow door" in kinds(plan) and "tiny room" in kinds(plan)


def _point(x: float, y: float):  # type: ignore[no-untyped-def]
    from shapely import Point

    return Point(x, y)
