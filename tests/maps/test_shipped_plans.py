"""The floor plans that ship: as generated, sound, and split by building."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from shapely import Polygon, affinity

from layoutexplore.envs.curriculum import FIRST_SEED
from layoutexplore.maps import load_plan, plan_names, splits
from layoutexplore.maps.floorplan import FloorPlan, Room
from layoutexplore.maps.generator import FAMILIES, generate
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.library import PLAN_FOLDER
from layoutexplore.maps.shipped import SPLITS, write_shipped


@pytest.fixture(scope="module")
def plans() -> dict[str, FloorPlan]:
    return {name: load_plan(name) for name in plan_names()}


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return write_shipped(tmp_path_factory.mktemp("plans"))


def test_files_are_as_generated(written: list[Path]) -> None:
    assert {file.name for file in written} == {file.name for file in PLAN_FOLDER.iterdir()}
    differing = [file.name for file in written if file.read_bytes() != (PLAN_FOLDER / file.name).read_bytes()]
    assert differing == [], "run: python -m layoutexplore.maps.shipped"


def test_no_building_and_no_geometry_ships_twice(plans: dict[str, FloorPlan]) -> None:
    assert len({plan.building for plan in plans.values()}) == len(plans)
    assert len({plan.content_hash for plan in plans.values()}) == len(plans)
    seeds = {(plan.metadata["family"], plan.metadata["seed"]) for plan in plans.values()}
    assert len(seeds) == len(plans)


def test_splits_share_nothing_and_cover_everything(plans: dict[str, FloorPlan]) -> None:
    table = splits()
    parts = [table[split] for split in SPLITS]
    assert [len(part) for part in parts] == [12, 4, 8]
    assert sorted(sum(parts, ())) == sorted(plans)
    for split in ("train", "test"):
        assert {name.rpartition("-")[0] for name in table[split]} == set(FAMILIES)


def test_the_quick_suite_is_small(plans: dict[str, FloorPlan]) -> None:
    quick = splits()["quick"]
    assert len(quick) == len({name.rpartition("-")[0] for name in quick}) == 5
    assert all(200 <= plans[name].area <= 1100 for name in quick)
    assert set(quick) <= set(splits()["test"])  # what ships has learnt from none of them


def test_sizes(plans: dict[str, FloorPlan]) -> None:
    assert min(plan.area for plan in plans.values()) < 200
    assert 3500 < max(plan.area for plan in plans.values()) < 4300
    assert sum(file.stat().st_size for file in PLAN_FOLDER.iterdir()) < 2_000_000


def test_every_room_that_is_not_shut_can_be_reached(plans: dict[str, FloorPlan]) -> None:
    for plan in plans.values():
        raster = plan.rasterize(0.1)
        reached = set(np.unique(raster.room_ids[raster.reachable(0.2)]).tolist())
        for room in plan.rooms:
            open_doors = [door for door in plan.doors if room.id in door.rooms and door.is_open]
            assert (room.id in reached) == bool(open_doors), f"{plan.name}: {room.label} {room.id}"


def test_some_are_furnished_and_some_have_closed_doors(plans: dict[str, FloorPlan]) -> None:
    furnished = [plan for plan in plans.values() if plan.furniture.area > 0.05 * plan.area]
    shut = [
        plan
        for plan in plans.values()
        if any(not door.is_open and 0 not in door.rooms for door in plan.doors)
    ]
    assert len(furnished) >= 6
    assert len(shut) >= 3


def test_a_plan_survives_a_round_trip(plans: dict[str, FloorPlan], tmp_path: Path) -> None:
    plan = plans["curved-01"]
    save_plan(plan, tmp_path / "copy.geojson")
    assert load_plan(tmp_path / "copy.geojson").content_hash == plan.content_hash


def shape_table(plan: FloorPlan) -> NDArray[np.float64]:
    """float64 (rooms, 2): area and squared outline of each room, however the plan is turned or mirrored."""
    return np.array([(room.polygon.area, room.polygon.length**2) for room in plan.rooms])


def is_copy(a: FloorPlan, b: FloorPlan) -> bool:
    """Whether four fifths of the larger plan's rooms have a partner of the same size and outline."""
    first, second = np.log(shape_table(a)), np.log(shape_table(b))
    apart = np.abs(first[:, None] - second[None]).max(axis=2)
    same = (apart < 0.03).astype(float)
    matched = same[linear_sum_assignment(same, maximize=True)].sum()
    return bool(matched >= 0.8 * max(len(first), len(second)))


def turned(plan: FloorPlan) -> FloorPlan:
    """The plan mirrored, turned and moved, with one room gone: what a hash does not see."""

    def change(room: Room) -> Room:
        mirrored = affinity.scale(room.polygon, -1, 1, origin=(0, 0))
        return replace(room, polygon=affinity.translate(affinity.rotate(mirrored, 90, origin=(0, 0)), 3, 5))

    return replace(
        plan,
        name="copy",
        rooms=tuple(change(room) for room in plan.rooms[1:]),
        doors=(),
        walls=Polygon(),
        furniture=Polygon(),
        passages=Polygon(),
    )


def test_copies_are_found() -> None:
    plan = load_plan("office-04")
    assert is_copy(plan, turned(plan)) and plan.content_hash != turned(plan).content_hash


def test_no_test_plan_is_a_copy_of_a_training_plan() -> None:
    table = splits()
    parts = {split: [load_plan(name) for name in table[split]] for split in ("train", "validation", "test")}
    for one, other in itertools.combinations(parts, 2):
        pairs = itertools.product(parts[one], parts[other])
        assert [(a.name, b.name) for a, b in pairs if is_copy(a, b) or a.building == b.building] == []


def test_generated_training_plans_are_none_of_the_shipped() -> None:
    shipped = [load_plan(name) for name in (*splits()["test"], *splits()["validation"])]
    assert max(int(plan.metadata["seed"]) for plan in shipped) < FIRST_SEED
    for plan in shipped[::3]:
        drawn = generate(str(plan.metadata["family"]), FIRST_SEED)
        assert not is_copy(drawn, plan)
