"""Polygon fill, walls that cannot leak, resampling and tracing, against slow obvious versions."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
import shapely
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from shapely import LineString, Polygon

from layoutexplore.grids.morphology import inflate
from layoutexplore.grids.outlines import trace_mask
from layoutexplore.grids.polygons import Nearness, fill, polygons_of, resample_solid, seal_diagonals

settings.register_profile("kernels", deadline=None)
settings.load_profile("kernels")

COORDINATE = st.floats(-0.5, 4.5, allow_nan=False, width=32)
MASK = arrays(np.bool_, st.tuples(st.integers(1, 12), st.integers(1, 12)))


def filled(
    geometry: shapely.Geometry, shape: tuple[int, int], resolution: float, *, sealed: bool = False
) -> NDArray[np.bool_]:
    target = np.zeros(shape, np.int32)
    fill(target, geometry, 1, resolution, (0.0, 0.0), sealed=sealed)
    return target != 0


def centres(shape: tuple[int, int], resolution: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    rows, cols = np.indices(shape)
    return (cols + 0.5) * resolution, (rows + 0.5) * resolution


@settings(max_examples=150)
@given(
    st.lists(st.tuples(COORDINATE, COORDINATE), min_size=3, max_size=9),
    st.sampled_from([0.1, 0.23, 0.5]),
    st.booleans(),
)
def test_fill_is_every_centre_inside(
    points: list[tuple[float, float]], resolution: float, hole: bool
) -> None:
    polygon = Polygon(points).buffer(0)
    if hole:
        polygon = polygon.difference(shapely.box(1.01, 1.03, 2.02, 2.51))
    shape = (math.ceil(4 / resolution), math.ceil(4.2 / resolution))
    x, y = centres(shape, resolution)
    near_edge = (
        shapely.distance(polygon.boundary, shapely.points(x, y)) < 1e-5
        if not polygon.is_empty
        else np.zeros(shape, bool)
    )
    agree = filled(polygon, shape, resolution) == shapely.contains_xy(polygon, x, y)
    assert (agree | near_edge).all()


def test_fill_writes_the_value_and_leaves_the_rest() -> None:
    target = np.full((4, 4), 9, np.int32)
    fill(target, shapely.MultiPolygon([shapely.box(0, 0, 1, 1), shapely.box(3, 3, 9, 9)]), 5, 1.0, (0.0, 0.0))
    assert np.argwhere(target == 5).tolist() == [[0, 0], [3, 3]]
    assert (target[target != 5] == 9).all()


def test_fill_knows_its_origin() -> None:
    target = np.zeros((3, 3), np.int32)
    fill(target, shapely.box(10.0, -5.0, 10.5, -4.5), 1, 0.5, (9.5, -5.5))
    assert np.argwhere(target).tolist() == [[1, 1]]


@settings(max_examples=150)
@given(
    st.tuples(COORDINATE, COORDINATE, COORDINATE, COORDINATE),
    st.floats(0.004, 0.3),
    st.sampled_from([0.1, 0.2, 0.37]),
)
@example((1.0, 0.0, 0.0, 1.0), 0.25, 0.1)  # a corner's edge runs through a centre
def test_no_step_crosses_a_sealed_wall(
    ends: tuple[float, float, float, float], thickness: float, resolution: float
) -> None:
    """Neither between neighbouring centres, nor through 8-connected free cells with sealed diagonals."""
    x0, y0, x1, y1 = ends
    assume(math.hypot(x1 - x0, y1 - y0) > 0.5)
    wall = LineString([(x0, y0), (x1, y1)]).buffer(thickness / 2, cap_style="flat")
    shape = (math.ceil(4 / resolution), math.ceil(4 / resolution))
    solid = filled(wall, shape, resolution, sealed=True)
    core = wall.buffer(-1e-5)
    assume(not core.is_empty)
    x, y = centres(shape, resolution)
    for here, there in ((np.s_[:-1, :], np.s_[1:, :]), (np.s_[:, :-1], np.s_[:, 1:])):
        free = ~solid[here] & ~solid[there]
        steps = shapely.linestrings(
            np.stack([np.stack([x[here], y[here]], -1), np.stack([x[there], y[there]], -1)], -2)
        )
        assert not shapely.intersects(steps[free], core).any()
    sealed = seal_diagonals(solid)
    assert (sealed | ~solid).all()
    assert (
        cv2.connectedComponents((~sealed).astype(np.uint8), connectivity=4)[0]
        == (cv2.connectedComponents((~sealed).astype(np.uint8), connectivity=8)[0])
    )


def test_a_wall_thinner_than_a_cell_is_one_cell() -> None:
    wall = shapely.box(0.0, 1.02, 3.0, 1.04)
    solid = filled(wall, (20, 30), 0.1, sealed=True)
    assert np.flatnonzero(solid.any(axis=1)).tolist() == [10]
    assert solid[10].all()
    assert not filled(wall, (20, 30), 0.1).any()


def test_a_wall_as_thick_as_a_cell_is_one_cell_wherever_it_lies() -> None:
    for low in np.linspace(1.0, 1.1, 23):
        assert (
            filled(shapely.box(0.0, low, 3.0, low + 0.1), (20, 30), 0.1, sealed=True).any(axis=1).sum() == 1
        )


@settings(max_examples=60)
@given(
    st.floats(0.0, math.pi), st.floats(-0.1, 0.1), st.floats(0.01, 0.3), st.sampled_from([0.05, 0.1, 0.15])
)
def test_a_robot_passes_a_narrow_door_at_any_angle(
    angle: float, offset: float, thickness: float, resolution: float
) -> None:
    """0.7 m are enough for a robot of radius 0.2 m, and the wall around the door is closed."""
    along, across = (
        np.array([math.cos(angle), math.sin(angle)]),
        np.array([-math.sin(angle), math.cos(angle)]),
    )
    middle = np.array([2.0 + offset, 2.0])
    jambs = [LineString([middle + s * 0.35 * along, middle + s * 4.0 * along]) for s in (-1, 1)]
    side = round(4.0 / resolution)
    for door, connected in ((jambs, True), ([LineString([middle - 4 * along, middle + 4 * along])], False)):
        wall = shapely.union_all([line.buffer(thickness / 2, cap_style="flat") for line in door])
        solid = seal_diagonals(filled(wall, (side, side), resolution, sealed=True))
        _, parts = cv2.connectedComponents(
            (~inflate(solid, 0.2, resolution)).astype(np.uint8), connectivity=4
        )
        one, two = (
            parts[tuple(np.floor((middle + s * 1.2 * across)[::-1] / resolution).astype(int))]
            for s in (-1, 1)
        )
        assert one > 0
        assert bool(one == two) is connected


@given(MASK)
def test_sealed_masks_have_no_checkerboard(mask: NDArray[np.bool_]) -> None:
    sealed = seal_diagonals(mask)
    assert (sealed | ~mask).all()
    a, b, c, d = sealed[:-1, :-1], sealed[:-1, 1:], sealed[1:, :-1], sealed[1:, 1:]
    assert not ((a == d) & (b == c) & (a != b)).any()


@given(MASK, st.sampled_from([0.05, 0.1, 0.7]))
def test_trace_is_the_outline_of_the_cells(mask: NDArray[np.bool_], resolution: float) -> None:
    outline = trace_mask(mask, resolution, (-1.0, 2.0))
    assert outline.is_valid
    assert len(polygons_of(outline)) == cv2.connectedComponents(mask.astype(np.uint8), connectivity=4)[0] - 1
    assert outline.area == pytest.approx(mask.sum() * resolution**2, rel=1e-4)
    target = np.zeros(mask.shape, np.int32)
    fill(target, outline, 1, resolution, (-1.0, 2.0))
    assert np.array_equal(target != 0, mask)


def test_a_part_with_holes_among_many_keeps_them() -> None:
    mask = np.zeros((9, 60), bool)
    mask[1:8, 1:8] = True
    mask[[2, 3, 5], [2, 3, 5]] = False  # two that touch at a corner, and one
    mask[::2, 10::2] = True
    outline = trace_mask(mask, 0.1, (0.0, 0.0))
    holes = [len(part.interiors) for part in polygons_of(outline)]
    assert outline.is_valid and sorted(holes) == [0] * 125 + [3]
    assert outline.area == pytest.approx(0.01 * np.count_nonzero(mask))
    assert all(shapely.get_exterior_ring(part).is_ccw for part in polygons_of(outline))
    assert trace_mask(mask & False, 0.1, (0.0, 0.0)).is_empty


@given(MASK)
def test_resampling_at_the_same_resolution_changes_nothing(mask: NDArray[np.bool_]) -> None:
    assert np.array_equal(resample_solid(mask, (1.0, 1.0), (0.0, 0.0), mask.shape), mask)


@settings(max_examples=60)
@given(
    arrays(np.bool_, (24, 24), elements=st.sampled_from([False, False, False, True])),
    st.sampled_from([2.0, 3.0, 2.5, 0.5]),
)
def test_resampling_is_filling_the_outline(mask: NDArray[np.bool_], ratio: float) -> None:
    """The coarse cells are those that the traced outline fills, run by run."""
    side = int(24 / ratio)
    resampled = resample_solid(mask, (ratio, ratio), (0.0, 0.0), (side, side))
    x, y = centres((side, side), ratio)
    rows, cols = np.minimum(np.floor(y), 23).astype(int), np.minimum(np.floor(x), 23).astype(int)
    assert (resampled | ~mask[rows, cols]).all()
    for along, lines in ((0, mask[rows[:, 0]]), (1, mask[:, cols[0]].T)):
        for k, line in enumerate(lines):  # between two free neighbours, no solid source cell lies on the way
            cells = resampled[k] if along == 0 else resampled[:, k]
            for j in range(side - 1):
                start, end = (int(np.floor((j + step) * ratio)) for step in (0.5, 1.5))
                if not cells[j] and not cells[j + 1]:
                    assert not line[start : end + 1].any()


def test_resampled_outside_is_solid() -> None:
    mask = np.zeros((4, 4), np.bool_)
    resampled = resample_solid(mask, (1.0, 1.0), (-2.0, -1.0), (6, 8))
    assert (~resampled).sum() == 16
    assert not resampled[1:5, 2:6].any()


def test_polygons_of_takes_only_polygons() -> None:
    box = shapely.box(0, 0, 1, 1)
    mixed = shapely.GeometryCollection(
        [box, LineString([(0, 0), (1, 1)]), shapely.MultiPolygon([shapely.box(2, 2, 3, 3)])]
    )
    assert len(polygons_of(mixed)) == 2
    assert polygons_of(Polygon()) == []
    assert polygons_of(LineString([(0, 0), (1, 1)])) == []


COORDINATES = st.floats(-20, 20).map(lambda value: round(value, 3))


@given(
    st.lists(st.tuples(COORDINATES, COORDINATES), min_size=3, max_size=12),
    st.lists(st.tuples(COORDINATES, COORDINATES), min_size=1, max_size=8),
)
def test_nearness_is_the_distance_that_shapely_measures(
    corners: list[tuple[float, float]], places: list[tuple[float, float]]
) -> None:
    outline = shapely.MultiPoint(corners).convex_hull
    assume(isinstance(outline, Polygon))
    room = outline.difference(shapely.box(-1, -1, 1, 1))
    assume(isinstance(room, Polygon))
    points = shapely.points(places)
    for shape in (room, room.exterior):
        expected = shapely.distance(shape, points)
        np.testing.assert_allclose(Nearness(shape).distances(points), expected, atol=1e-9)


def test_corners_hardly_apart_are_no_fault_of_numbers() -> None:
    room = shapely.Polygon([(4, 1e-300), (4, 3), (0, 3), (0, 0), (4, 0)])
    with np.errstate(divide="raise", invalid="raise"):
        away = Nearness(room).distances(shapely.points([(4.1, 1.0), (4.1, 0.0), (1.0, 1.0)]))
    np.testing.assert_allclose(away, [0.1, 0.1, 0.0], atol=1e-12)
