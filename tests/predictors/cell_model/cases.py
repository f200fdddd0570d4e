"""Grids, scenes and random networks for cells."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from layoutexplore.layout.doorways import doorway_regions
from layoutexplore.predictors.cell_model.features import find_candidates
from layoutexplore.predictors.cell_model.network import LAYERS
from layoutexplore.predictors.cell_model.network_input import NetworkInput, make_network_input

GRIDS = hnp.arrays(
    np.int8,
    st.tuples(st.integers(6, 40), st.integers(6, 40)),
    elements=st.sampled_from([-1, -1, 0, 0, 0, 100]),
)


def scene_of(cells: NDArray[np.int8]) -> NetworkInput:
    regions = doorway_regions(cells, 0.1)
    return make_network_input(cells, regions, find_candidates(cells, regions, 0.1), 0.1)


def half_seen() -> NDArray[np.int8]:
    """A room of which the left half is known."""
    cells = np.full((60, 90), -1, np.int8)
    cells[10:50, 10:45] = 0
    cells[9, 9:45] = cells[50, 9:45] = cells[9:51, 9] = 100
    return cells


def random_weights(seed: int) -> dict[str, NDArray[np.float32]]:
    rng, weights = np.random.default_rng(seed), {}
    for name, (inputs, outputs, side, _) in LAYERS.items():
        weights[f"{name}.weight"] = rng.normal(0, 0.05, (side * side * inputs, outputs)).astype(np.float32)
        weights[f"{name}.bias"] = rng.normal(0, 0.05, outputs).astype(np.float32)
    return weights
