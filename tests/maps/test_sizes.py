"""How near edges are to each other: kernels against shapely."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from shapely import LineString, MultiLineString, Point, box

from layoutexplore.errors import MapError
from layoutexplore.files.limits import VARIABLE
from layoutexplore.maps.floorplan import FloorPlan, Room
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.maps.shared_walls import distances_to_edges
from layoutexplore.maps.sizes import check_crowding, near_pairs, squared_distance
from layoutexplore.priors.plan import PriorPlan

PLACES = st.tuples(*[st.integers(-20, 20)] * 2)


@settings(deadline=None)  # kernels compile
@given(place=PLACES, points=st.lists(PLACES, min_size=2, max_size=8))
def test_distances_are_those_of_shapely(place: tuple[int, int], points: list[tuple[int, int]]) -> None:
    corners, (x, y) = np.array(points, float), map(float, place)
    expected = [Point(place).distance(LineString(pair)) for pair in itertools.pairwise(points)]
    np.testing.assert_allclose(distances_to_edges(corners, x, y), expected, atol=1e-9)
    np.testing.assert_allclose(squared_distance(x, y, corners[0], corners[1]), expected[0] ** 2, atol=1e-9)


def slow_near_pairs(edges: NDArray[np.float64], order: NDArray[np.int64], reach: float) -> int:
    """Pairs of edges, not neighbours in the file, of which an end of one is near the other."""
    lines = [LineString(edge.reshape(2, 2)) for edge in edges]
    ends = [[Point(edge[:2]), Point(edge[2:])] for edge in edges]
    count = 0
    for i, j in itertools.combinations(range(len(edges)), 2):
        away = [*(end.distance(lines[j]) for end in ends[i]), *(end.distance(lines[i]) for end in ends[j])]
        count += abs(int(order[i] - order[j])) != 1 and min(away) <= reach
    return count


@settings(deadline=None)
@given(
    edges=st.lists(st.tuples(PLACES, PLACES), min_size=2, max_size=12),
    # no distance between whole numbers is as close to these as rounding goes
    reach=st.sampled_from([0.3, 1.7, 6.1]),
)
def test_near_edges_are_counted(edges: list[tuple[tuple[int, int], tuple[int, int]]], reach: float) -> None:
    every = np.array(edges, float).reshape(-1, 4)
    order = np.argsort(np.minimum(every[:, 0], every[:, 2]), kind="stable")
    every = np.ascontiguousarray(every[order])
    expected = slow_near_pairs(every, order, reach)
    assert near_pairs(every, order, reach, 1000, 1000) == expected
    assert near_pairs(every, order, reach, max(expected - 1, 0), 1000) == expected
    if expected > 1:
        assert near_pairs(every, order, reach, 0, 1000) >= 1, "more than were allowed"


def test_lines_closer_than_walls_are_thick_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LAYOUTEXPLORE_LIMITS", "crossings=100")
    comb = [[(0.01 * k, 0.0), (0.01 * k, 9.0)] for k in range(100)]
    with pytest.raises(MapError, match=r"pairs of edges lie within 0\.2 m"):
        check_crowding("comb.json", [MultiLineString(comb)], 0.2)
    check_crowding("comb.json", [MultiLineString(comb)], 0.011)
    check_crowding("hall.json", [Point(0, 0).buffer(20, quad_segs=2000)], 0.2)


@pytest.mark.parametrize("number", [100_001, 2**31 - 1])
def test_rooms_of_enormous_numbers_are_refused(number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    ids = np.full((4, 4), number, np.int32)
    makers = (
        lambda: FloorPlan(name="plan", rooms=(Room(id=number, polygon=box(0, 0, 4, 3)),)),
        lambda: PlanRaster(np.eye(4, dtype=bool), ids, 0.1),
        lambda: PlanRaster(np.eye(4, dtype=bool), -ids, 0.1),
        lambda: PriorPlan(name="plan", free=ids > 0, room_ids=ids, resolution=0.1),
    )
    for make in makers:
        with pytest.raises(
            MapError, match=f"id {number}, and the limit room_ids is 100000: number the rooms"
        ):
            make()
    monkeypatch.setenv(VARIABLE, "room_ids=3e9")
    for make in makers[:1]:
        make()
