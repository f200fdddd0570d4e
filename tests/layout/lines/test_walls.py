"""Segments that become walls and lines, against slow, obvious versions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.grids.components import components
from layoutexplore.layout.lines.segments import AlignedSegments
from layoutexplore.layout.lines.walls import chain_lines, find_walls, grouped_median, merge_walls
from tests.layout.lines.cases import DIRECTIONS


@st.composite
def segment_sets(draw: st.DrawFn) -> AlignedSegments:
    n = draw(st.integers(1, 25))
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    start = rng.integers(0, 40, n) / 4
    return AlignedSegments(
        directions=np.array([0.0, 1.0]),
        direction=rng.integers(0, 2, n),
        offset=rng.integers(0, 12, n) / 4,
        start=start,
        end=start + rng.integers(1, 12, n) / 4,
    )


@settings(max_examples=60, deadline=None)
@given(segment_sets(), st.sampled_from([0.25, 0.6, 1.0]))
def test_walls_are_chains_of_near_segments(segments: AlignedSegments, gap: float) -> None:
    n = len(segments)
    apart = np.maximum(segments.start[:, None], segments.start) - np.minimum(
        segments.end[:, None], segments.end
    )
    aside = segments.offset[:, None] - segments.offset
    near = np.maximum(apart, 0) ** 2 + aside**2 <= gap**2
    near &= segments.direction[:, None] == segments.direction
    walls = find_walls(segments, gap)
    assert walls.group.tolist() == components(*np.nonzero(near), n).tolist()
    for k in range(len(walls)):
        inside = walls.group == k
        assert walls.start[k] == segments.start[inside].min() and walls.end[k] == segments.end[inside].max()
        assert walls.length[k] == pytest.approx(segments.length[inside].sum())
        assert {int(d) for d in segments.direction[inside]} == {int(walls.direction[k])}


@settings(max_examples=60, deadline=None)
@given(segment_sets(), st.sampled_from([0.3, 0.6, 1.3]))
def test_the_heaviest_wall_takes_in_those_around_it(segments: AlignedSegments, distance: float) -> None:
    walls = find_walls(segments, 0.1)
    leader: dict[int, int] = {}
    for wall in sorted(range(len(walls)), key=lambda w: (-round(float(walls.length[w]), 9), w)):
        if wall not in leader:
            for other in range(len(walls)):
                same = walls.direction[other] == walls.direction[wall]
                if same and other not in leader and abs(walls.offset[other] - walls.offset[wall]) < distance:
                    leader[other] = wall
    rank = {w: k for k, w in enumerate(sorted(set(leader.values())))}
    assert merge_walls(segments, walls, distance).group.tolist() == [
        rank[leader[w]] for w in walls.group.tolist()
    ]


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 20), st.integers(0, 10**6))
def test_half_of_the_weight_lies_at_or_below_the_median(n: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    values, weights = rng.integers(0, 9, n).astype(float), rng.integers(1, 5, n).astype(float)
    group = np.concatenate(([0, 1, 2], rng.integers(0, 3, n)))[:n]
    count = int(group.max()) + 1
    for k, median in enumerate(grouped_median(values, weights, group, count).tolist()):
        inside = group == k
        below = [weights[inside & (values <= v)].sum() for v in sorted(values[inside])]
        first = next(i for i, b in enumerate(below) if b >= weights[inside].sum() / 2)
        assert median == sorted(values[inside])[first]


def test_chained_lines_are_single_linkage():
    segments = AlignedSegments(
        directions=DIRECTIONS,
        direction=np.array([0, 0, 0, 0, 2]),
        offset=np.array([1.0, 1.4, 1.8, 2.6, 1.0]),
        start=np.zeros(5),
        end=np.ones(5),
    )
    assert chain_lines(segments, 0.5).group.tolist() == [0, 0, 0, 1, 2]
