"""The classifier of regions outside the building, trained on simulated maps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from layoutexplore.cli import app
from layoutexplore.errors import ConfigError
from layoutexplore.layout.merging.graph_tables import EDGE, NODE, RegionGraph
from layoutexplore.layout.merging.ray_fans.classifier import FAN_FOREST
from layoutexplore.layout.merging.ray_fans.features import RegionFeatures
from layoutexplore.training.folds import Progress
from layoutexplore.training.map_noise import ray_fans
from layoutexplore.training.map_noise.ray_fans import fan_samples, train_fan_forest
from layoutexplore.training.merging_examples import Example

COUNT = len(RegionFeatures._fields)


def example(rooms: list[list[float]], unknown: list[float], noisy: bool = True) -> Example:
    features = np.zeros((len(rooms) + 1, COUNT))
    features[1:, RegionFeatures._fields.index("unknown")] = unknown
    nothing = RegionGraph(
        np.zeros((len(rooms) + 1, len(NODE))),
        np.zeros((0, 2), np.int32),
        np.zeros((0, len(EDGE))),
        np.zeros((len(rooms) + 1, 1)),
        0.05,
    )
    return Example(nothing, features, np.array([[0.0, 0.0], *rooms]), "simulated", "one", noisy=noisy)


def test_pure_and_large_regions_teach_most() -> None:
    features, outside, weights = fan_samples(
        example([[0, 400], [100, 0], [50, 50], [0, 0]], [0.1, 0.9, 0.5, 0.3])
    )
    assert features.shape == (3, COUNT)
    assert outside.tolist() == [0.0, 1.0, 0.5]
    assert weights[0] == pytest.approx(2 * weights[1])
    assert weights[2] == pytest.approx(weights[1] * ray_fans.PURITY / (1 + ray_fans.PURITY))
    *_, clean = fan_samples(example([[0, 400], [100, 0], [50, 50]], [0.1, 0.9, 0.5], noisy=False))
    assert clean == pytest.approx(weights * ray_fans.LIDAR_WEIGHT)


def test_it_learns_what_lies_outside() -> None:
    rng = np.random.default_rng(0)
    maps = []
    for _ in range(12):
        unknown = rng.random(40)
        maps.append(example([[300.0, 0.0] if u > 0.6 else [0.0, 300.0] for u in unknown], unknown.tolist()))
    forest = train_fan_forest(maps)
    odds = forest.score(example([[1, 1], [1, 1]], [0.1, 0.95]).features)
    assert odds[1] < -2 < 2 < odds[2]


def test_maps_without_beams_outside_teach_nothing() -> None:
    with pytest.raises(ConfigError, match="no map"):
        train_fan_forest([])
    with pytest.raises(ConfigError, match="of one kind"):
        train_fan_forest([example([[0, 100], [0, 50]], [0.1, 0.2])])


def test_the_command_writes_a_model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    maps = tuple(
        example([[300.0, 0.0] if u > 0.5 else [0.0, 300.0] for u in unknown], unknown.tolist())
        for unknown in rng.random((8, 40))
    )
    asked = []

    def simulated(count: int, plans: tuple[str, ...], progress: Progress) -> tuple[Example, ...]:
        asked.append((count, plans))
        return maps

    monkeypatch.setattr(ray_fans, "simulated_examples", simulated)
    words = ["evaluate", "train-fans", "--simulated", "8", "--plans", "apartment:0-1"]
    result = CliRunner().invoke(app, [*words, "--out", str(tmp_path / "model.json")])
    assert result.exit_code == 0, result.output
    assert asked == [(8, ("apartment:0", "apartment:1"))]
    assert len(FAN_FOREST.load(tmp_path / "model.json").roots) == ray_fans.FORESTS * ray_fans.GROWTH.trees
