"""Random networks for frontiers and their input."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from layoutexplore.predictors.frontier_model.network import LAYERS, MOST, FrontierNetwork
from layoutexplore.predictors.frontier_model.network_input import PLANES, SIDE


def random_weights(seed: int) -> dict[str, NDArray[np.generic]]:
    """Whole weights that neither fade nor saturate."""
    rng, weights = np.random.default_rng(seed), dict[str, NDArray[np.generic]]()
    for name, (inputs, outputs, side, _) in LAYERS.items():
        size = side * side * inputs
        weights[f"{name}.weight"] = rng.integers(-MOST, MOST + 1, (size, outputs)).astype(np.int8)
        weights[f"{name}.scale"] = np.full(outputs, 2.0 / (MOST * np.sqrt(size)), np.float32)
        weights[f"{name}.bias"] = rng.normal(0, 5, outputs).astype(np.float32)
    return weights


def random_windows(count: int, seed: int = 0) -> NDArray[np.uint8]:
    return np.random.default_rng(seed).integers(0, 256, (count, SIDE, SIDE, PLANES)).astype(np.uint8)


def network_of(weights: Mapping[str, NDArray[np.generic]]) -> FrontierNetwork:
    return FrontierNetwork({name: values.astype(np.float32) for name, values in weights.items()})
