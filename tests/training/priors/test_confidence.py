"""The confidence of prior plans: fitted, held out by building."""

from __future__ import annotations

import numpy as np
import pytest

from layoutexplore.errors import ConfigError
from layoutexplore.priors.confidence import FEATURES, model_of_table
from layoutexplore.training.priors.confidence import (
    MIRRORED_WEIGHT,
    example_weights,
    fit_confidence,
    held_out_confidence,
)


def examples(count: int = 3000) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    features = rng.normal(2.0, 3.0, (count, len(FEATURES)))
    chance = 1 / (1 + np.exp(-(features[:, 1] - features[:, 3]) / 3.0))
    return features, rng.uniform(size=count) < chance


def test_what_matters_is_found() -> None:
    features, right = examples()
    model = fit_confidence(features, right)
    order = np.argsort(-np.abs(model.weights[:-1]))[:2]
    assert set(order.tolist()) == {1, 3} and model.weights[1] > 0 > model.weights[3]
    told = model.probability(features)
    assert abs(told.mean() - right.mean()) < 0.01
    for low in (0.0, 0.25, 0.5, 0.75):
        part = (told >= low) & (told < low + 0.25)
        assert abs(told[part].mean() - right[part].mean()) < 0.06


def test_its_table_says_the_same() -> None:
    features, right = examples(500)
    model = fit_confidence(features, right)
    again = model_of_table(model.as_table())
    assert np.abs(again.probability(features) - model.probability(features)).max() < 1e-4


def test_held_out_confidences_do_not_see_their_building() -> None:
    features, right = examples(600)
    buildings = np.arange(600) % 5
    told = held_out_confidence(features, right, buildings)
    expected = fit_confidence(features[buildings != 2], right[buildings != 2])
    assert np.allclose(told[buildings == 2], expected.probability(features[buildings == 2]))


def test_moments_count_alike_and_mirrored_plans_less() -> None:
    mirrored = np.array([False, False, False, True])
    weights = example_weights(["a", "a", "b", "c"], mirrored)
    assert weights.tolist() == [0.5, 0.5, 1.0, MIRRORED_WEIGHT]


def test_weights_reach_the_models_that_are_held_out() -> None:
    features, right = examples(400)
    buildings, weights = np.arange(400) % 4, np.linspace(0.1, 2.0, 400)
    told = held_out_confidence(features, right, buildings, weights)
    others = buildings != 1
    expected = fit_confidence(features[others], right[others], weights[others])
    assert np.allclose(told[~others], expected.probability(features[~others]))


def test_one_kind_of_outcome_is_not_enough() -> None:
    with pytest.raises(ConfigError, match="right and wrong"):
        fit_confidence(np.ones((5, len(FEATURES))), np.ones(5, np.bool_))
    with pytest.raises(ConfigError, match="features"):
        fit_confidence(np.ones((5, 2)), np.ones(5, np.bool_))
