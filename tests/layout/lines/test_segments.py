"""Wall segments found in a grid, and their directions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from layoutexplore.layout.lines.segments import (
    SegmentConfig,
    align,
    angle_between,
    find_segments,
    segment_angles,
)
from tests.layout.lines.cases import seeds


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
