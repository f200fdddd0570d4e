"""The segmentation measures against cases computed by hand and against a slow obvious version."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from layoutexplore.errors import ConfigError, MapError
from layoutexplore.maps.painted_rooms import truth_labels
from layoutexplore.metrics.segmentation import MEASURES, score_segmentation, scores_of_overlaps


def row(text: str) -> np.ndarray:
    return np.array([[int(c) for c in text]])


def test_by_hand_over_and_under_segmentation() -> None:
    # room 1 (6 cells) is cut into s1 (4) and s2 (2); rooms 2 (3) and 3 (1) are one segment s3 (4)
    truth, found = row("1111112223"), row("1111223333")
    scores = score_segmentation(found, truth, np.ones(truth.shape, bool))
    assert scores.precision == pytest.approx((1 + 1 + 3 / 4) / 3)
    assert scores.recall == pytest.approx((4 / 6 + 1 + 1) / 3)
    assert scores.iou_s == pytest.approx((4 / 6 + 2 / 6 + 3 / 4) / 3)
    assert scores.iou_g == pytest.approx((4 / 6 + 3 / 4 + 1 / 4) / 3)
    assert scores.one_to_one == pytest.approx((4 / 6 + 3 / 4) / 3)
    assert scores.a_fc == pytest.approx(9 / 10)
    assert scores.a_bc == pytest.approx(8 / 10)
    assert (scores.segments, scores.rooms) == (3, 3)


def test_the_matching_is_optimal_not_greedy() -> None:
    # IoU: s1-g1 5/9, s1-g2 3/8, s2-g1 1/8 ... greedy and optimal differ where the best pair blocks two good
    # ones
    truth, found = row("1111111122222"), row("1111122211111")
    truth_free = np.ones(truth.shape, bool)
    scores = score_segmentation(found, truth, truth_free)
    # s1 = 10 cells (5 in g1, 5 in g2), s2 = 3 cells in g1
    greedy_or_not = max(5 / 13 + 0 / 8, 5 / 10 + 3 / 8) / 2
    assert scores.one_to_one == pytest.approx(greedy_or_not)


def test_unclaimed_cells_are_no_room_but_cost_precision() -> None:
    truth, found = row("1111000"), row("1111111")
    scores = score_segmentation(found, truth, np.ones(truth.shape, bool))
    assert scores.precision == pytest.approx(4 / 7)
    assert scores.recall == 1.0
    assert scores.one_to_one == pytest.approx(4 / 7)
    only_free = score_segmentation(found, truth, row("1110000") > 0)
    assert only_free.precision == 1.0
    assert only_free.recall == pytest.approx(3 / 4)  # a room counts whole, with the furniture in it


def test_bormann_drops_small_segments_and_rooms() -> None:
    truth, found = np.repeat(row("112"), 99, axis=0), np.repeat(row("311"), 99, axis=0)
    free = np.ones(truth.shape, bool)
    assert (score_segmentation(found, truth, free, protocol="rose2").segments) == 2
    dropped = score_segmentation(found, truth, free, protocol="bormann")
    assert (dropped.segments, dropped.rooms) == (1, 1)
    assert dropped.precision == pytest.approx(0.5)


def test_nothing_found_scores_nothing() -> None:
    truth = row("1122")
    scores = score_segmentation(np.zeros_like(truth), truth, truth > 0)
    assert all(getattr(scores, m) == 0.0 for m in MEASURES)
    assert (scores.segments, scores.rooms) == (0, 2)


def test_bad_input_is_refused() -> None:
    truth = row("1122")
    with pytest.raises(ConfigError, match="protocol"):
        score_segmentation(truth, truth, truth > 0, protocol="rose")
    with pytest.raises(MapError, match="size"):
        score_segmentation(truth[:, 1:], truth, truth > 0)
    with pytest.raises(MapError, match="16 bit"):
        truth_labels(np.zeros((3, 3), np.int32))  # type: ignore[arg-type]


def test_ties_do_not_depend_on_the_numbers_of_rooms() -> None:
    # the segment shares two cells with each room; the smaller room is the better one
    found, free = row("11110000"), np.ones((1, 8), bool)
    for truth in (row("11222222"), row("22111111")):
        assert score_segmentation(found, truth, free).iou_s == pytest.approx(2 / 4)
        assert score_segmentation(truth, found, free).iou_g == pytest.approx(2 / 4)


def test_ids_below_zero_are_named_and_high_ones_are_as_good_as_low_ones() -> None:
    truth, found = row("11112222"), row("11122222")
    free = truth > 0
    plain = score_segmentation(found, truth, free)
    for high in (2**31, 2**62):
        assert score_segmentation(np.where(found == 2, high, found), truth, free) == plain
        assert score_segmentation(found, np.where(truth == 2, high, truth), free) == plain
    assert score_segmentation(found.astype(np.uint64) * np.uint64(2**62), truth, free) == plain
    for segments, rooms, said in ((-found, truth, "segments"), (found, -truth, "rooms")):
        with pytest.raises(MapError, match=f"{said} are 0 for none and above"):
            score_segmentation(segments, rooms, free)
    assert score_segmentation(np.where(free, found, -1), truth, free) == plain


def test_levels_of_16_bit_are_numbers_of_rooms() -> None:
    image = np.zeros((20, 30), np.uint16)
    image[:10], image[10, 0] = 7, 4000
    labels = truth_labels(image)
    assert (labels[:10] == 1).all() and labels[10, 0] == 2 and not labels[11:].any()
    colours = np.dstack([image[..., None] * 0] * 3)
    colours[:, :15, 0] = 65535
    assert (truth_labels(colours) == truth_labels((colours // 257).astype(np.uint8))).all()


def test_truth_colours_become_rooms_and_rare_ones_none() -> None:
    image = np.zeros((30, 40, 3), np.uint8)
    image[:, :10] = (255, 0, 0)
    image[:, 10:20] = (0, 255, 0)
    image[0, 20:30] = (9, 9, 9)
    labels = truth_labels(image)
    assert labels.dtype == np.int32
    assert sorted(np.unique(labels)) == [0, 1, 2]
    assert labels[5, 5] == 2 and labels[5, 15] == 1 and labels[0, 25] == 0
    assert (truth_labels(np.dstack([image, np.full(image.shape[:2], 255, np.uint8)])) == labels).all()
    assert (truth_labels(image[..., 0]) == (labels == 2)).all()


def slow_one_to_one(found: np.ndarray, truth: np.ndarray) -> float:
    segments, rooms = sorted(set(found) - {0}), sorted(set(truth) - {0})
    if not segments or not rooms:
        return 0.0
    size = max(len(segments), len(rooms))
    iou = np.zeros((size, size))
    for i, s in enumerate(segments):
        for j, g in enumerate(rooms):
            iou[i, j] = ((found == s) & (truth == g)).sum() / ((found == s) | (truth == g)).sum()
    return max(sum(iou[i, p[i]] for i in range(size)) for p in permutations(range(size))) / size


@settings(max_examples=60, deadline=None)
@given(
    hnp.arrays(np.int32, 30, elements=st.integers(0, 4)), hnp.arrays(np.int32, 30, elements=st.integers(0, 4))
)
def test_one_to_one_equals_the_best_of_all_permutations(found: np.ndarray, truth: np.ndarray) -> None:
    scores = score_segmentation(found[None], truth[None], np.ones((1, 30), bool))
    assert scores.one_to_one == pytest.approx(slow_one_to_one(found, truth))
    assert all(0.0 <= getattr(scores, m) <= 1.0 for m in MEASURES)
    if set(truth) - {0}:
        alike = score_segmentation(truth[None], truth[None], np.ones((1, 30), bool))
        assert all(getattr(alike, m) == pytest.approx(1.0) for m in MEASURES)


@pytest.mark.parametrize(
    "shapes",
    [((2, 3), (3,), (2,)), ((2, 3), (2, 1), (3,)), ((6,), (2,), (3,)), ((0, 0), (1,), (0,)), ((), (), ())],
)
def test_overlaps_and_sizes_fit(shapes: tuple[tuple[int, ...], ...]) -> None:
    with pytest.raises(ConfigError, match="size of each"):
        scores_of_overlaps(*(np.ones(shape, np.int64) for shape in shapes))
    with pytest.raises(ConfigError, match="at least one cell"):
        scores_of_overlaps(np.zeros((1, 1), np.int64), np.zeros(1, np.int64), np.ones(1, np.int64))
