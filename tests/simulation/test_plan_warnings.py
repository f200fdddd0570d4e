"""What is said of a floor plan before it is explored."""

from __future__ import annotations

import warnings
from dataclasses import replace

import pytest

from layoutexplore.errors import MapWarning
from layoutexplore.grids.grid import Pose
from layoutexplore.maps.image import said_scale
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.simulation.simulation import Simulation

SPLIT = """
#################
#.......#.......#
#.......#.......#
#########.......#
#################
"""


def said(plan_text: str, start: Pose | None = None, file: str = "", **metadata: str) -> list[str]:
    plan = replace(floorplan_from_ascii(plan_text, resolution=1.0, name="plan"), metadata=metadata, file=file)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        Simulation(plan).reset(seed=0, start=start)
        Simulation(plan).reset(seed=1)
    return [str(warning.message) for warning in caught if issubclass(warning.category, MapWarning)]


def test_floor_out_of_reach_is_told_once() -> None:
    (told,) = said(SPLIT)
    assert "40% of the floor (14 of 35 m2) cannot be reached from its largest part" in told
    assert told.startswith("plan: ") and "layoutexplore maps import" in told
    assert said(SPLIT, file="flat/sheet.geojson")[0].startswith("flat/sheet.geojson: 40% of the floor")
    assert said(SPLIT.replace("#.......#.......#\n#########", "#...............#\n#########")) == []


def test_a_start_in_a_small_part_is_told() -> None:
    told = said(SPLIT, Pose(3.0, 3.0, 0.0))
    assert any("60% of the floor (21 of 35 m2) cannot be reached from the start's part" in t for t in told)


@pytest.mark.parametrize(("resolution", "guessed"), [(None, True), (0.05, False)])
def test_a_scale_that_was_assumed_is_told(resolution: float | None, guessed: bool) -> None:
    told = said("#####\n#...#\n#####", scale=said_scale(resolution))
    assert [("its scale is a guess" in text and "--scale-by" in text) for text in told] == [True] * guessed
