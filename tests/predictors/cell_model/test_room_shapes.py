"""From classified cells to shapes of rooms: the best threshold and rectangle, nothing but unknown cells."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from layoutexplore.predictors.cell_model.features import FEATURES, CandidateCells
from layoutexplore.predictors.cell_model.room_shapes import (
    EVIDENCE,
    Window,
    best_rectangle,
    likeliest_overlap,
    room_shapes,
    straightened,
)

STRIDE = 3


def classified_cells(squares: NDArray[np.int32], region: NDArray[np.int32]) -> CandidateCells:
    """CandidateCells in the middle of some squares."""
    boxes = np.zeros((int(region.max(initial=0)) + 1, 5), np.int64)
    features = np.zeros((len(squares), len(FEATURES)), np.float32)
    return CandidateCells(
        (STRIDE * squares + 1).astype(np.int32),
        region,
        np.zeros(len(region), np.int32),
        features,
        STRIDE,
        boxes,
    )


def expected_overlap(
    chance: NDArray[np.float64], classified: NDArray[np.bool_], box: tuple[int, int, int, int]
) -> float:
    inside = np.zeros(chance.shape, np.bool_)
    inside[box[0] : box[1], box[2] : box[3]] = True
    return float(chance[inside].sum() / max((inside & classified).sum() + chance[~inside].sum(), 1e-9))


@settings(max_examples=60, deadline=None)
@given(values=st.lists(st.floats(0.01, 0.99), min_size=1, max_size=12))
def test_no_threshold_overlaps_more(values: list[float]) -> None:
    probability = np.array(values)

    def overlap(level: float) -> float:
        inside = probability >= level
        return float(probability[inside].sum() / (inside.sum() + probability[~inside].sum()))

    assert overlap(likeliest_overlap(probability)) >= max(overlap(level) for level in probability) - 1e-12


@settings(max_examples=60, deadline=None)
@given(chance=arrays(np.float64, (6, 7), elements=st.floats(0.0, 0.99)), classified=arrays(np.bool_, (6, 7)))
def test_no_single_side_of_the_best_rectangle_can_be_moved_to_a_better_place(
    chance: NDArray[np.float64], classified: NDArray[np.bool_]
) -> None:
    chance = np.where(classified, chance, 0.0)
    box = best_rectangle(chance, classified)
    reached = expected_overlap(chance, classified, box)
    for side in range(4):
        for place in range(chance.shape[side // 2] + 1):
            moved = [*box]
            moved[side] = place
            if moved[0] < moved[1] and moved[2] < moved[3]:
                assert (
                    expected_overlap(chance, classified, (moved[0], moved[1], moved[2], moved[3]))
                    <= reached + 1e-6
                )


@pytest.mark.parametrize("box", list(combinations(range(1, 7), 2))[::3])
def test_a_clear_rectangle_is_found(box: tuple[int, int]) -> None:
    chance = np.full((8, 8), 0.1)
    chance[box[0] : box[1], 2:6] = 0.9
    assert best_rectangle(chance, np.ones(chance.shape, np.bool_)) == (*box, 2, 6)


def test_without_a_likely_square_there_is_no_rectangle() -> None:
    assert best_rectangle(np.full((3, 3), 0.1), np.ones((3, 3), np.bool_)) == (0, 0, 0, 0)


def test_a_rectangle_is_evidence() -> None:
    chance = np.full((6, 6), 0.1)
    chance[1:4, 1:5] = 0.8
    chance[2, 2] = 0.4  # a doubtful square in the middle of a room
    classified = np.ones(chance.shape, np.bool_)
    classified[0] = False
    after = straightened(Window(1, 0, 0, np.where(classified, chance, 0.0), classified)).chance
    odds = 0.4 / 0.6 * np.exp(EVIDENCE)
    assert after[2, 2] == pytest.approx(odds / (1 + odds)) and after[5, 5] < 0.1 and (after[0] == 0).all()


def test_shapes_are_smooth_hold_only_unknown_cells_and_the_likelier_room_has_them() -> None:
    cells = np.full((30, 30), -1, np.int8)
    cells[:, :3] = 0
    rows, cols = (part.ravel() for part in np.mgrid[0:10, 1:10])
    squares = np.concatenate([np.stack([rows, cols], 1)] * 2).astype(np.int32)
    region = np.repeat(np.array([1, 2], np.int32), len(rows))
    probability = np.concatenate([np.where(rows < 5, 0.95, 0.05), np.where(rows >= 5, 0.9, 0.05)])
    shapes = room_shapes(cells, classified_cells(squares, region), probability)
    masks = {}
    for number, shape in shapes.items():
        masks[number] = np.zeros(cells.shape, np.bool_)
        masks[number][
            shape.row : shape.row + shape.mask.shape[0], shape.col : shape.col + shape.mask.shape[1]
        ] = shape.mask
    assert not (masks[1] & masks[2]).any() and not ((masks[1] | masks[2]) & (cells == 0)).any()
    assert masks[1][:14, 3:].all()
    assert masks[2][16:, 3:].all()
    assert not masks[1][17:].any()
    assert not masks[2][:13].any()


def test_nothing_classified_gives_no_shape() -> None:
    none = classified_cells(np.zeros((0, 2), np.int32), np.zeros(0, np.int32))
    assert room_shapes(np.full((5, 5), -1, np.int8), none, np.zeros(0)) == {}
