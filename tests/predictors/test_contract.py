"""What every predictor has in common."""

from __future__ import annotations

import numpy as np
import pytest

from layoutexplore import predictors
from layoutexplore.drawing.layouts import draw_layout
from layoutexplore.errors import ConfigError, LayoutExploreError, UnknownNameError
from layoutexplore.frontiers.decision import Decision, Privileged
from layoutexplore.grids.grid import OccupancyGrid
from layoutexplore.layout.doorways import doorway_regions
from layoutexplore.layout.export import layout_to_geojson
from layoutexplore.layout.pipeline import method_names
from layoutexplore.layout.types import Layout
from layoutexplore.predictors import make_predictor, make_room_predictor, predictor_names
from layoutexplore.simulation.simulation import Simulation
from tests.predictors.cases import decide

OTHER_ROOMS = {"oracle", "reconstruct"}
"""Predictors whose rooms are not those that are seen; tests of their own hold what they promise."""


def test_every_predictor_by_name() -> None:
    assert predictor_names()[0] == "none" and {
        "rectangle",
        "hull",
        "parallel-wall",
        "face-subset",
        "oracle",
        "layout",
    } < set(predictor_names())
    assert make_predictor("none") is None and make_room_predictor("none").name == "none"
    with pytest.raises(UnknownNameError, match="layout"):
        make_predictor("layuot")
    with pytest.raises(ConfigError, match="flip"):
        make_predictor("layout:flip=1")
    with pytest.raises(ConfigError, match="known: off, on"):
        make_predictor("layout:network=maybe")


@pytest.mark.parametrize("name", [*sorted(set(predictor_names()) - OTHER_ROOMS), "layout:network=off"])
def test_rooms_hold_what_is_seen_and_nothing_in_walls(name: str, decision: Decision) -> None:
    predictor = make_room_predictor(name)
    cells = decision.grid.cells
    rooms = predictor.rooms(decision)
    regions = doorway_regions(cells, decision.grid.resolution)
    assert rooms.room_ids.dtype == np.int32 and rooms.passable.dtype == np.bool_
    assert (rooms.room_ids[cells == 0] == regions.labels[cells == 0]).all()
    assert not rooms.room_ids[cells == 100].any() and not rooms.passable[cells == 100].any()
    assert rooms.passable[cells == 0].all()
    judged = predictor.predict(decision)
    for frontier in judged.frontiers:
        assert isinstance(frontier.is_closed, bool) and (frontier.expected_area or 0.0) >= 0.0
        assert 0.0 <= (frontier.confidence or 0.0) <= 1.0 and frontier.room is not None


@pytest.mark.parametrize("name", [name for name in predictor_names() if name != "none"])
def test_predictors_say_the_same_again_and_leave_the_decision_alone(
    name: str, simulation: Simulation, decision: Decision
) -> None:
    cells, table, judged = decision.grid.cells.copy(), np.array(decision.table), []
    for _ in range(2):
        predictor = make_room_predictor(name)
        if isinstance(predictor, Privileged):
            predictor.reveal(simulation.truth)
        judged.append(np.array(predictor.predict(decision).table))
    assert np.array_equal(*judged, equal_nan=True)
    assert np.array_equal(decision.grid.cells, cells)
    assert np.array_equal(np.array(decision.table), table, equal_nan=True)


@pytest.mark.parametrize("name", predictor_names())
def test_predictors_are_documented_and_refuse_what_they_do_not_have(name: str) -> None:
    assert f"`{name}`" in (predictors.__doc__ or "") or f"`{name}:" in (predictors.__doc__ or "")
    with pytest.raises(LayoutExploreError, match="nonsense"):
        make_room_predictor(f"{name}:nonsense=1")


EVERY_KIND = [
    *(name for name in predictor_names() if name not in ("none", "oracle", "reconstruct")),
    *(f"reconstruct:{method}" for method in (*method_names(), "merging")),
    *(f"learned:rooms={method}" for method in ("rose2", "distance", "rose")),
]
"""Predictors that know no truth, with every layout method."""


def corridor_and_rooms() -> OccupancyGrid:
    """Two half-seen rooms on a corridor that goes on, free cells beside the unknown; not symmetric."""
    cells = np.full((90, 130), -1, np.int8)
    cells[20:80, 20:110] = 100
    cells[22:38, 22:112] = 0  # the corridor, open to the right
    cells[40:78, 22:60] = cells[40:70, 62:100] = 0
    cells[37:41, 36:45] = cells[37:41, 75:84] = 0  # doors
    cells[60:80, 44:62] = cells[55:80, 88:110] = -1
    return OccupancyGrid(cells, 0.1)


@pytest.mark.parametrize("name", EVERY_KIND)
def test_labels_lie_where_it_is_free_and_frontiers_in_rooms_that_there_are(name: str) -> None:
    decision = decide(corridor_and_rooms())
    predictor = make_room_predictor(name)
    judged, rooms = predictor.predict(decision), predictor.rooms(decision)
    cells = decision.grid.cells
    assert judged.rooms is not None and (judged.rooms.labels[~rooms.passable] == 0).sum() > 0
    assert not (judged.rooms.labels[cells == 100] > 0).any()
    there = set(np.unique(rooms.room_ids).tolist()) | {0}
    for frontier in judged.frontiers:
        assert frontier.room in there and frontier.is_closed is not None
        assert frontier.expected_area is not None and np.isfinite(frontier.expected_area)
    again = make_room_predictor(name).predict(decision)
    assert np.array_equal(np.array(judged.table), np.array(again.table), equal_nan=True)
    assert again.rooms is not None and (again.rooms.labels == judged.rooms.labels).all()


@pytest.mark.parametrize("name", EVERY_KIND)
def test_mirrored_buildings_have_the_same_classes(name: str) -> None:
    grid = corridor_and_rooms()
    mirrored = OccupancyGrid(np.ascontiguousarray(grid.cells[:, ::-1]), grid.resolution)
    here, there = (make_room_predictor(name).predict(decide(g)) for g in (grid, mirrored))
    columns = grid.shape[1] - 1
    assert len(here.frontiers) == len(there.frontiers) > 1
    for frontier in here.frontiers:
        cell = frontier.cells[0] * (1, -1) + (0, columns)
        twin = next(f for f in there.frontiers if (f.cells == cell).all(axis=1).any())
        assert twin.is_closed == frontier.is_closed
        if not name.startswith(("layout", "learned", "prior")):  # the networks see crops, not a canonical map
            assert twin.expected_area == pytest.approx(frontier.expected_area, rel=0.15, abs=0.3)


SCRAPS = {"no walls": np.s_[10:30, 10:40], "one cell": np.s_[20, 20], "no floor beside a beam": np.s_[20]}


@pytest.mark.parametrize("name", EVERY_KIND)
@pytest.mark.parametrize("what", list(SCRAPS))
def test_where_nothing_can_be_predicted_nothing_breaks(name: str, what: str) -> None:
    cells = np.full((40, 50), -1, np.int8)
    cells[SCRAPS[what]] = 0
    judged = make_room_predictor(name).predict(decide(OccupancyGrid(cells, 0.1)))
    assert len(judged.frontiers) and all(f.is_closed is not None for f in judged.frontiers)
    if name.startswith("reconstruct:"):
        assert not any(f.is_closed for f in judged.frontiers)  # no wall closes anything


@pytest.mark.parametrize(
    ("spec", "said"),
    [
        ("learned:rooms=rose3", "rose3"),
        ("reconstruct:rose3", "rose3"),
        ("reconstruct:merging;nonsense=1", "nonsense"),
    ],
)
def test_unknown_methods_are_named(spec: str, said: str) -> None:
    with pytest.raises(LayoutExploreError, match=said):
        make_room_predictor(spec)


def judged_by(*specs: str) -> list[Decision]:
    decision = decide(corridor_and_rooms())
    return [make_room_predictor(spec).predict(decision) for spec in specs]


def test_merging_is_the_name_of_the_default() -> None:
    named, shipped = judged_by("reconstruct:merging", "reconstruct:default")
    assert np.array_equal(np.array(named.table), np.array(shipped.table), equal_nan=True)
    assert named.rooms is not None and shipped.rooms is not None
    assert (named.rooms.labels == shipped.rooms.labels).all()


def test_layout_is_learned_with_the_rooms_of_doorways() -> None:
    shipped, named, other = judged_by("layout", "learned:rooms=doorways", "learned:rooms=rose")
    assert np.array_equal(np.array(shipped.table), np.array(named.table), equal_nan=True)
    assert shipped.rooms is not None and named.rooms is not None and other.rooms is not None
    assert (shipped.rooms.labels == named.rooms.labels).all()
    assert (shipped.rooms.labels != other.rooms.labels).any()  # without rooms, what is connected is one


@pytest.mark.parametrize("name", [name for name in predictor_names() if name != "none"])
def test_predicted_rooms_are_a_layout(name: str, simulation: Simulation, decision: Decision) -> None:
    predictor = make_room_predictor(name)
    if isinstance(predictor, Privileged):
        predictor.reveal(simulation.truth)
    rooms = predictor.predict(decision).rooms
    cells = decision.grid.cells
    assert rooms is not None
    assert rooms.labels.dtype == np.int32 and rooms.labels.shape == cells.shape
    assert not rooms.labels[cells == 100].any() and rooms.labels[cells == 0].any()
    assert rooms.inside.dtype == np.float32 and not rooms.inside[cells != -1].any()
    assert 0.0 <= rooms.inside.min() <= rooms.inside.max() <= 1.0
    layout = rooms.layout
    assert isinstance(layout, Layout) and layout.rooms and all(room.polygon.is_valid for room in layout.rooms)
    collection = layout_to_geojson(layout)
    kinds = [feature["properties"]["kind"] for feature in collection["features"]]
    assert kinds.count("room") == len(layout.rooms)
    assert draw_layout(layout, panel=80).ndim == 3
