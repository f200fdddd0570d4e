"""Arrangements of lines: their faces, and how much of a line walls cover."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings

from layoutexplore.layout.lines.faces import arrange, clip_lines, cover_lines
from layoutexplore.layout.lines.segments import AlignedSegments
from tests.layout.lines.cases import BOX, DIRECTIONS, arrangement_of, lines, random_segments, seeds


@given(lines)
@example([(0, 0.99999)])
@example([(0, 0.99999), (1, 0.0)])
@example([(0, 5.625), (1, 0.0), (1, 7.439364490862162e-07)])
@settings(max_examples=60, deadline=None)
def test_arrangement_covers_the_box_with_convex_faces(drawn):
    arrangement = arrangement_of(drawn)
    assert arrangement.area.sum() == pytest.approx((BOX[2] - BOX[0]) * (BOX[3] - BOX[1]), rel=1e-6)
    assert len(arrangement.vertices) - len(arrangement.edges) + len(arrangement) == 1
    corners, offsets = arrangement.rings
    polygons = [shapely.Polygon(corners[a:b]) for a, b in itertools.pairwise(offsets)]
    for polygon, area in zip(polygons, arrangement.area, strict=True):
        assert polygon.area == pytest.approx(area, rel=1e-6, abs=1e-9)
        assert polygon.convex_hull.area == pytest.approx(polygon.area, rel=1e-6, abs=1e-9)


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
