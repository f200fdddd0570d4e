"""The network that classifies frontiers: its whole numbers against a slow version, its memory, its file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError
from layoutexplore.models.network_files import load_weights, save_weights
from layoutexplore.predictors.frontier_model.network import LAYERS, MOST, SHAPES, FrontierNetwork
from layoutexplore.predictors.frontier_model.network_input import SIDE
from tests.predictors.frontier_model.cases import network_of, random_weights, random_windows


def test_sums_are_exact() -> None:
    """Largest inputs times largest weights stay below 2^24 in every layer: no order of summing matters."""
    for name, (inputs, _, side, _) in LAYERS.items():
        largest = 255 if name == next(iter(LAYERS)) else MOST
        assert side * side * inputs * largest * MOST < 2**24, name


def test_company_and_memory_change_nothing() -> None:
    network, windows = network_of(random_weights(0)), random_windows(9)
    alone = np.concatenate([network_of(random_weights(0)).score(windows[k : k + 1]) for k in range(9)])
    assert len(np.unique(alone[:, 0])) == 9, "windows differ"
    np.testing.assert_array_equal(network.score(windows[:5]), alone[:5])
    np.testing.assert_array_equal(network.score(windows[[7, 3, 3, 1, 8]]), alone[[7, 3, 3, 1, 8]])
    np.testing.assert_array_equal(network.score(windows[::-1]), alone[::-1])
    assert network.score(windows[:0]).shape == (0, 3)


def slowly_judged(
    weights: Mapping[str, NDArray[np.generic]], window: NDArray[np.uint8]
) -> NDArray[np.float64]:
    """What the network finds for one window as it is, square by square; sums are exact in whole numbers."""
    values = window.astype(np.int64)
    for name, (inputs, outputs, side, stride) in LAYERS.items():
        kernel = weights[f"{name}.weight"].astype(np.int64)
        if side == 1:
            sums = values.reshape(-1) @ kernel
        else:
            rows, cols = (-(-size // stride) for size in values.shape[:2])
            padded, sums = np.pad(values, ((1, 1), (1, 1), (0, 0))), np.zeros((rows, cols, outputs), np.int64)
            kernel = kernel.reshape(side, side, inputs, outputs)
            for r in range(rows):
                for c in range(cols):
                    shown = padded[r * stride : r * stride + side, c * stride : c * stride + side]
                    sums[r, c] = np.tensordot(shown, kernel, axes=3)
        found = sums.astype(np.float32) * weights[f"{name}.scale"] + weights[f"{name}.bias"]
        values = np.clip(np.rint(found), 0, MOST).astype(np.int64)
    return np.asarray(found, np.float64)


@pytest.mark.parametrize("seed", range(4))
def test_judgement_against_a_slow_one(seed: int) -> None:
    """The mean over the window and the mirrored one, to the last bit."""
    weights, windows = random_weights(seed), random_windows(2, seed)
    windows[1] *= np.random.default_rng(seed).random((SIDE, SIDE, 1)) < 0.3
    expected = [
        (slowly_judged(weights, window) + slowly_judged(weights, window[:, ::-1])) / 2 for window in windows
    ]
    np.testing.assert_array_equal(network_of(weights).score(windows), np.array(expected, np.float32))


def test_mirrored_windows_are_judged_alike() -> None:
    windows = random_windows(4)
    np.testing.assert_array_equal(
        network_of(random_weights(2)).score(windows), network_of(random_weights(2)).score(windows[:, :, ::-1])
    )


def test_a_network_survives_its_file(tmp_path: Path) -> None:
    weights, windows, path = random_weights(1), random_windows(3), tmp_path / "frontiers.safetensors"
    save_weights(path, weights, "a test")
    read = FrontierNetwork(load_weights(path, SHAPES))
    np.testing.assert_array_equal(read.score(windows), network_of(weights).score(windows))
    save_weights(path, {name: values for name, values in weights.items() if name != "weigh.scale"}, "a test")
    with pytest.raises(ConfigError, match=r"frontiers\.safetensors: weigh\.scale is missing"):
        load_weights(path, SHAPES)


def test_weights_of_which_no_sum_is_finite_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "frontiers.safetensors"
    for large in (np.float32(-3e38), np.float64(1e200)):  # as float32 the latter is infinite
        bias = np.full(3, large)
        save_weights(path, {**random_weights(1), "judge.bias": bias}, "a test")
        with pytest.raises(
            ConfigError, match=r"frontiers\.safetensors: 'judge\.bias' holds .*train it again"
        ):
            load_weights(path, SHAPES)
