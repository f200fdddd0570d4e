"""The network that completes rooms: its numpy form against torch, and its files."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
import safetensors.numpy
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError
from layoutexplore.models.network_files import load_weights, save_weights, shapes_of
from layoutexplore.predictors.cell_model.features import FEATURES
from layoutexplore.predictors.cell_model.network import LAYERS, CellNetwork
from layoutexplore.predictors.cell_model.network_input import draw_planes
from tests.predictors.cell_model.cases import half_seen, random_weights, scene_of


def test_torch_and_numpy_agree() -> None:
    torch = pytest.importorskip("torch")
    from layoutexplore.training.cell_network import TrainableCellNetwork

    torch.manual_seed(0)
    network = TrainableCellNetwork().eval()
    for layer in network.layers.values():
        layer.norm.running_mean.normal_()
        layer.norm.running_var.uniform_(0.5, 2.0)
    scene = scene_of(half_seen())
    planes = draw_planes(scene)
    with torch.no_grad():
        odds = network(torch.from_numpy(planes.values).permute(2, 0, 1)[None])[0].numpy()
    expected = odds[
        scene.rank, scene.lattice_cells[:, 0] - planes.row, scene.lattice_cells[:, 1] - planes.col
    ]
    np.testing.assert_allclose(CellNetwork(network.weights()).score(scene), expected, atol=1e-4)


def test_a_network_survives_its_file(tmp_path: Path) -> None:
    weights, scene = random_weights(1), scene_of(half_seen())
    path = tmp_path / "rooms.safetensors"

    def odds() -> NDArray[np.float32]:
        return CellNetwork(load_weights(path, shapes_of(LAYERS))).score(scene)

    save_weights(path, {name: values.astype(np.float16) for name, values in weights.items()}, "a test")
    np.testing.assert_allclose(odds(), CellNetwork(weights).score(scene), rtol=0.02, atol=0.02)
    kept, others = load_weights(path, shapes_of(LAYERS)), random_weights(2)
    assert load_weights(path, shapes_of(LAYERS)) is kept
    save_weights(path, others, "another test")
    os.utime(path, ns=(0, path.stat().st_mtime_ns + 1))
    np.testing.assert_array_equal(odds(), CellNetwork(others).score(scene))


@pytest.mark.parametrize("harm", ["text", "cut", "missing", "shape", "nan"])
def test_files_that_are_no_network(harm: str, tmp_path: Path) -> None:
    path, weights = tmp_path / "rooms.safetensors", random_weights(2)
    if harm == "missing":
        del weights["at_half.bias"]
    elif harm == "shape":
        weights["judge.bias"] = np.zeros(3, np.float32)
    elif harm == "nan":
        weights["judge.bias"][0] = np.nan
    data = b"text" if harm == "text" else safetensors.numpy.save(weights)
    path.write_bytes(data[: len(data) // 2] if harm == "cut" else data)
    with pytest.raises(ConfigError, match=r"rooms\.safetensors"):
        load_weights(path, shapes_of(LAYERS))


def test_nothing_to_judge() -> None:
    empty = scene_of(np.full((9, 9), 100, np.int8))
    assert len(CellNetwork(random_weights(0)).score(empty)) == 0 and empty.features.shape == (
        0,
        len(FEATURES),
    )
