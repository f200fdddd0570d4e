"""What is foreseen: the registered plan on the robot's grid, silent where it is contradicted."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import shapely

from layoutexplore.grids.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, Pose
from layoutexplore.grids.morphology import inflate
from layoutexplore.maps.floorplan import Door, FloorPlan
from layoutexplore.priors import completion
from layoutexplore.priors.completion import TRUST, PlanOnMap, contradicted_rooms, trusted_reach
from layoutexplore.priors.fields import make_fields
from layoutexplore.priors.plan import PriorPlan, prior_of_plan
from layoutexplore.priors.presets import study_prior
from layoutexplore.priors.registration import Registration
from tests.priors.cases import office, seen_part


def registered(grid: OccupancyGrid, kind: str = "true") -> Registration:
    registration = Registration(study_prior(kind, office(), 0).prior)
    registration.update(grid)
    return registration


@pytest.mark.parametrize("kind", ["true", "mirrored"])
def test_unseen_rooms_are_foreseen_where_they_are(kind: str) -> None:
    grid, truth = seen_part(office(), 0.5), office().rasterize(0.1)
    found = PlanOnMap().foresee(registered(grid, kind), grid, 0.9, "prior")
    unseen = grid.cells == UNKNOWN
    foreseen, true = unseen & (found.cells == FREE), unseen & truth.free
    assert (foreseen & true).sum() / (foreseen | true).sum() > 0.93
    assert found.confidence == 0.9 and found.predictor == "prior"
    for room in (5, 6, 11):  # all in the unseen half
        ids = found.room_ids[(truth.room_ids == room) & unseen]
        assert np.bincount(ids).max() / len(ids) > 0.9
    assert not found.room_ids[found.cells != FREE].any()
    assert (found.cells[unseen & ~truth.free & (found.cells == OCCUPIED)] == OCCUPIED).any()


def test_a_plan_is_drawn_alike_where_coordinates_are_those_of_a_country() -> None:
    near = seen_part(office(), 0.5)
    far = OccupancyGrid(near.cells, near.resolution, Pose(near.origin.x + 4.56e5, near.origin.y + 5.654e6))
    here, there = (PlanOnMap().foresee(registered(grid), grid, 0.9, "prior") for grid in (near, far))
    assert (here.cells != there.cells).mean() < 1e-3 and (here.room_ids != there.room_ids).mean() < 1e-3


@pytest.mark.parametrize("theta", [0.3, np.pi / 2, -2.0])
def test_a_plan_is_drawn_alike_on_a_grid_that_is_turned(theta: float) -> None:
    upright = seen_part(office(), 0.5)
    turned = OccupancyGrid(upright.cells, upright.resolution, Pose(3.0, -2.0, theta))
    here, there = (PlanOnMap().foresee(registered(grid), grid, 0.9, "prior") for grid in (upright, turned))
    assert (here.cells != there.cells).mean() < 0.01 and (here.room_ids != there.room_ids).mean() < 0.01


def test_a_plan_is_drawn_anew_on_a_grid_of_the_same_shape_that_lies_elsewhere() -> None:
    """A map that goes with its robot: the cells come to lie elsewhere, the plan does not."""
    grid, follower = seen_part(office(), 0.5), PlanOnMap()
    registration = registered(grid)
    follower.foresee(registration, grid, 0.9, "prior")
    cells = np.full_like(grid.cells, UNKNOWN)
    cells[:, 10:] = grid.cells[:, :-10]
    origin = grid.origin._replace(x=grid.origin.x - 10 * grid.resolution)
    moved = OccupancyGrid(cells, grid.resolution, origin)
    found, anew = (each.foresee(registration, moved, 0.9, "prior") for each in (follower, PlanOnMap()))
    assert (found.cells != anew.cells).mean() < 1e-3 and (found.room_ids != anew.room_ids).mean() < 1e-3


def test_far_outside_nothing_is_foreseen() -> None:
    grid = seen_part(office(), 0.5)
    padded = OccupancyGrid(
        np.pad(grid.cells, 30, constant_values=UNKNOWN), 0.1, grid.origin._replace(x=-3.5, y=-3.5)
    )
    found = PlanOnMap().foresee(registered(padded), padded, 1.0, "prior")
    assert (found.cells[:20] == UNKNOWN).all() and (found.cells[:, :20] == UNKNOWN).all()


def test_a_room_that_is_not_as_drawn_is_left_out() -> None:
    grid = seen_part(office(), 0.9)
    cells, raster = grid.cells.copy(), office().rasterize(0.1)
    room = raster.room_ids == 5  # a room 9 m long: half of it is a wall now, the rest unseen
    cols = np.nonzero(room)[1]
    half = room & (np.arange(cells.shape[1]) < np.median(cols))
    cells[half & (np.indices(cells.shape).sum(axis=0) % 6 < 3)] = OCCUPIED
    cells[room & ~half] = UNKNOWN
    changed = OccupancyGrid(cells, 0.1, grid.origin)
    registration = registered(changed)
    wrong = contradicted_rooms(registration, registration.hypotheses[0])
    assert len(wrong) == 1
    found = PlanOnMap().foresee(registration, changed, 1.0, "prior")
    inside = room & ~half & (np.indices(cells.shape)[1] > np.median(cols) + 5)
    assert (found.cells[inside] == UNKNOWN).mean() > 0.8
    untouched = registered(grid)
    assert not contradicted_rooms(untouched, untouched.hypotheses[0])


def terrace(doors_between: int = 0) -> FloorPlan:
    """Two flats of eleven rooms side by side, the right one longer, each with all its doors."""
    left, offset = office("left"), 30.2
    rooms, doors = list(left.rooms), list(left.doors)
    for room in left.rooms:
        moved = shapely.transform(room.polygon, lambda points: points * [1.3, 1.0] + [offset, 0.0])
        rooms.append(dataclasses.replace(room, id=room.id + 20, polygon=moved))
    for door in left.doors:
        start, end = ((1.3 * x + offset, y) for x, y in (door.start, door.end))
        a, b = door.rooms
        doors.append(Door(start=start, end=end, rooms=(a + 20, b + 20)))
    if doors_between:
        doors.append(Door(start=(30.1, 5.5), end=(30.1, 6.5), rooms=(1, 21)))
    return FloorPlan(name="terrace", rooms=tuple(rooms), doors=tuple(doors))


@pytest.mark.parametrize("doors_between", [0, 1])
def test_a_flat_to_which_no_door_is_drawn_is_foreseen_once_the_robot_is_there(doors_between: int) -> None:
    plan = terrace(doors_between)
    prior = prior_of_plan(plan)
    assert prior.doors_missing == 0.0
    raster = plan.rasterize(0.1)
    other = (raster.room_ids > 20) & raster.free
    for share, is_foreseen in ((0.4, doors_between > 0), (0.6, True)):
        grid = seen_part(plan, share)
        registration = Registration(prior)
        registration.update(grid)
        found = PlanOnMap().foresee(registration, grid, 1.0, "prior")
        unseen = other & (grid.cells == UNKNOWN)
        assert (found.cells[unseen] == FREE).mean() > 0.9 if is_foreseen else not found.room_ids[other].any()


def test_a_plan_that_lacks_doors_says_nothing_of_parts_without_a_way() -> None:
    plan = terrace()
    gone = dataclasses.replace(plan, doors=plan.doors[3:])
    prior, grid = prior_of_plan(gone), seen_part(plan, 0.4)
    assert prior.doors_missing == pytest.approx(3 / 22)
    registration = Registration(prior)
    registration.update(grid)
    found = PlanOnMap().foresee(registration, grid, 1.0, "prior")
    raster = plan.rasterize(0.1)
    assert (found.cells[(raster.room_ids > 20) & raster.free] == FREE).mean() > 0.9


def test_slivers_along_seen_walls_are_not_foreseen() -> None:
    grid = seen_part(office(), 0.5)
    registration = Registration(prior_of_plan(office().stretched(1.02, 1.02)))
    registration.update(grid)
    found = PlanOnMap().foresee(registration, grid, 1.0, "prior")
    hidden = found.hidden(grid.cells)
    column = round(0.5 * grid.cells.shape[1])
    assert hidden[:, : column - 10].sum() < 40 < hidden[:, column:].sum()


def test_the_more_walls_are_off_the_nearer_a_plan_is_trusted() -> None:
    registration = registered(seen_part(office(), 0.5))
    best = registration.hypotheses[0]
    reaches = [
        trusted_reach(registration, dataclasses.replace(best, fit=best.fit._replace(walls=share)))
        for share in (0.0, 0.5, 0.9, 1.0)
    ]
    assert reaches[0] == TRUST and reaches == sorted(reaches)
    assert 10.0 < reaches[2] < 20.0 and reaches[3] > 50.0


def test_what_lies_beyond_is_not_foreseen(monkeypatch: pytest.MonkeyPatch) -> None:
    grid = seen_part(office(), 0.3)
    registration = registered(grid)
    monkeypatch.setattr(completion, "trusted_reach", lambda registration, best: 2.0)
    found = PlanOnMap().foresee(registration, grid, 0.9, "prior")
    foreseen = (found.cells != UNKNOWN) & (grid.cells == UNKNOWN)
    far = ~inflate(grid.cells == FREE, 2.0, 0.1)
    assert foreseen.any() and not (foreseen & far).any() and not found.room_ids[far].any()


def test_a_plan_that_stays_in_its_place_is_not_redrawn() -> None:
    registration, on_map = Registration(study_prior("true", office(), 0).prior), PlanOnMap()
    found = []
    for share in (0.6, 0.7):
        grid = seen_part(office(), share)
        registration.update(grid)
        found.append((grid, on_map.foresee(registration, grid, 1.0, "prior")))
    far = np.arange(grid.shape[1]) > 0.75 * grid.shape[1]
    assert np.array_equal(found[0][1].cells[:, far], found[1][1].cells[:, far])


def test_the_fields_of_a_long_narrow_plan_are_not_stretched() -> None:
    free, resolution = np.zeros((43, 1000), np.bool_), 0.06
    free[1:-1, 1:-1] = True
    free[:, 960:964] = False
    rooms = np.where(free, np.where(np.arange(1000) < 960, 1, 2), 0).astype(np.int32)
    fields = make_fields(PriorPlan(name="long", free=free, room_ids=rooms, resolution=resolution))
    wall = np.flatnonzero(~fields.free[fields.free.shape[0] // 2])
    across = (wall + 0.5) * fields.cell + fields.low
    assert np.mean(across[(across > 50.0) & (across < 59.5)]) == pytest.approx(962 * resolution, abs=0.06)
