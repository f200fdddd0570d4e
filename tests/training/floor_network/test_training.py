"""Training the network that completes maps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from layoutexplore.agents import make_agent
from layoutexplore.cli import app
from layoutexplore.errors import ConfigError
from layoutexplore.maps import load_plan
from layoutexplore.training.explorations import stopped_explorations
from layoutexplore.training.floor_network.crops import SIDE, crops_of_maps, draw_batch

pytest.importorskip("torch")

from layoutexplore.training.floor_network.network import (
    FloorTrainingConfig,
    TrainableFloorNetwork,
    train_floor_network,
)


@pytest.fixture(scope="module")
def crops() -> np.ndarray:
    maps = next(stopped_explorations(load_plan("apartment-01"), make_agent, 1, 6))
    return np.array(crops_of_maps(maps, np.random.default_rng(0)))


def test_crops_show_what_is_known_and_ask_for_what_is_not(crops: np.ndarray) -> None:
    batch = draw_batch(crops, 8, np.random.default_rng(1))
    assert batch.known.shape == (8, 2, SIDE, SIDE) and batch.floor.shape == batch.weight.shape == (
        8,
        SIDE,
        SIDE,
    )
    seen = batch.known.any(axis=1)
    assert (batch.weight[seen] == 0.0).all() and (batch.weight[~seen] > 0.0).any()
    # What is known to be free is floor.
    assert (batch.floor[batch.known[:, 0] > 0] == 1.0).all()
    assert 0.0 < batch.floor[batch.weight > 0.0].mean() < 1.0


def test_it_learns_and_goes_on(crops: np.ndarray, tmp_path: Path) -> None:
    config = FloorTrainingConfig(steps=12, batch=4, rate=2e-2)
    losses: list[float] = []
    weights = train_floor_network(
        crops, config, lambda _a, _b, loss: losses.append(loss), tmp_path / "kept.safetensors"
    )
    assert losses[-1] < losses[0]
    assert all(values.dtype == np.float16 for values in weights.values())
    again = train_floor_network(crops, config, lambda *_: None, tmp_path / "kept.safetensors")
    assert all(np.array_equal(weights[name], again[name]) for name in weights)
    assert set(weights) == set(TrainableFloorNetwork().weights())


def test_without_maps_there_is_nothing_to_learn() -> None:
    with pytest.raises(ConfigError, match="there is no map to learn from"):
        train_floor_network(np.zeros((0, 0), np.uint8), FloorTrainingConfig(steps=1), lambda *_: None)


def test_the_command_writes_a_network_that_a_predictor_takes(tmp_path: Path) -> None:
    words = ["evaluate", "train-floor", "apartment-01", "--snapshots", "2", "--copies", "0", "--steps", "2"]
    done = CliRunner().invoke(
        app,
        [
            *words,
            "--batch",
            "2",
            "--out",
            str(tmp_path / "floor.safetensors"),
            "--store",
            str(tmp_path / "kept"),
        ],
    )
    assert done.exit_code == 0, done.output
    from layoutexplore.models.network_files import load_weights, shapes_of
    from layoutexplore.predictors.floor_model.network import LAYERS

    assert load_weights(tmp_path / "floor.safetensors", shapes_of(LAYERS))
    others = CliRunner().invoke(
        app,
        [*words[:2], "apartment-02", *words[3:], "--batch", "2", "--out", str(tmp_path / "other.safetensors"),
         "--store", str(tmp_path / "kept")],
    )  # fmt: skip
    assert others.exit_code == 0, others.output
    states = list((tmp_path / "kept").glob("floor-*.safetensors"))
    assert len(states) == 2, "what is learnt from tells kept trainings apart"
