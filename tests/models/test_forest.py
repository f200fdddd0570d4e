"""Trees as masks of leaves: the same sums as walking, to the last bit."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from layoutexplore.models.forest import Forest, log_odds
from layoutexplore.models.quickscorer import leaf_masks, log_odds_by_masks, rounded_down

FEATURES = 5


def random_forest(rng: np.random.Generator, leaves: int, trees: int) -> Forest:
    """Trees of up to so many leaves, grown by splitting random leaves; thresholds are small whole numbers."""
    feature, threshold, left, right, roots = [], [], [], [], []
    for _ in range(trees):
        begin = len(feature)
        roots.append(begin)
        grown = [(-1, float(rng.normal()), 0, 0)]
        for _ in range(int(rng.integers(leaves))):
            k = int(rng.choice([n for n, node in enumerate(grown) if node[0] < 0]))
            grown[k] = (
                int(rng.integers(FEATURES)),
                float(rng.integers(-3, 4)),
                begin + len(grown),
                begin + len(grown) + 1,
            )
            grown += [(-1, float(rng.normal()), 0, 0), (-1, float(rng.normal()), 0, 0)]
        for column, values in zip((feature, threshold, left, right), zip(*grown, strict=True), strict=True):
            column.extend(values)
    whole = [np.array(column, np.int32) for column in (feature, left, right, roots)]
    return Forest(
        whole[0], np.array(threshold, np.float64), whole[1], whole[2], whole[3], float(rng.normal())
    )


def walked(forest: Forest, samples: NDArray[np.floating]) -> NDArray[np.float64]:
    odds = np.empty(len(samples))
    log_odds(samples, forest.numbers, odds)
    return odds


@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 2**32 - 1), st.sampled_from([1, 3, 32, 33, 64]), st.sampled_from([0, 1, 63, 64, 65, 150])
)
def test_masks_give_the_sums_of_the_walks(seed: int, leaves: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    forest = random_forest(rng, leaves, trees=4)
    masks = leaf_masks(forest.feature, forest.threshold, forest.left, forest.right, forest.roots, forest.bias)
    assert masks is not None
    samples = rng.integers(-4, 5, (count, FEATURES)).astype(np.float64)
    samples[rng.random(samples.shape) < 0.1] = rng.choice([np.nan, np.inf, -np.inf])
    odds = np.empty(count)
    log_odds_by_masks(samples, masks, odds)
    np.testing.assert_array_equal(odds, walked(forest, samples))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([20, 60, 120]), st.sampled_from([np.float32, np.float64]))
def test_a_forest_scores_samples_of_either_type(seed: int, leaves: int, dtype: type[np.floating]) -> None:
    """Trees of more than 64 leaves are walked; thresholds finer than float32 divide float32 samples alike."""
    rng = np.random.default_rng(seed)
    forest = random_forest(rng, leaves, trees=2)
    forest.threshold[forest.feature >= 0] += rng.normal(0, 1e-9, np.count_nonzero(forest.feature >= 0))
    samples = rng.integers(-4, 5, (30, FEATURES)).astype(dtype)
    np.testing.assert_array_equal(forest.score(samples), walked(forest, samples))


@given(st.floats(-1e30, 1e30))
def test_rounded_down_is_the_next_float32_below(value: float) -> None:
    single = rounded_down(np.array([value]))[0]
    assert float(single) <= value < float(np.nextafter(single, np.float32(np.inf)))


def test_too_many_leaves_have_no_masks() -> None:
    forest = random_forest(np.random.default_rng(1), 400, trees=1)
    assert np.count_nonzero(forest.feature < 0) > 64
    arguments = (forest.feature, forest.threshold, forest.left, forest.right, forest.roots, forest.bias)
    assert leaf_masks(*arguments) is None
    assert forest.score(np.zeros((9, FEATURES))) == pytest.approx(walked(forest, np.zeros((9, FEATURES))))


def test_a_forest_by_hand() -> None:
    numbers = [np.array(v, np.int32) for v in ([1, -1, -1], [1, 0, 0], [2, 0, 0], [0])]
    forest = Forest(
        numbers[0], np.array([0.5, -1.0, 2.0], np.float32), numbers[1], numbers[2], numbers[3], 0.25
    )
    assert forest.score(np.array([[9.0, 0.5], [0.0, 0.6]], np.float32)).tolist() == [-0.75, 2.25]


def test_a_forest_far_too_sure_is_certain() -> None:
    column = np.array([0], np.int32)
    for said, chance in ((-1e5, 0.0), (0.0, 0.5), (1e5, 1.0)):
        forest = Forest(column - 1, np.array([said]), column, column, column, 0.0)
        with np.errstate(all="raise", under="ignore"):
            np.testing.assert_allclose(forest.probability(np.zeros((1, 1))), chance, atol=1e-300)
