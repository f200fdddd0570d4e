"""Regions that merge over long common borders."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from layoutexplore.layout.survey.border_merging import RULES, Borders, merge_by_borders, merge_target


def test_borders_count_distinct_cells_and_merge() -> None:
    labels = np.array([[1, 1, 2], [1, 1, 2], [0, 0, 3]], np.int32)
    borders = Borders(labels)
    assert borders.shares[1][2] == 2 and borders.shares[1][3] == 1
    assert borders.shares[2][1] == 2
    assert borders.around(1) == {1, 2, 3}
    borders.merge(3, 2)
    assert borders.area == [2, 4, 3, 0]
    assert borders.perimeter == [0, *(sum(borders.shares[k].values()) for k in (1, 2, 3))]
    assert 3 not in borders.shares[1] and borders.shares[1][2] == 3


def slow_merging(labels: np.ndarray, resolution: float, merge_area: float) -> np.ndarray:
    """Every merge starts again from the smallest region, with the rule that it was made by."""
    borders = Borders(labels)
    merged = labels.copy()
    for rule in RULES:
        target = -1
        while target != 0:
            alive = sorted((area, k) for k, area in enumerate(borders.area) if k > 0 and area > 0)
            targets = (
                (region, merge_target(borders, region, rule, area * resolution**2, merge_area))
                for area, region in alive
            )
            region, target = next((pair for pair in targets if pair[1] > 0), (0, 0))
            if target > 0:
                borders.merge(region, target)
                merged[merged == region] = target
    return merged


def test_a_rule_is_through_before_the_next_one_begins() -> None:
    rows = ["1122222224444444", *["11#2222224444444"] * 5, "3##2222224444444", "33#2222224444444"]
    labels = np.array([[int(cell) for cell in row.replace("#", "0")] for row in rows], np.int32)
    # (a) puts 3 to 1 and (d) 2 to 4; that (c) would put these to 1 by then comes too late
    whole = np.where(labels == 3, 1, np.where(labels == 2, 4, labels))
    assert (merge_by_borders(labels, 0.6, merge_area=12.5) == whole).all()


@settings(max_examples=60, deadline=None)
@given(hnp.arrays(np.int32, (12, 13), elements=st.integers(0, 6)), st.sampled_from([0.05, 0.3, 1.0]))
def test_regions_merge_as_if_every_merge_started_again(labels: np.ndarray, resolution: float) -> None:
    wide = np.ascontiguousarray(np.repeat(np.repeat(labels, 3, axis=0), 3, axis=1))
    assert (merge_by_borders(wide, resolution, merge_area=12.5) == slow_merging(wide, resolution, 12.5)).all()


@settings(max_examples=40, deadline=None)
@given(hnp.arrays(np.int32, (10, 11), elements=st.integers(0, 3)))
def test_borders_are_counted_as_in_the_slow_way(labels: np.ndarray) -> None:
    borders = Borders(labels)
    padded = np.pad(labels, 1)
    inside = np.pad(np.ones(labels.shape, bool), 1)  # what lies beyond the map is nobody's border
    for label in range(1, labels.max(initial=0) + 1):
        near = np.zeros(padded.shape, bool)
        for r, c in np.argwhere(padded == label):
            near[r - 1 : r + 2, c - 1 : c + 2] = True
        counts = np.bincount(padded[near & inside & (padded != label)])
        assert borders.shares[label] == {k: n for k, n in enumerate(counts.tolist()) if n > 0}
