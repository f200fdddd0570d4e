"""The generator's promises for any seed and family: reachable, disjoint, of the asked size, deterministic."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from layoutexplore.errors import ConfigError, UnknownNameError
from layoutexplore.grids.polygons import polygons_of
from layoutexplore.maps.floorplan import Door, FloorPlan
from layoutexplore.maps.generator import FAMILIES, TOPOLOGIES, PlanConfig, generate
from layoutexplore.maps.generator.construction import GRID
from layoutexplore.maps.generator.doors import choose_closed, door_components, wall_runs
from layoutexplore.maps.generator.hall import cubicles
from layoutexplore.maps.generator.wing_frame import Arc, Straight

SLOW = settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
FEW = settings(SLOW, max_examples=10)

families = st.sampled_from(FAMILIES)
seeds = st.integers(0, 2**40)


def areas(low: float = 100.0, high: float = 2500.0) -> st.SearchStrategy[float]:
    """Areas in m2 with as many small as large buildings."""
    return st.floats(math.log(low), math.log(high)).map(math.exp)


def unreached(plan: FloorPlan, radius: float = 0.2) -> list[str]:
    """Labels of the rooms of which no cell can be reached at 0.1 m."""
    raster = plan.rasterize(0.1)
    reached = set(np.unique(raster.room_ids[raster.reachable(radius)]).tolist())
    return [f"{room.label} {room.id}" for room in plan.rooms if room.id not in reached]


@SLOW
@given(
    families,
    seeds,
    areas(),
    st.fixed_dictionaries(
        {},
        optional={
            "clutter": st.floats(0.0, 0.4),
            "door_width": st.floats(0.7, 1.4),
            "interior_wall": st.floats(0.08, 0.3),
            "exterior_wall": st.floats(0.15, 0.6),
        },
    ),
)
def test_every_plan_is_a_sound_building(
    family: str, seed: int, area: float, parameters: dict[str, float]
) -> None:
    plan = generate(family, seed, area=area, **parameters)
    polygons = [room.polygon for room in plan.rooms]
    assert abs(plan.area / area - 1) < 0.25
    assert sum(p.area for p in polygons) - shapely.union_all(polygons).area < 1e-6
    assert all(p.is_valid and not p.interiors for p in polygons)
    assert all(room.label for room in plan.rooms)
    assert unreached(plan) == []
    check_doors(plan, parameters)
    check_millimetres(plan)


def check_doors(plan: FloorPlan, parameters: dict[str, float]) -> None:
    """Every door lies in the wall between the two rooms it names; doors to the outside are closed."""
    rooms = {room.id: room.polygon for room in plan.rooms}
    thickest = max(parameters.get("exterior_wall", 0.4), parameters.get("interior_wall", 0.2))
    for door in plan.doors:
        assert door.width >= 0.7
        assert door.is_open == (0 not in door.rooms)
        middle = shapely.LineString([door.start, door.end]).interpolate(0.5, normalized=True)
        for key in door.rooms:
            if key:
                assert rooms[key].distance(middle) < thickest / 2 + 0.15
        if door.is_open:
            assert plan.walls.intersection(shapely.LineString([door.start, door.end])).length < 0.01


def check_millimetres(plan: FloorPlan) -> None:
    """All coordinates are whole millimetres."""
    shapes = [*(room.polygon for room in plan.rooms), plan.walls, plan.furniture]
    points = shapely.get_coordinates(shapes) / GRID
    assert np.abs(points - np.round(points)).max() < 1e-5


@FEW
@given(families, seeds, areas(high=900.0), st.floats(0.0, 0.3))
def test_the_same_seed_is_the_same_plan(family: str, seed: int, area: float, clutter: float) -> None:
    one = generate(family, seed, area=area, clutter=clutter)
    two = generate(family, seed, PlanConfig(area=area, clutter=clutter))
    assert one.content_hash == two.content_hash
    assert [room.label for room in one.rooms] == [room.label for room in two.rooms]
    assert one.content_hash != generate(family, seed + 1, area=area, clutter=clutter).content_hash


@FEW
@given(families, seeds, areas(high=1200.0), st.floats(0.0, 1.0))
def test_closed_doors_cut_off_single_rooms(family: str, seed: int, area: float, share: float) -> None:
    plan = generate(family, seed, area=area, closed_doors=share)
    shut = np.array([not door.is_open for door in plan.doors])
    sizes = np.bincount(door_components([room.id for room in plan.rooms], plan.doors, shut))
    assert (sizes > 1).sum() <= 1
    inner = [door for door in plan.doors if 0 not in door.rooms]
    closed = sum(not door.is_open for door in inner)
    assert closed <= round(share * len(inner))
    if share <= 0.2:
        assert closed == round(share * len(inner))
    opened = generate(family, seed, area=area)
    assert [d.start for d in opened.doors] == [d.start for d in plan.doors]
    for door in inner:
        if not door.is_open:
            assert plan.walls.buffer(0.03).covers(shapely.LineString([door.start, door.end]))


@FEW
@given(families, seeds, areas(high=900.0), st.floats(0.05, 0.4))
def test_furniture_stands_on_floors_clear_of_doors(
    family: str, seed: int, area: float, clutter: float
) -> None:
    plan = generate(family, seed, area=area, clutter=clutter)
    floor = shapely.union_all([room.polygon for room in plan.rooms]).buffer(0.002)
    assert floor.covers(plan.furniture) or plan.furniture.difference(floor).area < 0.01
    doors = shapely.union_all([plan.opening(door) for door in plan.doors])
    assert plan.furniture.intersection(doors).area < 1e-6
    assert plan.furniture.area <= 0.75 * plan.area


@pytest.mark.parametrize("area", [100.0, 8000.0])
@pytest.mark.parametrize("family", FAMILIES)
def test_smallest_and_largest(family: str, area: float) -> None:
    plan = generate(family, 5, area=area)
    assert abs(plan.area / area - 1) < 0.25
    assert unreached(plan) == []


@pytest.mark.parametrize("topology", TOPOLOGIES)
def test_topologies(topology: str) -> None:
    plan = generate("office", 4, area=900.0 if topology == "I" else 1900.0, topology=topology)
    holes = sum(len(polygon.interiors) for polygon in polygons_of(_outline(plan)))
    assert holes == {"ring": 1, "eight": 2}.get(topology, 0)
    assert unreached(plan) == []


def _outline(plan: FloorPlan) -> shapely.geometry.base.BaseGeometry:
    """The footprint of the building."""
    doors = [plan.opening(door) for door in plan.doors]
    return shapely.union_all([plan.walls, *doors, *(room.polygon for room in plan.rooms)]).buffer(0.01)


@pytest.mark.parametrize("family", FAMILIES)
def test_the_number_of_rooms_is_steered(family: str) -> None:
    few = generate(family, 3, area=1200.0, rooms=30)
    many = generate(family, 3, area=1200.0, rooms=70)
    assert len(few.rooms) < len(many.rooms)
    assert abs(len(many.rooms) / 70 - 1) < 0.4


def test_seeds_vary_in_size_and_character() -> None:
    plans = [generate("office", seed) for seed in range(6)]
    assert len({round(plan.area, -1) for plan in plans}) == 6
    assert len({plan.content_hash for plan in plans}) == 6


def test_rooms_have_the_labels_of_their_kind() -> None:
    def labels(family: str) -> set[str]:
        return {room.label for seed in range(4) for room in generate(family, seed, area=1500.0).rooms}

    assert {"office", "corridor", "meeting", "toilet", "stairs"} <= labels("office")
    assert {"classroom", "corridor", "toilet"} <= labels("school")
    assert {"ward", "bathroom", "corridor"} <= labels("hospital")
    assert {"bedroom", "living", "bathroom", "hallway"} <= labels("apartment")
    assert {"hall", "meeting"} <= labels("hall")


def test_angled_and_curved_are_not_right_angled() -> None:
    for family in ("angled", "curved"):
        plan = generate(family, 2, area=900.0)
        ring = np.vstack([np.diff(shapely.get_coordinates(room.polygon), axis=0) for room in plan.rooms])
        tilt = np.abs((np.degrees(np.arctan2(ring[:, 1], ring[:, 0])) + 45) % 90 - 45)
        assert (tilt > 5).mean() > 0.2


@pytest.mark.parametrize(
    ("family", "seed", "area"),
    [
        ("angled", 127611799, 327.61651988261997),  # holes without width in the union of its spaces
        ("angled", 1862495216, 272.27023176049283),  # two wings, and such a hole
        ("angled", 2038570178, 351.63106539879766),  # a space with several vertices at one corner
        ("curved", 958461074, 882.9392002651409),  # an outline with such a corner
    ],
)
def test_spaces_that_touch_but_for_rounding_are_no_division_by_zero(
    family: str, seed: int, area: float
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        generate(family, seed, area=area)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"area": 50.0}, "area must be a number from 100 to 8000, got 50"),
        ({"area": math.nan}, "area must be a number"),
        ({"area": "large"}, "area must be a number"),
        ({"area": True}, "area must be a number"),
        ({"clutter": 0.9}, "clutter must be a number from 0 to 0.4"),
        ({"closed_doors": -0.1}, "closed_doors must be"),
        ({"door_width": 3.0}, "door_width must be"),
        ({"interior_wall": 0.0}, "interior_wall must be"),
        ({"rooms": 2}, "rooms must be a whole number, 3 or more"),
        ({"rooms": 12.5}, "whole number"),
        ({"area": 200.0, "rooms": 190}, "ask for 6 to 150 m2"),
        ({"topology": "rng"}, "did you mean 'ring'"),
        ({"clutterr": 0.1}, "did you mean 'clutter'"),
        ({"area": 110.0, "topology": "eight"}, "no office of topology eight of 110 m2"),
    ],
)
def test_nonsense_parameters(parameters: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        generate("office", 0, **parameters)


def test_unknown_family_and_bad_seed() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'hospital'"):
        generate("hospitl", 0)
    for seed in (-1, 1.5, True, "3"):
        with pytest.raises(ConfigError, match="seed must be a whole number"):
            generate("office", seed)  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="has no topology"):
        generate("curved", 0, topology="L")


@given(st.floats(-50, 50), st.floats(0, 60), st.floats(-5, 5), st.floats(8, 60), st.booleans())
def test_an_arc_keeps_lengths_along_its_centre_line_and_across(
    heading: float, x: float, y: float, radius: float, left: bool
) -> None:
    arc = Arc(Straight(3.0, -2.0, heading), radius, left)
    centre, off, onward = arc.points(np.array([[x, 0.0], [x, y], [x + 0.01, 0.0]]))
    assert math.isclose(np.hypot(*(off - centre)), abs(y), abs_tol=1e-9)
    assert math.isclose(np.hypot(*(onward - centre)), 0.01, rel_tol=1e-5)
    after = arc.after(x)
    assert np.allclose(after.points(np.array([[0.0, y]]))[0], off, atol=1e-8)


def test_walls_are_cut_at_corners_and_found_across_gaps() -> None:
    room = shapely.box(0, 0, 4, 3)
    runs = wall_runs(room, shapely.Polygon([(4.01, -1), (6, -1), (6, 4), (-1, 4), (-1, 3.01), (4.01, 3.01)]))
    assert [round(float(np.hypot(*(run[-1] - run[0]))), 1) for run in runs] == [4.0, 3.0]
    assert wall_runs(room, shapely.box(4.2, 0, 6, 3)) == []


@given(st.integers(2, 9), st.integers(0, 1000), st.floats(0, 1))
def test_closing_doors_on_random_graphs(rooms: int, seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    pairs = [(int(rng.integers(1, k)), k) for k in range(2, rooms + 1)]
    pairs += [(1, int(k)) for k in rng.integers(2, rooms + 1, 3)]
    doors = [Door(start=(0, 0), end=(1, 0), rooms=pair) for pair in pairs]
    shut = np.zeros(len(doors), np.bool_)
    shut[choose_closed(range(1, rooms + 1), doors, share, rng)] = True
    sizes = np.bincount(door_components(range(1, rooms + 1), doors, shut))
    assert (sizes > 1).sum() <= 1


@given(st.floats(8, 60), st.floats(8, 40), st.integers(0, 10**6))
def test_cubicles_leave_the_border_free(width: float, depth: float, seed: int) -> None:
    walls = cubicles(shapely.box(0, 0, width, depth), np.random.default_rng(seed))
    inner = shapely.box(1.2, 1.2, width - 1.2, depth - 1.2)
    assert all(inner.covers(wall) for wall in walls)
