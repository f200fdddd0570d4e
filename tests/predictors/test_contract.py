"""What every predictor has in common."""

from __future__ import annotations

import numpy as np
import pytest

from layoutexplore import predictors
from layoutexplore.drawing.layouts import draw_layout
from layoutexplore.errors import ConfigError, LayoutExploreError, UnknownNameError
from layoutexplore.frontiers.decision import Decision, Privileged
from layoutexplore.layout.export import layout_to_geojson
from layoutexplore.layout.types import Layout
from layoutexplore.predictors import make_predictor, make_room_predictor, predictor_names
from layoutexplore.predictors.seen_rooms import seen_regions
from layoutexplore.simulation.simulation import Simulation

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
    regions = seen_regions(cells, decision.grid.resolution)
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
