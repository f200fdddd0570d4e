"""Training the forests of the learned predictor."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from layoutexplore.agents import make_agent
from layoutexplore.errors import ConfigError
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.models.forest_files import load_forests, save_forests
from layoutexplore.predictors import make_predictor, make_room_predictor
from layoutexplore.simulation.simulation import Simulation, SimulationConfig
from layoutexplore.training.explorations import stopped_explorations
from layoutexplore.training.folds import deal_folds
from layoutexplore.training.predictor_forests import PredictorForestConfig, fit_frontier_forests, train_models
from layoutexplore.training.predictor_samples import PredictorSamples, gather, join_samples
from tests.plans import THREE_OFFICES


def test_forests_are_what_was_trained(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    names = tuple("abcdefgh")
    features = rng.normal(size=(600, len(names))).astype(np.float32)
    closed = features[:, 3] > 0
    area = np.abs(features[:, 5]).astype(float) * 3
    samples = PredictorSamples(
        features, closed, area, np.where(rng.random(600) < 0.5, "a", "b"), np.ones(600, np.bool_), []
    )
    forests = fit_frontier_forests(samples, PredictorForestConfig(trees=15, rate=0.3, feature_share=1.0))
    assert ((forests["closed"].probability(features) > 0.5) == closed).mean() > 0.95
    path = tmp_path / "model.json"
    save_forests(path, forests, names, "a test")
    again = load_forests(path, names)
    np.testing.assert_allclose(
        again["area"].score(features), forests["area"].score(features), rtol=1e-3, atol=1e-3
    )
    with pytest.raises(ConfigError, match="train it again"):
        load_forests(path, ("size",))
    with pytest.raises(ConfigError, match="'inside' is missing"):
        load_forests(path, names, ("inside",))


def test_generated_plans_do_not_outvote_real_ones() -> None:
    """Where most frontiers are of generated plans, which are otherwise, trees still believe the real ones."""
    rng = np.random.default_rng(0)
    features = rng.normal(size=(900, 2)).astype(np.float32)
    real = np.arange(900) < 200
    closed = (features[:, 0] > 0) == real
    building = np.where(real, "house", np.array([f"generated {k % 50}" for k in range(900)]))
    forests = fit_frontier_forests(
        PredictorSamples(features, closed, np.ones(900), building, real, []),
        PredictorForestConfig(trees=15, rate=0.3),
    )
    assert ((forests["closed"].probability(features) > 0.5) == closed)[real].mean() > 0.95


def test_only_half_of_the_trees_learn_from_doubtful_buildings() -> None:
    """Where two buildings of one size contradict each other, the one that is certain is believed."""
    rng = np.random.default_rng(0)
    features = rng.normal(size=(800, 2)).astype(np.float32)
    building = np.where(np.arange(800) < 400, "plan", "map")
    closed = (features[:, 0] > 0) == (building == "plan")
    samples = PredictorSamples(features, closed, np.ones(800), building, np.ones(800, np.bool_), [])
    plain = PredictorForestConfig(trees=15, rate=0.3)
    forests = fit_frontier_forests(samples, replace(plain, doubtful=frozenset({"map"})))["closed"]
    assert len(forests.roots) == 30
    found = forests.probability(features) > 0.5
    assert (
        (found == closed)[building == "plan"].mean() > 0.9 > 0.2 > (found == closed)[building == "map"].mean()
    )
    for doubtful in (frozenset({"plan", "map"}), frozenset({"another"})):
        alone = fit_frontier_forests(samples, replace(plain, doubtful=doubtful))["closed"]
        assert len(alone.roots) == 15, "without others, or without such, there is one half"


def test_a_model_of_ones_own(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="frontier_model"):
        make_predictor(f"layout:model={tmp_path}")
    plans = [floorplan_from_ascii(THREE_OFFICES, resolution=0.9, name=name) for name in ("one", "other")]
    explorations = [
        e for plan in plans for e in stopped_explorations(plan, make_agent, 1, 4, tmp_path / "store")
    ]
    samples = join_samples([gather(explorations[:2]), gather(explorations[2:])], {"other": "house"})
    assert set(samples.building.tolist()) == {cell.building for cell in samples.cells} == {"one", "house"}
    others = samples.of_buildings(lambda name: name != "one")
    assert set(others.building.tolist()) == {"house"} and len(others.features) == len(
        gather(explorations[2:]).features
    )
    assert deal_folds(["a", "b", "b"], 2, "name") == deal_folds(["b", "a"], 2, "name")
    train_models(samples, tmp_path, {"flat": "house"}, PredictorForestConfig(trees=3, cell_trees=3))
    predictor = make_room_predictor(f"layout:model={tmp_path}")
    assert (
        predictor.name == f"layout:model={tmp_path}" and "house" in (tmp_path / "held_out.json").read_text()
    )
    decision = Simulation(plans[0], SimulationConfig(sensor="short"), predictor).reset(seed=2)
    assert all(f.is_closed is not None for f in decision.frontiers)
    assert predictor.rooms(decision).room_ids.shape == decision.grid.shape
