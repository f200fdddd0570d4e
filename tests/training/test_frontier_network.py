"""Training the network that classifies frontiers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from layoutexplore.predictors.frontier_model.network import SHAPES
from layoutexplore.predictors.frontier_model.network_input import (
    BEHIND,
    KNOWN,
    OTHER_ROOM,
    PLANES,
    ROOM_BEHIND,
    SIDE,
)
from tests.predictors.frontier_model.cases import network_of


def test_rounding_keeps_what_torch_has_learnt() -> None:
    torch = pytest.importorskip("torch")
    from layoutexplore.training.frontier_network import TrainableFrontierNetwork, quantised_weights

    torch.manual_seed(0)
    network, windows = TrainableFrontierNetwork(0.0), wide_and_narrow()[0]
    shares = torch.from_numpy(windows).permute(0, 3, 1, 2).float() / 255.0
    with torch.no_grad():
        for _ in range(40):
            network.train()(shares)  # The norms get to know the windows.
        expected = ((network.eval()(shares) + network(shares.flip(3))) / 2).numpy()
    weights = quantised_weights(network, windows)
    found = network_of(weights).score(windows)
    for output in range(3):
        assert np.corrcoef(found[:, output], expected[:, output])[0, 1] > 0.97
    np.testing.assert_allclose(found.mean(axis=0), expected.mean(axis=0), atol=0.02)


def wide_and_narrow() -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Windows with much or little that is unknown ahead, and which these are."""
    rng = np.random.default_rng(0)
    windows, narrow = np.zeros((300, SIDE, SIDE, PLANES), np.uint8), rng.random(300) < 0.5
    for window, is_narrow in zip(windows, narrow, strict=True):
        depth, width = rng.integers(4, 20), 4 if is_narrow else 14
        window[BEHIND : BEHIND + depth, SIDE // 2 - width : SIDE // 2 + width, 2] = 255
    return windows, narrow


def test_training_tells_wide_from_narrow() -> None:
    pytest.importorskip("torch")
    from layoutexplore.training.frontier_network import FrontierNetworkConfig, train_frontier_network
    from layoutexplore.training.predictor_samples import CropSamples

    windows, closed = wide_and_narrow()
    area = np.where(closed, 0.5, 20.0)
    truth = np.where(
        windows[..., 2] > 0, np.where(closed[:, None, None], ROOM_BEHIND, OTHER_ROOM), KNOWN
    ).astype(np.uint8)
    parts = [
        CropSamples(windows[k::2], closed[k::2], area[k::2], truth[k::2], name) for k, name in enumerate("ab")
    ]
    told: list[tuple[int, int, float]] = []
    config = FrontierNetworkConfig(steps=60, batch=32)
    weights = train_frontier_network(
        parts[:1], parts[1:], {"b": "house"}, config, lambda *args: told.append(args)
    )
    found = network_of(weights).score(windows)
    assert (((found[:, 0] > 0) == closed).mean(), ((found[:, 1] > 0) == closed).mean()) > (0.95, 0.95)
    assert found[closed, 2].max() < found[~closed, 2].min()
    assert told[-1][:2] == (60, 60) and told[-1][2] < told[0][2]
    short = replace(config, steps=3)
    once, again = (
        train_frontier_network(parts[:1], parts[1:], {"b": "house"}, short, lambda *_: None) for _ in range(2)
    )
    assert all(np.array_equal(once[name], again[name]) for name in SHAPES), "the same seed, the same network"
    assert all(weights[name].shape == shape for name, shape in SHAPES.items())


def test_squares_are_drawn_the_way_their_windows_lie() -> None:
    """Ahead to the left is the room behind, to the right another: windows must lie as their truth."""
    torch = pytest.importorskip("torch")
    from layoutexplore.training.frontier_network import (
        CropBatches,
        CropPool,
        FrontierNetworkConfig,
        TrainableFrontierNetwork,
        fit_frontier_network,
    )
    from layoutexplore.training.predictor_samples import CropSamples

    rng = np.random.default_rng(0)
    windows = np.zeros((64, SIDE, SIDE, PLANES), np.uint8)
    windows[:, :, : SIDE // 2, 6] = 255
    windows[:, : BEHIND // 2, :, 1] = 255
    windows[..., 0] = rng.integers(0, 2, windows.shape[:3]) * 255
    truth = np.where(
        windows[..., 1] > 0, KNOWN, np.where(windows[..., 6] > 0, ROOM_BEHIND, OTHER_ROOM)
    ).astype(np.uint8)
    pool = CropPool([CropSamples(windows, np.ones(64, np.bool_), np.ones(64), truth, "a")], {})
    config = FrontierNetworkConfig(steps=40, batch=16, rate=1e-2)
    draws, ways = CropBatches(pool, CropPool([], {}), config), set()
    for _ in range(20):
        drawn, _, _, of = draws.draw(3)
        expected = np.where(drawn[..., 1] > 0, KNOWN, np.where(drawn[..., 6] > 0, ROOM_BEHIND, OTHER_ROOM))
        np.testing.assert_array_equal(of, expected)
        ways.add(bool(drawn[0, 0, 0, 6]))
    assert ways == {False, True}, "some are mirrored"
    torch.manual_seed(0)
    network = TrainableFrontierNetwork(0.0)
    fit_frontier_network(network, draws, config, lambda *_: None)
    with torch.no_grad():
        squares = network.drawing(
            network.hidden(torch.from_numpy(windows).permute(0, 3, 1, 2).float() / 255.0)
        ).argmax(1)
    riddles = truth != KNOWN
    assert (squares.numpy()[riddles] == truth[riddles]).mean() > 0.95
