"""Bad plans: every knob does what it says, and a seed decides all of it."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np
import pytest
import shapely

from layoutexplore.errors import ConfigError
from layoutexplore.maps.floorplan import FloorPlan, Room
from layoutexplore.maps.library import load_plan
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.maps.tracing import trace_doors
from layoutexplore.priors.presets import PRESETS
from layoutexplore.priors.spoiling import MOST_STRETCH, SpoilConfig, SpoiledPlan, spoil
from tests.priors.cases import door_middles, office


def spoiled(seed: int = 0, **knobs: float | bool) -> SpoiledPlan:
    return spoil(office(), SpoilConfig(**knobs), np.random.default_rng(seed))


def open_doors(found: SpoiledPlan) -> np.ndarray:
    """Which doors of the plan are drawn."""
    at = np.floor(found.distortion.forward(door_middles(office())) / found.resolution).astype(int)
    return np.asarray(found.free[at[:, 1], at[:, 0]])


def separate(found: SpoiledPlan) -> int:
    """Number of separate pieces of floor of half a square metre and more."""
    _, _, stats, _ = cv2.connectedComponentsWithStats(found.free.astype(np.uint8), connectivity=4)
    return int(np.count_nonzero(stats[1:, cv2.CC_STAT_AREA] * found.resolution**2 > 0.5))


def test_no_knob_changes_nothing() -> None:
    found, raster = spoiled(), office().rasterize(0.1)
    assert found.free.sum() == pytest.approx(raster.free.sum(), rel=0.01) and not found.changed
    assert open_doors(found).all() and separate(found) == 1


def test_the_same_seed_makes_the_same_plan() -> None:
    knobs = {"merged": 0.1, "split": 0.1, "moved": 0.1, "missing": 0.1, "stretch": 0.03, "scale": 0.1}
    first, second, other = (spoiled(seed, **knobs) for seed in (3, 3, 4))
    assert np.array_equal(first.free, second.free) and first.changed == second.changed
    assert first.free.shape != other.free.shape or not np.array_equal(first.free, other.free)


def test_merged_rooms_are_one() -> None:
    found = spoiled(merged=0.2)
    gone = set(range(1, 12)) - set(np.unique(found.room_ids).tolist())
    assert len(gone) == 2 and gone < found.changed and len(found.changed) == 4
    assert found.free.sum() > spoiled().free.sum()


def test_split_rooms_have_a_wall_and_a_door() -> None:
    found = spoiled(split=0.2)
    assert found.room_ids.max() == 13 and len(found.changed) == 2
    assert found.free.sum() < spoiled().free.sum()
    assert separate(found) == 1


def test_a_plan_without_any_room_is_an_empty_sheet() -> None:
    bare = dataclasses.replace(office(), doors=())
    found = spoil(bare, SpoilConfig(missing=1.0, outdated=0.5, furniture=1.0), np.random.default_rng(0))
    assert not found.free.any() and not found.room_ids.any() and min(found.free.shape) > 100


def test_a_wall_of_one_cell_has_no_holes_in_a_drawing_that_is_turned() -> None:
    halls = (shapely.box(0, 0, 20, 30), shapely.box(20.1, 0, 40, 30))
    plan = FloorPlan(name="halls", rooms=tuple(Room(id=k + 1, polygon=hall) for k, hall in enumerate(halls)))
    for seed in range(8):
        found = spoil(plan, SpoilConfig(turned=True, skew=5.0), np.random.default_rng(seed))
        assert separate(found) == 2 and not trace_doors(PlanRaster(~found.free, found.room_ids, 0.1))


def test_rooms_with_high_ids_are_split() -> None:
    rooms = tuple(dataclasses.replace(room, id=32_756 + room.id) for room in office().rooms)
    found = spoil(FloorPlan(name="high", rooms=rooms), SpoilConfig(split=0.5), np.random.default_rng(0))
    assert found.room_ids.max() > 32_767


def test_the_greatest_stretching_can_be_undone() -> None:
    points = np.random.default_rng(0).uniform(0.0, 30.0, (500, 2))
    for seed in range(10):
        distortion = spoiled(seed, stretch=MOST_STRETCH).distortion
        back = distortion.backward(distortion.forward(points))
        assert np.hypot(*(back - points).T).max() < 0.1
    with pytest.raises(ConfigError, match="stretch"):
        SpoilConfig(stretch=0.2)


def test_missing_rooms_are_solid() -> None:
    found = spoiled(missing=0.3)
    present = set(np.unique(found.room_ids).tolist()) - {0}
    assert len(found.changed) == 3 and present == set(range(1, 12)) - found.changed


def test_where_one_wall_cannot_be_moved_another_is() -> None:
    """A corridor is too narrow to give floor to the rooms beside it, and that is their longest wall."""
    plan = load_plan("school-01")
    moved = spoil(plan, SpoilConfig(moved=0.5), np.random.default_rng(0)).changed
    assert len(moved) > 0.25 * len(plan.rooms)


def test_moved_walls_give_floor_to_a_neighbour() -> None:
    found = spoiled(moved=0.2)
    before = np.bincount(office().rasterize(0.1).room_ids.ravel(), minlength=12) * 0.01
    after = np.bincount(found.room_ids.ravel(), minlength=12) * 0.01
    differ = np.flatnonzero(np.abs(after - before)[1:] > 1.0) + 1
    assert len(found.changed) >= 2 and set(differ.tolist()) <= found.changed and len(differ) >= 2


@pytest.mark.parametrize("share", [0.3, 1.0])
def test_missing_doors_are_walls(share: float) -> None:
    found = spoiled(doors_missing=share)
    assert np.count_nonzero(~open_doors(found)) == round(10 * share)
    assert separate(found) == 1 + round(10 * share)


def test_added_doors_join_rooms() -> None:
    found = spoiled(doors_missing=1.0, doors_added=0.4)
    assert separate(found) == 11 - 4


def test_corridors_alone_are_left() -> None:
    found = spoiled(corridors_only=True)
    assert set(np.unique(found.room_ids).tolist()) == {0, 1} and separate(found) == 1
    assert found.changed == frozenset(range(2, 12))


def test_furniture_takes_floor_and_no_room() -> None:
    found = spoiled(furniture=2.0)
    assert found.free.sum() < spoiled().free.sum()
    assert set(np.unique(found.room_ids).tolist()) == set(range(12))


def test_an_outdated_end_is_another_way_round() -> None:
    found, before = spoiled(outdated=0.3), spoiled()
    assert found.free.shape == before.free.shape
    columns = np.flatnonzero((found.free != before.free).any(axis=0))
    assert 0.1 < np.ptp(columns) / before.free.shape[1] < 0.4 and found.changed


def test_scale_and_aspect_stay_within_their_bounds() -> None:
    ratios = []
    for seed in range(12):
        found = spoiled(seed, scale=0.1, aspect=0.1, turned=True)
        lengths = np.linalg.svd(found.distortion.matrix, compute_uv=False)
        ratios.append(lengths)
        assert abs(np.log(lengths.prod()) / 2) <= np.log(1.1) + 1e-9
        assert np.log(lengths[0] / lengths[1]) <= np.log(1.1) + 1e-9
    assert np.std(ratios) > 0.02


def test_nonsense_is_refused() -> None:
    with pytest.raises(ConfigError, match="stretch"):
        SpoilConfig(stretch=2.0)
    with pytest.raises(ConfigError, match="merged"):
        SpoilConfig(merged=-0.1)


def test_rough_is_as_bad_as_it_is_said_to_be() -> None:
    rough = PRESETS["rough"]
    assert (rough.scale, rough.aspect, rough.stretch) == (0.1, 0.1, 0.03)
    assert rough.merged + rough.split + rough.moved + rough.missing == pytest.approx(0.2)
    assert rough.doors_missing == pytest.approx(1 / 3)
