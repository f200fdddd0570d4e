"""Explorations that keep to a polygon."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.errors import ConfigError, StartError
from layoutexplore.frontiers.detection import FrontierClusters
from layoutexplore.grids.grid import Pose
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.episode import start_pose
from layoutexplore.simulation.region import check_region, clusters_inside, read_region, region_mask
from layoutexplore.simulation.simulation import Simulation
from tests.plans import offices

WEST = ((0.0, 0.0), (9.0, 0.0), (9.0, 8.0), (0.0, 8.0))
"""The western half of `offices()`."""


def explored(region: object, seed: int = 1, start: Pose | None = None) -> Simulation:
    config = SimulationConfig(sensor="indoor", region=region)  # type: ignore[arg-type]
    simulation = Simulation(offices(), config)
    decision = simulation.reset(seed, start)
    assert simulation.state.region is not None or region is None
    while not simulation.done:
        if region is not None:
            cells = np.concatenate([frontier.cells for frontier in decision.frontiers])
            assert simulation.state.region[tuple(cells.T)].all()
        decision = simulation.step(0)
    return simulation


@pytest.mark.parametrize("seed", range(3))
def test_what_lies_outside_is_neither_offered_nor_counted(seed: int) -> None:
    inside, everywhere = explored(WEST, seed), explored(None, seed)
    assert inside.stop_reason in ("coverage", "no_frontier") and inside.coverage > 0.9
    mask = region_mask(inside.raster, WEST)
    assert not inside.truth.target[~mask].any()
    assert 0.3 < inside.target_area / everywhere.target_area < 0.7
    assert inside.distance < everywhere.distance
    assert mask[inside.raster.world_to_cell(*inside.track[0, :2])]


def test_a_region_around_everything_changes_nothing() -> None:
    around, none = explored(((-9.0, -9.0), (90.0, -9.0), (90.0, 90.0), (-9.0, 90.0))), explored(None)
    np.testing.assert_array_equal(around.track, none.track)
    np.testing.assert_array_equal(around.curve, none.curve)


def test_starts_lie_inside() -> None:
    with pytest.raises(StartError, match="outside of the region"):
        explored(WEST, start=Pose(15.0, 3.3, 0.0))
    with pytest.raises(StartError, match="fits nowhere in the region"):
        explored(((-9.0, -9.0), (-8.0, -9.0), (-8.0, -8.0)))
    config = SimulationConfig(region=WEST)
    assert all(start_pose(offices(), config, 0, k).x < 9.0 for k in range(8))


@pytest.mark.parametrize("x", [15.0, 90.0])
def test_the_place_that_a_wrong_start_is_told_is_one_to_start_from(x: float) -> None:
    with pytest.raises(StartError, match="the nearest free place is") as told:
        explored(WEST, start=Pose(x, 3.3, 0.0))
    near_x, near_y = map(float, re.findall(r"-?\d+\.\d+", str(told.value))[-2:])
    assert explored(WEST, start=Pose(near_x, near_y, 0.0)).coverage > 0.9


def test_regions_are_checked() -> None:
    assert check_region([[0, 0], [1, 0], (1, 1)]) == ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))
    crossing = [(0, 0), (1, 1), (1, 0), (0, 1)]
    line = [(0, 0), (1, 1), (2, 2)]
    for wrong in (crossing, line, [(0, 0), (1, 1)], "0,0", 3, [(0, 0), (1, 1), (float("nan"), 1)], [1, 2, 3]):
        with pytest.raises(ConfigError, match="region"):
            SimulationConfig(region=wrong)  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match=r"region has 20000 corners.*simplify"):
        check_region([(k, k**2) for k in range(20_000)])


def test_regions_are_read_from_texts_and_files(tmp_path: Path) -> None:
    assert read_region("0,0 9,0 9,8 0,8") == WEST
    ring = [*map(list, WEST), list(WEST[0])]
    polygon = {"type": "Polygon", "coordinates": [ring]}
    file = tmp_path / "west.geojson"
    for data in (
        polygon,
        {"type": "FeatureCollection", "features": [{"type": "Feature", "geometry": polygon}]},
    ):
        if "features" in data:
            data["features"][0]["properties"] = {}  # type: ignore[index]
        file.write_text(json.dumps(data))
        assert set(read_region(str(file))) == set(WEST)
    hole = [[2, 2], [3, 2], [3, 3], [2, 2]]
    for text, said in (
        (json.dumps({"type": "Polygon", "coordinates": [ring, hole]}), "without holes"),
        ('{"type": "Point", "coordinates": [0, 0]}', "got 0 polygons"),
        ("[1, 2", "broken JSON"),
        ('{"type": "Nonsense"}', "no GeoJSON"),
    ):
        file.write_text(text)
        with pytest.raises(ConfigError, match=said):
            read_region(str(file))
    for text in (str(tmp_path / "none.geojson"), "0,0 a,b", "", "1 2 3"):
        with pytest.raises(ConfigError, match="region"):
            read_region(text)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_clusters_keep_their_cells_inside(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mask = rng.random((9, 9)) < 0.4
    clusters = [
        rng.integers(0, 9, (rng.integers(1, 5), 2)).astype(np.int32) for _ in range(rng.integers(0, 6))
    ]
    kept = [cluster[mask[tuple(cluster.T)]] for cluster in clusters]
    expected = FrontierClusters.of([cluster for cluster in kept if len(cluster)])
    found = clusters_inside(FrontierClusters.of(clusters), mask)
    np.testing.assert_array_equal(found.cells, expected.cells)
    np.testing.assert_array_equal(found.offsets, expected.offsets)


def test_results_without_a_region_belong_to_the_same_configuration_as_ever() -> None:
    from layoutexplore.benchmark.config import settings as settings_of

    assert "region" not in settings_of(BenchmarkConfig())["simulation"]
    config = BenchmarkConfig(simulation=SimulationConfig(region=WEST))
    assert settings_of(config)["simulation"]["region"] == WEST
    assert config.config_hash != BenchmarkConfig().config_hash
