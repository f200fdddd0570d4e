"""Training the separator network."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from layoutexplore.cli import app
from layoutexplore.errors import ConfigError
from layoutexplore.layout.merging.separator.network import BORDER, LAYERS, SeparatorNetwork
from layoutexplore.models.network_files import load_weights, shapes_of
from layoutexplore.training.separator.examples import separator_example
from layoutexplore.training.separator.targets import as_input, targets_of
from tests.layout.merging.cases import plan, rooms_of

pytest.importorskip("torch")


def test_training_learns_where_rooms_end() -> None:
    from layoutexplore.training.separator.network import SeparatorTrainingConfig, fit_separator

    example = separator_example(plan(), rooms_of(plan()), 0.05)
    config = SeparatorTrainingConfig(steps=60, batch=4, crop=24)
    told: list[tuple[int, int, float]] = []
    weights = fit_separator([example], config, lambda *args: told.append(args)).weights()
    assert len(told) == 60 and told[-1][2] < 0.7 * told[0][2]
    odds = SeparatorNetwork(weights).forward(np.moveaxis(as_input(example.shares), 0, 2))[..., BORDER]
    truth, weight = targets_of(example)
    right = (odds > 0) == (truth[BORDER] > 0)
    assert right[weight[BORDER] > 0].mean() > 0.85
    again = fit_separator([example], config, lambda *_: None).weights()
    assert all(np.array_equal(weights[name], again[name]) for name in weights), (
        "the same seed, the same network"
    )
    with pytest.raises(ConfigError, match="no map"):
        fit_separator([], config, lambda *_: None)


def test_the_command_writes_a_network(tmp_path: Path) -> None:
    words = ["evaluate", "train-separator", "--simulated", "2", "--plans", "apartment-01", "--steps", "2"]
    result = CliRunner().invoke(app, [*words, "--out", str(tmp_path / "network.safetensors")])
    assert result.exit_code == 0, result.output
    load_weights(tmp_path / "network.safetensors", shapes_of(LAYERS))
