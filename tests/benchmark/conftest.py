"""Two small floor plans and a small benchmark on them."""

from __future__ import annotations

from pathlib import Path

import pytest

from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.tracing import floorplan_from_ascii
from tests.plans import HOUSE
from tests.plugins.cases import nothing_stays_registered as nothing_stays_registered


@pytest.fixture(scope="module")
def plans(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with two small floor plans."""
    folder = tmp_path_factory.mktemp("plans")
    for name, scale in (("cottage", 0.6), ("house", 1.0)):
        save_plan(floorplan_from_ascii(HOUSE, resolution=scale, name=name), folder / f"{name}.geojson")
    return folder


@pytest.fixture
def config(plans: Path) -> BenchmarkConfig:
    return BenchmarkConfig(
        plans=(str(plans),), starts=2, sensors=("stage", "indoor"), agents=("nearest", "random")
    )
