"""Training the network that completes rooms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from layoutexplore.predictors.cell_model.network import CellNetwork
from tests.predictors.cell_model.cases import half_seen, scene_of


def test_training_learns_a_half_seen_room() -> None:
    pytest.importorskip("torch")
    from layoutexplore.training.cell_network import (
        CellNetworkConfig,
        pretrain_cell_network,
        train_cell_network,
    )
    from layoutexplore.training.predictor_samples import CellNetworkSample

    scene = scene_of(half_seen())
    inside = (
        (scene.lattice_cells[:, 1] < 25) & (scene.lattice_cells[:, 0] > 3) & (scene.lattice_cells[:, 0] < 17)
    )
    sample = CellNetworkSample(scene, inside, "a")
    config = CellNetworkConfig(first_steps=40, steps=40, batch=4, crop=24)
    told: list[tuple[int, int, float]] = []
    first = pretrain_cell_network([sample], config, lambda *args: told.append(args))
    weights = train_cell_network(first, [sample], [sample], config, lambda *args: told.append(args))
    odds = CellNetwork(weights).score(scene)
    assert ((odds > 0) == inside).mean() > 0.9
    assert told[39][:2] == (40, 40) and len(told) == 80 and told[-1][2] < told[0][2]
    short = replace(config, steps=3)
    once, again = (train_cell_network(first, [sample], [sample], short, lambda *_: None) for _ in range(2))
    assert all(np.array_equal(once[name], again[name]) for name in weights), "the same seed, the same network"
