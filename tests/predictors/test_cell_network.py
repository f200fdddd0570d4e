"""The network that completes rooms: its planes, its numpy form against torch, its files, and that training changes it."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
import safetensors.numpy
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from layoutexplore.errors import ConfigError
from layoutexplore.models.network_files import load_weights, save_weights, shapes_of
from layoutexplore.predictors.cell_model.features import FEATURES, find_candidates
from layoutexplore.predictors.cell_model.network import LAYERS, RoomNetwork
from layoutexplore.predictors.cell_model.network_input import (
    PLANES,
    SHOWN,
    Scene,
    draw_planes,
    make_scene,
    turned,
)
from layoutexplore.predictors.seen_rooms import seen_regions

GRIDS = hnp.arrays(
    np.int8,
    st.tuples(st.integers(6, 40), st.integers(6, 40)),
    elements=st.sampled_from([-1, -1, 0, 0, 0, 100]),
)


def scene_of(cells: NDArray[np.int8]) -> Scene:
    regions = seen_regions(cells, 0.1)
    return make_scene(cells, regions, find_candidates(cells, regions, 0.1), 0.1)


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


@settings(max_examples=40, deadline=None)
@given(cells=GRIDS)
def test_planes_show_what_is_asked(cells: NDArray[np.int8]) -> None:
    scene = scene_of(cells)
    if len(scene.squares) == 0:
        return
    planes = draw_planes(scene)
    assert planes.values.shape[2] == PLANES and np.isfinite(planes.values).all()
    assert planes.asked.tolist() == list(range(len(scene.squares)))
    for rank in range(2):
        first = 6 + rank * (SHOWN + 5)
        asked = planes.values[..., first + SHOWN] > 0
        expected = np.zeros(asked.shape, np.bool_)
        mine = scene.rank == rank
        expected[scene.squares[mine, 0] - planes.row, scene.squares[mine, 1] - planes.col] = True
        np.testing.assert_array_equal(asked, expected)
        assert not planes.values[~asked, first : first + SHOWN].any()
    np.testing.assert_allclose(planes.values[..., :3].sum(axis=2).max(), 1.0, atol=0.002)


@settings(max_examples=20, deadline=None)
@given(cells=GRIDS, way=st.integers(0, 7))
def test_a_turned_scene_is_that_of_the_turned_map(cells: NDArray[np.int8], way: int) -> None:
    """But for what breaks ties by where the map lies: the shares of the squares and who asks where, on whole squares."""
    cells = np.kron(cells, np.ones((3, 3), np.int8))
    other = cells[::-1] if way & 1 else cells
    other = other[:, ::-1] if way & 2 else other
    other = np.ascontiguousarray(other.T if way & 4 else other)
    expected, found = scene_of(other), turned(scene_of(cells), way)
    np.testing.assert_allclose(found.bits[[0, 1, 2, 4, 5]], expected.bits[[0, 1, 2, 4, 5]], atol=1e-3)
    squares = [
        {tuple(square) for square in scene.squares[scene.rank == 0].tolist()} for scene in (found, expected)
    ]
    assert squares[0] == squares[1]


def test_a_window_shows_what_lies_in_it() -> None:
    scene = scene_of(half_seen())
    whole, part = draw_planes(scene), draw_planes(scene, (5, 8), 9)
    assert part.values.shape == (9, 9, PLANES) and (part.row, part.col) == (5, 8)
    inside = ((scene.squares >= (5, 8)) & (scene.squares < (14, 17))).all(axis=1)
    assert part.asked.tolist() == np.flatnonzero(inside).tolist()
    row, col = 5 - whole.row, 8 - whole.col
    shown = whole.values[row : row + 9, col : col + 9, 6 : 6 + SHOWN]
    np.testing.assert_array_equal(part.values[..., 6 : 6 + SHOWN], shown)
    nothing = draw_planes(scene, (5, 4), 3)
    assert len(nothing.asked) == 0 and not nothing.values[..., 6 + SHOWN].any(), (
        "where all is known nothing is asked"
    )


def test_torch_and_numpy_agree() -> None:
    torch = pytest.importorskip("torch")
    from layoutexplore.training.cell_network import TrainableNetwork

    torch.manual_seed(0)
    network = TrainableNetwork().eval()
    for layer in network.layers.values():
        layer.norm.running_mean.normal_()
        layer.norm.running_var.uniform_(0.5, 2.0)
    scene = scene_of(half_seen())
    planes = draw_planes(scene)
    with torch.no_grad():
        odds = network(torch.from_numpy(planes.values).permute(2, 0, 1)[None])[0].numpy()
    expected = odds[scene.rank, scene.squares[:, 0] - planes.row, scene.squares[:, 1] - planes.col]
    np.testing.assert_allclose(RoomNetwork(network.weights()).judge(scene), expected, atol=1e-4)


def test_a_network_survives_its_file(tmp_path: Path) -> None:
    weights, scene = random_weights(1), scene_of(half_seen())
    path = tmp_path / "rooms.safetensors"

    def odds() -> NDArray[np.float32]:
        return RoomNetwork(load_weights(path, shapes_of(LAYERS))).judge(scene)

    save_weights(path, {name: values.astype(np.float16) for name, values in weights.items()}, "a test")
    np.testing.assert_allclose(odds(), RoomNetwork(weights).judge(scene), rtol=0.02, atol=0.02)
    kept, others = load_weights(path, shapes_of(LAYERS)), random_weights(2)
    assert load_weights(path, shapes_of(LAYERS)) is kept
    save_weights(path, others, "another test")
    os.utime(path, ns=(0, path.stat().st_mtime_ns + 1))
    np.testing.assert_array_equal(odds(), RoomNetwork(others).judge(scene))


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
    assert len(RoomNetwork(random_weights(0)).judge(empty)) == 0 and empty.features.shape == (
        0,
        len(FEATURES),
    )


def test_training_learns_a_half_seen_room() -> None:
    pytest.importorskip("torch")
    from layoutexplore.training.cell_network import NetworkConfig, first_network, trained_network
    from layoutexplore.training.predictor_samples import SceneSample

    scene = scene_of(half_seen())
    inside = (scene.squares[:, 1] < 25) & (scene.squares[:, 0] > 3) & (scene.squares[:, 0] < 17)
    sample = SceneSample(scene, inside, "a")
    config = NetworkConfig(first_steps=40, steps=40, batch=4, window=24)
    told: list[tuple[int, int, float]] = []
    first = first_network([sample], config, lambda *args: told.append(args))
    weights = trained_network(first, [sample], [sample], config, lambda *args: told.append(args))
    odds = RoomNetwork(weights).judge(scene)
    assert ((odds > 0) == inside).mean() > 0.9
    assert told[39][:2] == (40, 40) and len(told) == 80 and told[-1][2] < told[0][2]
    again = trained_network(first, [sample], [sample], config, lambda *_: None)
    assert all(np.array_equal(weights[name], again[name]) for name in weights), (
        "the same seed, the same network"
    )
