"""The network that completes maps as it runs, against the same one in torch."""

from __future__ import annotations

import numpy as np
import pytest

from layoutexplore.models.network_files import load_weights, shapes_of
from layoutexplore.predictors.floor_model.network import KINDS, LAYERS, FloorNetwork
from layoutexplore.predictors.learned import FLOOR_NETWORK


@pytest.mark.parametrize("shape", [(32, 64), (96, 160)])
def test_it_computes_what_torch_does(shape: tuple[int, int]) -> None:
    torch = pytest.importorskip("torch")
    from layoutexplore.training.floor_network.network import TrainableFloorNetwork

    torch.manual_seed(0)
    network = TrainableFloorNetwork()
    known = np.random.default_rng(0).integers(0, 2, (KINDS, *shape), np.uint8)
    with torch.no_grad():
        values = torch.from_numpy(known[None].astype(np.float32))
        network(values)  # its norms have seen something
        wanted = network.eval()(values)[0].numpy()
    assert np.allclose(FloorNetwork(network.weights()).score(known), wanted, atol=1e-4)


def test_the_one_that_ships_runs() -> None:
    odds = FloorNetwork(load_weights(FLOOR_NETWORK, shapes_of(LAYERS))).score(np.zeros((2, 32, 32), np.uint8))
    assert odds.shape == (32, 32) and odds.dtype == np.float32 and np.isfinite(odds).all()
