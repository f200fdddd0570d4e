"""Crops of examples and the truth of their squares, by hand."""

from __future__ import annotations

from dataclasses import astuple

import numpy as np
import pytest

from layoutexplore.grids.arrays import Floats32
from layoutexplore.layout.merging.separator.network import BORDER, OFFSETS, OUTSIDE, THING
from layoutexplore.layout.merging.separator.planes import KINDS, PATCH
from layoutexplore.training.separator.crops import draw_crop, stacked_crops
from layoutexplore.training.separator.examples import SeparatorExample

torch = pytest.importorskip("torch")

SIDE = 32


def halves() -> SeparatorExample:
    """Room 1 left, room 2 right of the middle, no room in the last eight columns; all of it free."""
    rooms = np.ones((SIDE, SIDE), np.int16)
    rooms[:, 12:24], rooms[:, 24:] = 2, 0
    shares = np.zeros((2 * SIDE, 2 * SIDE, KINDS), np.uint8)
    shares[..., 0] = 255
    nothing = np.zeros((SIDE, SIDE), np.uint8)
    return SeparatorExample(shares, rooms, nothing, nothing)


def truth_of(example: SeparatorExample) -> tuple[Floats32, Floats32]:
    """What is true of the squares of an example, and how much each counts."""
    from layoutexplore.training.separator.targets import targets_of

    truth, weight = targets_of(*(torch.from_numpy(part[None]) for part in astuple(example)))
    return truth[0].numpy(), weight[0].numpy()


def test_truth_of_two_rooms_side_by_side() -> None:
    from layoutexplore.training.separator.targets import BOTH_OUTSIDE

    truth, weight = truth_of(halves())
    assert (truth[BORDER].sum(axis=0) > 0).nonzero()[0].tolist() == [11, 12, 23, 24]
    assert (weight[BORDER] == 1).all()
    assert (truth[OUTSIDE][:, 24:] == 1).all() and (truth[OUTSIDE][:, :24] == 0).all()
    assert not weight[THING].any(), "there is no obstacle"
    for k, (up, right) in enumerate(OFFSETS):
        same, asked = truth[3 + k], weight[3 + k]
        for col in range(SIDE):
            there = col + right
            if not 0 <= there < SIDE:
                assert not asked[:, col].any()
                continue
            of = [1 if c < 12 else 2 if c < 24 else 0 for c in (col, there)]
            assert (same[: SIDE - up, col] == (of[0] == of[1])).all()
            assert asked[: SIDE - up, col] == pytest.approx(BOTH_OUTSIDE if of == [0, 0] else 1.0)
            assert not asked[SIDE - up :, col].any()


def test_a_crop_shows_a_part_with_its_truth() -> None:
    example = halves()
    for seed in range(12):
        crop = draw_crop(example, 4, np.random.default_rng(seed))
        assert crop.shares.shape == (4 * PATCH, 4 * PATCH, KINDS) and crop.rooms.shape == (8, 8)
        # whatever its orientation, rooms lie side by side in stripes of the whole crop
        along = crop.rooms if (crop.rooms == crop.rooms[0]).all() else crop.rooms.T
        assert (along == along[0]).all()
    beyond = draw_crop(example, 24, np.random.default_rng(0))
    assert beyond.rooms.shape == (48, 48) and np.count_nonzero(beyond.shares[..., 0]) == (2 * SIDE) ** 2


def test_the_input_is_as_the_network_takes_it() -> None:
    from layoutexplore.training.separator.targets import as_input

    rng = np.random.default_rng(1)
    shares = rng.integers(0, 256, (16, 16, KINDS)).astype(np.uint8)
    values = as_input(torch.from_numpy(shares[None]))[0].numpy()
    assert values.shape == (PATCH * PATCH * KINDS, 4, 4)
    assert values[(1 * PATCH + 2) * KINDS + 3, 2, 1] == np.float32(shares[9, 6, 3] / np.float32(255))


def test_the_truth_of_a_batch_is_that_of_each_crop() -> None:
    rng = np.random.default_rng(3)
    rooms = rng.integers(0, 3, (40, 40)).astype(np.int16)
    shares = rng.integers(0, 80, (80, 80, KINDS)).astype(np.uint8)
    thing, known = (rng.integers(0, 256, (40, 40)).astype(np.uint8) for _ in range(2))
    crops = stacked_crops([SeparatorExample(shares, rooms, thing, known), halves()], 5, 6, rng)
    assert crops.shares.shape == (5, 24, 24, KINDS) and crops.rooms.shape == (5, 12, 12)
    from layoutexplore.training.separator.targets import targets_of

    several = [part.numpy() for part in targets_of(*map(torch.from_numpy, astuple(crops)))]
    for k in range(5):
        one = truth_of(SeparatorExample(*(part[k] for part in astuple(crops))))
        assert all(np.array_equal(whole[k], part) for whole, part in zip(several, one, strict=True))
