"""Line arrangements, coverage, walls and face clusters against slow, obvious versions."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from sklearn.cluster import DBSCAN

from layoutexplore.grids.components import components
from layoutexplore.layout.lines.face_clusters import (
    FaceGraph,
    cluster_faces,
    dissolve,
    face_graph,
    merge_small,
    renumber,
)
from layoutexplore.layout.lines.face_outlines import outline, paint_faces
from layoutexplore.layout.lines.faces import arrange, clip_lines, cover_lines
from layoutexplore.layout.lines.segments import (
    AlignedSegments,
    SegmentConfig,
    align,
    angle_between,
    find_segments,
    segment_angles,
)
from layoutexplore.layout.lines.walls import chain_lines, find_walls, grouped_median, merge_walls

BOX = (0.5, 1.0, 9.5, 7.0)
DIRECTIONS = np.array([0.0, 0.7, np.pi / 2, 2.9])

lines = st.lists(st.tuples(st.integers(0, 3), st.floats(-8, 8, allow_nan=False)), max_size=12)
seeds = st.integers(0, 2**32 - 1)


def arrangement_of(drawn):
    direction = np.array([d for d, _ in drawn], np.int64)
    offset = np.array([t for _, t in drawn], np.float64)
    return arrange(clip_lines(DIRECTIONS[direction], offset, BOX))


def random_segments(seed, n=40):
    rng = np.random.default_rng(seed)
    start = rng.uniform(0, 8, n)
    return AlignedSegments(
        directions=DIRECTIONS,
        direction=rng.integers(0, 3, n),
        offset=rng.uniform(0, 3, n).round(2),
        start=start,
        end=start + rng.uniform(0.1, 2, n),
    )


@given(lines)
@example([(0, 0.99999)])
@example([(0, 0.99999), (1, 0.0)])
@example([(0, 5.625), (1, 0.0), (1, 7.439364490862162e-07)])
@settings(max_examples=60, deadline=None)
def test_arrangement_covers_the_box_with_convex_faces(drawn):
    arrangement = arrangement_of(drawn)
    assert arrangement.area.sum() == pytest.approx((BOX[2] - BOX[0]) * (BOX[3] - BOX[1]), rel=1e-6)
    assert len(arrangement.vertices) - len(arrangement.edges) + len(arrangement) == 1
    corners, offsets = arrangement.rings()
    polygons = [shapely.Polygon(corners[a:b]) for a, b in itertools.pairwise(offsets)]
    for polygon, area in zip(polygons, arrangement.area, strict=True):
        assert polygon.area == pytest.approx(area, rel=1e-6, abs=1e-9)
        assert polygon.convex_hull.area == pytest.approx(polygon.area, rel=1e-6, abs=1e-9)


@given(lines)
@settings(max_examples=40, deadline=None)
def test_every_cell_centre_is_painted_with_the_face_that_holds_it(drawn):
    arrangement = arrangement_of(drawn)
    image = paint_faces(arrangement, (33, 41), 0.25)
    corners, offsets = arrangement.rings()
    polygons = np.array([shapely.Polygon(corners[a:b]) for a, b in itertools.pairwise(offsets)])
    rows, cols = np.mgrid[:33, :41]
    centres = shapely.points((cols.ravel() + 0.5) * 0.25, (rows.ravel() + 0.5) * 0.25)
    painted = image.ravel()
    inside = painted >= 0
    assert (shapely.distance(polygons[painted[inside]], centres[inside]) < 1e-4).all()
    box = shapely.box(*BOX)
    assert (shapely.distance(box.exterior, centres[~inside & shapely.contains(box, centres)]) < 1e-4).all()


@given(lines, seeds)
@settings(max_examples=40, deadline=None)
def test_outlines_are_the_union_of_their_faces(drawn, seed):
    arrangement = arrangement_of(drawn)
    rng = np.random.default_rng(seed)
    group, count = dissolve(arrangement, rng.random(len(arrangement.line)) < 0.4)
    corners, offsets = arrangement.rings()
    faces = np.array([shapely.Polygon(corners[a:b]) for a, b in itertools.pairwise(offsets)])
    for index, polygon in enumerate(outline(arrangement, group, count)):
        union = shapely.union_all(faces[group == index])
        assert polygon.is_valid
        assert polygon.symmetric_difference(union).area < 1e-3


@given(lines, seeds)
@settings(max_examples=30, deadline=None)
def test_face_graph_measures_common_boundaries(drawn, seed):
    arrangement = arrangement_of(drawn)
    rng = np.random.default_rng(seed)
    group, count = dissolve(arrangement, rng.random(len(arrangement.line)) < 0.3)
    covered = rng.random(len(arrangement.line)) * arrangement.edge_length
    graph = face_graph(arrangement, covered, group, count)
    expected = {}
    for (a, b), length, cover in zip(arrangement.sides, arrangement.edge_length, covered, strict=True):
        if a >= 0 and b >= 0 and group[a] != group[b]:
            pair = tuple(sorted((int(group[a]), int(group[b]))))
            total = expected.setdefault(pair, [0.0, 0.0])
            total[0] += length
            total[1] += cover
    found = zip(graph.first.tolist(), graph.second.tolist(), strict=True)
    assert {p: (pytest.approx(v[0]), pytest.approx(v[1])) for p, v in expected.items()} == {
        p: (a, b) for p, a, b in zip(found, graph.length, graph.covered, strict=True)
    }


def test_concurrent_lines_share_one_vertex():
    square = arrange(
        clip_lines(np.array([0.0, np.pi / 2, np.pi / 4]), np.array([4.0, -5.0, -np.sqrt(0.5)]), BOX)
    )
    assert len(square) == 6


@given(seeds)
@settings(max_examples=40, deadline=None)
def test_coverage_is_the_union_of_the_projections(seed):
    segments = random_segments(seed)
    rng = np.random.default_rng(seed)
    line = rng.integers(0, 5, len(segments))
    coverage = cover_lines(segments, line, 100.0)
    start = rng.uniform(-1, 9, 30)
    end, which = start + rng.uniform(0, 4, 30), rng.integers(0, 5, 30)
    for k, a, b, found in zip(which, start, end, coverage.between(which, start, end), strict=True):
        union = shapely.union_all(
            [
                shapely.LineString([(s, 0), (e, 0)])
                for s, e in zip(segments.start[line == k], segments.end[line == k], strict=True)
            ]
        )
        assert found == pytest.approx(
            union.intersection(shapely.LineString([(a, 0), (b, 0)])).length, abs=1e-9
        )


def test_nothing_covers_an_empty_set_of_lines():
    none = AlignedSegments(
        directions=DIRECTIONS,
        direction=np.zeros(0, np.int64),
        offset=np.zeros(0),
        start=np.zeros(0),
        end=np.zeros(0),
    )
    assert cover_lines(none, np.zeros(0, np.int64), 10.0).between(
        np.array([0]), np.array([0.0]), np.array([1.0])
    ) == [0.0]


@given(seeds, st.floats(0.05, 1.0))
@settings(max_examples=30, deadline=None)
def test_walls_are_the_connected_segments(seed, gap):
    segments = random_segments(seed)
    n = len(segments)
    near = np.zeros((n, n), bool)
    for i, j in itertools.combinations(range(n), 2):
        along = max(segments.start[i], segments.start[j]) - min(segments.end[i], segments.end[j])
        apart = np.hypot(max(along, 0), segments.offset[i] - segments.offset[j])
        near[i, j] = near[j, i] = segments.direction[i] == segments.direction[j] and apart <= gap
    distance = np.where(near | np.eye(n, dtype=bool), 0.0, 1.0)
    expected = DBSCAN(eps=0.5, min_samples=1, metric="precomputed").fit_predict(distance)
    assert np.array_equal(find_walls(segments, gap).group, renumber(expected))


@given(seeds, st.floats(0.05, 1.0))
@settings(max_examples=30, deadline=None)
def test_merged_walls_stay_near_the_heaviest(seed, distance):
    segments = random_segments(seed)
    walls = find_walls(segments, 0.2)
    merged = merge_walls(segments, walls, distance)
    for group in range(len(merged)):
        members = np.unique(walls.group[merged.group == group])
        heaviest = members[np.argmax(walls.length[members].round(9))]
        assert (walls.direction[members] == walls.direction[heaviest]).all()
        assert (np.abs(walls.offset[members] - walls.offset[heaviest]) <= distance + 1e-9).all()


def test_chained_lines_are_single_linkage():
    segments = AlignedSegments(
        directions=DIRECTIONS,
        direction=np.array([0, 0, 0, 0, 2]),
        offset=np.array([1.0, 1.4, 1.8, 2.6, 1.0]),
        start=np.zeros(5),
        end=np.ones(5),
    )
    assert chain_lines(segments, 0.5).group.tolist() == [0, 0, 0, 1, 2]


@given(seeds)
@settings(max_examples=40, deadline=None)
def test_grouped_median_splits_the_weight_in_half(seed):
    rng = np.random.default_rng(seed)
    group = np.concatenate((np.arange(4), rng.integers(0, 4, 20)))
    values, weights = rng.integers(0, 9, 24).astype(float), rng.integers(1, 5, 24).astype(float)
    for index, median in enumerate(grouped_median(values, weights, group, 4)):
        spread = np.sort(np.repeat(values[group == index], weights[group == index].astype(int)))
        assert median == spread[(len(spread) - 1) // 2]


@given(seeds)
@settings(max_examples=40, deadline=None)
def test_face_clusters_are_those_of_dbscan(seed):
    rng = np.random.default_rng(seed)
    n = 12
    pairs = np.array([p for p in itertools.combinations(range(n), 2) if rng.random() < 0.3]).reshape(-1, 2)
    length = rng.uniform(0.5, 2, len(pairs))
    graph = FaceGraph(
        first=pairs[:, 0], second=pairs[:, 1], length=length, covered=length * rng.random(len(pairs)) * 0.4
    )
    inside = rng.random(n) < 0.8
    affinity = np.eye(n)
    for (a, b), weight in zip(pairs, graph.weight, strict=True):
        affinity[a, b] = affinity[b, a] = np.exp(-weight / 0.125)
    kept = affinity[np.ix_(inside, inside)]
    kept = kept / kept.sum(axis=1, keepdims=True)
    room = cluster_faces(graph, inside, 0.125, 0.15)
    assert (room[~inside] == -1).all()
    if inside.any():
        distance = np.maximum(1 - (kept + kept.T) / 2, 0)
        expected = DBSCAN(eps=0.85, min_samples=1, metric="precomputed").fit_predict(distance)
        assert np.array_equal(room[inside], renumber(expected))


def test_small_rooms_join_the_most_open_neighbour():
    graph = FaceGraph(
        first=np.array([0, 1, 1]),
        second=np.array([1, 2, 3]),
        length=np.array([2.0, 2.0, 2.0]),
        covered=np.array([1.5, 0.5, 2.0]),
    )
    room = merge_small(np.array([0, 1, 2, 3]), graph, np.array([9.0, 1.0, 9.0, 1.0]), 2.0)
    assert room.tolist() == [0, 1, 1, -1]


def test_components_are_numbered_by_their_first_member():
    assert components(np.array([3, 1]), np.array([0, 2]), 5).tolist() == [0, 1, 1, 0, 2]
    assert renumber(np.array([7, -1, 3, 7])).tolist() == [0, -1, 1, 0]


def test_segments_follow_a_wall_in_metres():
    for resolution in (0.05, 0.1):
        mask = np.zeros((round(4 / resolution), round(6 / resolution)), bool)
        mask[round(2 / resolution), round(1 / resolution) : round(5 / resolution)] = True
        segments = find_segments(mask, resolution, SegmentConfig())
        assert len(segments) >= 1
        assert segments[:, [0, 2]].min() == pytest.approx(1.0, abs=2 * resolution)
        assert segments[:, [0, 2]].max() == pytest.approx(5.0, abs=2 * resolution)
        assert np.allclose(segments[:, [1, 3]], 2 + resolution / 2)
    assert find_segments(np.zeros((40, 40), bool), 0.05, SegmentConfig()).shape == (0, 4)


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_two_searches_find_the_same_in_the_mirror(seed):
    rng = np.random.default_rng(seed)
    mask = rng.random((60, 80)) < 0.02
    mask[rng.integers(0, 60, 4)] = mask[:, rng.integers(0, 80, 4)] = True
    mask[[0, -1]] = (
        True  # the origin of a search is the first row, and nothing is searched behind the last occupied one
    )
    config = SegmentConfig(votes=0.5)
    segments, mirrored = find_segments(mask, 0.1, config), find_segments(mask[::-1], 0.1, config)
    mirrored[:, 1::2] = 6.0 - mirrored[:, 1::2]
    assert np.sort(segments.round(6), axis=0).tolist() == np.sort(mirrored.round(6), axis=0).tolist()
    once = find_segments(mask, 0.1, SegmentConfig(votes=0.5, twice=False))
    assert len(once) < len(segments)
    assert segments[: len(once)].tolist() == once.tolist()


def test_align_projects_on_the_nearest_direction():
    segments = np.array([[0.0, 0.0, 2.0, 0.2], [1.0, 0.0, 1.0, 3.0], [0.0, 0.0, 1.0, 1.0]])
    aligned, kept = align(segments, np.array([0.0, np.pi / 2]), np.radians(20))
    assert kept.tolist() == [0, 1]
    assert aligned.direction.tolist() == [0, 1]
    assert aligned.offset == pytest.approx([0.1, -1.0])
    assert np.stack((aligned.start, aligned.end)) == pytest.approx(np.array([[0.0, 0.0], [2.0, 3.0]]))


def test_angles_are_undirected():
    reverse = np.array([[1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 1.0], [1.0, 0.0, 0.0, 0.0]])
    assert segment_angles(reverse) == pytest.approx([np.pi / 4, np.pi / 4, 0.0])
    assert angle_between(np.array([0.05, 1.0]), np.array([np.pi - 0.05, 1.0])) == pytest.approx([0.1, 0.0])
