"""Maps turned upright for a predictor, and its rooms turned back."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from layoutexplore.agents import make_agent
from layoutexplore.evaluation.partial_rooms import score_predictors
from layoutexplore.frontiers.decision import Decision
from layoutexplore.frontiers.detection import FrontierClusters
from layoutexplore.grids.arrays import Cells
from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from layoutexplore.grids.morphology import closed_by_box
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.library import load_plan
from layoutexplore.predictors import make_room_predictor
from layoutexplore.predictors.upright import UprightRooms, UprightViews, fill_steps, upright_view, wall_angle
from layoutexplore.simulation.simulation import Simulation, SimulationConfig
from layoutexplore.training.explorations import protocol_explorations


def room_at(degrees: float) -> Cells:
    """The map of a room of 9 by 6 m whose walls are turned by an angle."""
    y, x = np.mgrid[:160, :160] - 79.5
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    across, along = np.abs(c * y - s * x), np.abs(c * x + s * y)
    inside, wall = (across < 30) & (along < 45), (across < 31.5) & (along < 46.5)
    return np.where(inside, FREE, np.where(wall, OCCUPIED, UNKNOWN)).astype(np.int8)


def turned_plan(plan: FloorPlan, degrees: float) -> FloorPlan:
    """The same building on a street that runs otherwise."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    matrix = np.array([[c, s], [-s, c]])

    def move(shape: object) -> object:
        return shapely.transform(shape, lambda points: points @ matrix)

    rooms = tuple(dataclasses.replace(room, polygon=move(room.polygon)) for room in plan.rooms)
    doors = tuple(
        dataclasses.replace(
            door, start=tuple(np.array(door.start) @ matrix), end=tuple(np.array(door.end) @ matrix)
        )
        for door in plan.doors
    )
    shapes = {name: move(getattr(plan, name)) for name in ("walls", "furniture", "passages")}
    return dataclasses.replace(plan, rooms=rooms, doors=doors, **shapes)


@settings(max_examples=20, deadline=None)
@given(st.floats(-44.0, 44.0))
def test_the_angle_of_walls_is_found(degrees: float) -> None:
    found = math.degrees(wall_angle(room_at(degrees), 0.1))
    assert abs(found - degrees) <= 1.5 if abs(degrees) > 5 else found == 0 or abs(found - degrees) <= 1.5


@pytest.mark.parametrize(("walls", "held"), [(17.4, 16.7), (17.4, 17.3), (44.8, -44.95)])
def test_an_angle_that_is_hardly_less_sharp_is_held(walls: float, held: float) -> None:
    assert wall_angle(room_at(walls), 0.1, math.radians(held)) == math.radians(held)


@pytest.mark.parametrize(("walls", "held"), [(17.0, 26.0), (17.0, -17.0), (0.0, 4.0)])
def test_an_angle_that_is_not_that_of_the_walls_is_given_up(walls: float, held: float) -> None:
    assert wall_angle(room_at(walls), 0.1, math.radians(held)) == wall_angle(room_at(walls), 0.1)


def test_each_exploration_begins_with_an_angle_of_its_own() -> None:
    plan, views = turned_plan(load_plan("office-04"), 17.4), UprightViews()
    simulation = Simulation(plan, SimulationConfig(sensor="indoor"))
    found = []
    for _ in range(2):
        decision: Decision = simulation.reset(seed=1)
        angles = []
        while decision.frontiers and len(angles) < 12:
            turned = views(decision).turned
            angles.append(turned.angle if turned else 0.0)
            decision = simulation.step(0)
        found.append(angles)
    assert found[0] == found[1] and 0.0 < len(set(found[0])) <= 2
    fresh = UprightViews()(simulation.reset(seed=1)).turned
    assert (fresh.angle if fresh else 0.0) == found[0][0]


@pytest.mark.parametrize("cells", [room_at(0.0), room_at(1.0), np.full((9, 9), UNKNOWN, np.int8)])
def test_an_upright_map_is_looked_at_as_it_is(cells: Cells) -> None:
    grid, clusters = OccupancyGrid(cells, 0.1), FrontierClusters.of([])
    view = upright_view(grid, clusters, wall_angle(cells, 0.1))
    assert view.grid is grid and view.clusters is clusters and view.turned is None


@pytest.mark.parametrize("degrees", [-31.0, 12.0, 40.0])
def test_a_turned_map_is_upright_and_its_frontiers_are_free(degrees: float) -> None:
    cells = room_at(degrees)
    edge = np.argwhere((cells == FREE) & (np.roll(cells, 1, axis=0) == OCCUPIED)).astype(np.int32)
    clusters = FrontierClusters.of([edge[:20], edge[20:50]])
    view = upright_view(OccupancyGrid(cells, 0.1), clusters, wall_angle(cells, 0.1))
    assert view.turned is not None and wall_angle(view.grid.cells, 0.1) == 0.0
    assert (view.grid.cells[view.clusters.cells[:, 0], view.clusters.cells[:, 1]] == FREE).all()
    assert view.clusters.offsets.tolist() == [0, 20, 50]
    free, before = np.count_nonzero(view.grid.cells == FREE), np.count_nonzero(cells == FREE)
    assert abs(free - before) < 0.1 * before, "no part of the map is lost"
    rows = (view.grid.cells == OCCUPIED).sum(axis=1)
    assert np.sort(rows)[-2:].min() > 70, "the long walls lie along rows"


@pytest.mark.parametrize("degrees", [17.0, -31.0])
def test_walls_of_a_turned_map_are_as_thick_at_any_resolution(degrees: float) -> None:
    cells, angle = room_at(degrees), math.radians(degrees)
    fine, coarse = (
        upright_view(OccupancyGrid(cells, resolution), FrontierClusters.of([]), angle).grid.occupied.sum()
        for resolution in (0.05, 0.1)
    )
    assert fine == pytest.approx(coarse, rel=0.05)


@settings(deadline=None)
@given(
    cells=arrays(
        np.int8, array_shapes(min_dims=2, max_dims=2, max_side=12), elements=st.sampled_from((0, 100))
    ),
    longest=st.integers(1, 6),
)
def test_breaks_of_walls_are_filled_as_closing_by_a_box_fills_them(cells: Cells, longest: int) -> None:
    around = np.pad(cells == OCCUPIED, longest)
    closed = closed_by_box(around, 1, longest) | closed_by_box(around, longest, 1)
    fill_steps(cells, np.argwhere(cells == OCCUPIED), longest)
    assert np.array_equal(cells == OCCUPIED, closed[longest:-longest, longest:-longest])


def test_rooms_of_a_turned_map_keep_all_that_is_seen() -> None:
    plan = turned_plan(load_plan("office-04"), 17.0)
    decision: Decision = Simulation(plan, SimulationConfig(sensor="indoor")).reset(seed=1)
    predictor = make_room_predictor("layout")
    judged = predictor.predict(decision)
    assert isinstance(judged.rooms, UprightRooms) and judged.rooms.labels.shape == decision.grid.shape
    rooms, free = predictor.rooms(decision), decision.grid.free
    assert rooms.passable[free].all() and not rooms.passable[decision.grid.occupied].any()
    assert (judged.rooms.labels[free] > 0).mean() > 0.99, "what is seen is in a room"
    assert (judged.rooms.sketch[free] > 0).mean() > 0.99 and not judged.rooms.inside[free].any()
    again = predictor.predict(decision)
    assert [f.expected_area for f in again.frontiers] == [f.expected_area for f in judged.frontiers]


def test_rooms_are_foreseen_on_a_turned_map(monkeypatch: pytest.MonkeyPatch) -> None:
    plan = turned_plan(load_plan("office-04"), 17.0)
    asked = [s for part in protocol_explorations(plan, make_agent, sensors=["stage"]) for s in part]

    def hidden() -> float:
        scores = score_predictors(asked, [make_room_predictor("layout")])
        return float(np.mean([room.hidden_iou for room in scores.rooms]))

    upright = hidden()
    monkeypatch.setattr("layoutexplore.predictors.upright.wall_angle", lambda *found: 0.0)
    assert upright > hidden()
