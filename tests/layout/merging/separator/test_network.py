"""The separator network as it is run: the same as where it was trained, and what the shipped one says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from layoutexplore.errors import ConfigError
from layoutexplore.layout import limits
from layoutexplore.layout.alignment import turn_labels
from layoutexplore.layout.merging.method import MergingConfig
from layoutexplore.layout.merging.separator.network import (
    BORDER,
    FIRST_PAIR,
    LAYERS,
    NEAR,
    OFFSETS,
    OUTPUTS,
    SeparatorNetwork,
    load_separator,
)
from layoutexplore.layout.merging.separator.planes import DEPTH, KINDS, PATCH
from layoutexplore.layout.merging.walls.aligned_map import align_map
from layoutexplore.layout.timing import StageTimer
from layoutexplore.models.network_files import shapes_of
from tests.layout.merging.cases import plan, rough


def test_it_says_what_the_trained_network_says() -> None:
    torch = pytest.importorskip("torch")
    from layoutexplore.training.separator.network import TrainableSeparator

    torch.manual_seed(3)
    trained = TrainableSeparator()
    with torch.no_grad():
        for _ in range(3):
            trained(torch.rand(4, LAYERS["patch"][0], 16, 16))
    trained.eval()
    values = np.random.default_rng(0).random((2 * DEPTH, 3 * DEPTH, LAYERS["patch"][0]), np.float32)
    with torch.no_grad():
        expected = trained(torch.from_numpy(values).permute(2, 0, 1)[None])[0].permute(1, 2, 0).numpy()
    found = SeparatorNetwork(trained.weights()).forward(values)
    assert found.shape == (4 * DEPTH, 6 * DEPTH, OUTPUTS)
    np.testing.assert_allclose(found, expected, atol=1e-4)


def test_half_a_turn_changes_nothing() -> None:
    rng = np.random.default_rng(0)
    shapes = shapes_of(LAYERS)
    weights = {name: rng.normal(0, 0.2, size).astype(np.float32) for name, size in shapes.items()}
    network, shape = SeparatorNetwork(weights), (2 * DEPTH, 3 * DEPTH, PATCH, PATCH, KINDS)
    values = rng.random(shape, np.float32)
    here = network.agreed(values.reshape(*shape[:2], -1))
    turned = np.ascontiguousarray(values[::-1, ::-1, ::-1, ::-1]).reshape(*shape[:2], -1)
    there = network.agreed(turned)[::-1, ::-1]
    np.testing.assert_allclose(here[..., :FIRST_PAIR], there[..., :FIRST_PAIR], atol=1e-3)
    for k, (up, right) in enumerate(OFFSETS, FIRST_PAIR):
        for row, col in ((0, 20), (7, 33), (4 * DEPTH - 1 - up, 15)):
            assert abs(here[row, col, k] - there[row + up, col + right, k]) < 1e-3, "the same pair"
    alone = network.forward(values.reshape(*shape[:2], -1))
    assert not np.allclose(alone, here, atol=0.01)


def test_the_shipped_one_knows_a_doorway_from_the_middle_of_a_room() -> None:
    cells = plan()
    aligned = align_map(cells, 0.05, MergingConfig(), StageTimer())
    assert not aligned.turned.angle
    given = aligned.turned.cells, aligned.wall, aligned.gaps.gap, 0.05
    odds = load_separator().judge(*given)
    assert np.array_equal(odds, load_separator().judge(*given)), "the same map, the same answer"
    known = np.zeros(cells.shape, np.int32)
    known[54:58, 45:53], known[90:120, 40:70], known[28:40, 60:130] = 1, 2, 3
    squares = turn_labels(known, aligned.turned)[2::4, 2::4]
    found = odds[: squares.shape[0], : squares.shape[1]]
    assert found[squares == 1, BORDER].min() > 0 > found[squares > 1, BORDER].max()
    near = 3 + np.arange(NEAR)
    assert found[squares == 2][:, near].min() > 0, OFFSETS


def test_weights_that_cannot_be_read_are_called_what_they_are(tmp_path: Path) -> None:
    broken = tmp_path / "broken.safetensors"
    broken.write_bytes(b"no weights")
    for path in (tmp_path / "none.safetensors", broken):
        with pytest.raises(ConfigError, match=r"safetensors.*separator network"):
            load_separator(path)


def test_of_a_map_too_large_it_says_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    from layoutexplore.grids.grid import OccupancyGrid
    from layoutexplore.layout.merging.separator import network
    from layoutexplore.layout.pipeline import reconstruct

    assert limits.MOST_PLACES * 0.4**2 > 150 * 150
    grids = [OccupancyGrid(cells, 0.05) for cells in (plan(), rough(plan()))]
    asked = [reconstruct(grid, "default") for grid in grids]
    monkeypatch.setattr(network, "MOST_PLACES", 100)
    # a map with straight walls is not told to it at all
    for grid, before, missed in zip(grids, asked, (False, True), strict=True):
        layout = reconstruct(grid, "default")
        assert any("borders was left out" in warning for warning in layout.warnings) == missed
        assert not any("borders was left out" in warning for warning in before.warnings)
        assert len(layout.rooms) == len(before.rooms) == 3
