"""The README: its Python runs, its commands parse, its tables are those of the code."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from layoutexplore.agents import agent_names
from layoutexplore.benchmark.config import BenchmarkConfig, read_config
from layoutexplore.grids.grid import Pose
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.sensing.lidar import SENSORS
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.simulation import Simulation

README = (Path(__file__).parents[1] / "README.md").read_text()


def hall(side: int) -> FloorPlan:
    """An empty square hall, a letter a metre."""
    middle = "\n".join("#" + "a" * side + "#" for _ in range(side))
    return floorplan_from_ascii(
        f"{'#' * (side + 2)}\n{middle}\n{'#' * (side + 2)}", resolution=1.0, name="hall"
    )


@pytest.mark.parametrize("sensor", SENSORS)
def test_what_is_seen_lies_within_the_documented_range(sensor: str) -> None:
    documented = re.search(rf"\| `{sensor}` \| (\d+)° \| (\d+) m \|", README)
    assert documented, f"the README says nothing of the sensor {sensor}"
    range_max = float(documented[2])
    config = SimulationConfig(sensor=sensor, resolution=0.2)
    assert range_max == config.lidar.range_max and float(documented[1]) == pytest.approx(
        math.degrees(config.lidar.fov)
    )
    plan = hall(70)
    simulation = Simulation(plan, config)
    x, y = (plan.rooms[0].polygon.centroid.x, plan.rooms[0].polygon.centroid.y)
    decision = simulation.reset(start=Pose(x, y, 0.3))
    known = decision.grid.cells_to_world(np.argwhere(decision.grid.cells >= 0))
    away = np.hypot(known[:, 0] - decision.pose.x, known[:, 1] - decision.pose.y)
    assert away.max() <= range_max + 2 * config.resolution
    reach = min(range_max, 35.0)
    assert away.max() >= reach - 2 * config.resolution, "the documented range is not reached either"


def test_the_readme_names_every_agent_and_sensor() -> None:
    assert [name for name in (*agent_names(), *SENSORS) if f"| `{name}` |" not in README] == []


def test_the_readme_opens_with_the_two_commands() -> None:
    first, second = re.findall(r"^python3\.11 .*$", README, re.MULTILINE)[:2]
    assert first.endswith("pip install -q '.[bench]' && .venv/bin/layoutexplore benchmark")
    assert second.endswith("pip install -q -e '.[all,test]' -c tests/constraints.txt && .venv/bin/pytest -q")


@pytest.mark.parametrize(
    "block",
    re.findall(r"```python\n(.*?)```", README, re.DOTALL),
    ids=["gymnasium", "simulation", "vector", "layout"],
)
def test_the_readme_runs(block: str, capsys: pytest.CaptureFixture[str]) -> None:
    exec(compile(block, "README.md", "exec"), {})
    assert capsys.readouterr().out


def test_the_readme_configuration_is_read(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(re.findall(r"```toml\n(.*?)```", README, re.DOTALL)[0])
    assert BenchmarkConfig(**read_config(tmp_path / "study.toml")).simulation_with("noisy").lidar.beams == 360
