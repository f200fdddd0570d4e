"""The README: its Python runs, its commands parse; the tables of the pages are those of the code."""

from __future__ import annotations

import math
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
import typer

from layoutexplore import cli
from layoutexplore.agents import agent_names, describe_agents
from layoutexplore.agents.base import AGENTS
from layoutexplore.benchmark.config import BenchmarkConfig, read_benchmark_config
from layoutexplore.documentation.site import PAGES
from layoutexplore.grids.grid import Pose
from layoutexplore.maps.floorplan import FloorPlan
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.sensing.lidar import SENSORS
from layoutexplore.simulation.config import SimulationConfig
from layoutexplore.simulation.simulation import Simulation
from tests.test_architecture import FLOORS, ROOT

README = (ROOT / "README.md").read_text()
STRATEGIES = (PAGES / "concepts" / "strategies.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


def commands() -> list[str]:
    """Every call of `layoutexplore` in the README: continued lines joined, comments and loops taken off."""
    lines = "".join(blocks("bash")).replace("\\\n", " ").splitlines()
    quoted = re.findall(r"`(layoutexplore [a-z][^`\n]*(?:\n[^`\n]+)?)`", README)
    calls = [part for line in lines for part in re.split(r"&&|;", line.partition(" #")[0])]
    found = [
        call[call.index("layoutexplore ") :] for call in calls if re.match(r"\s*(\S+/)?layoutexplore ", call)
    ]
    return sorted({" ".join(call.split()) for call in (*found, *quoted)})


def parse(words: list[str]) -> None:
    """What the command line does before a command runs: it finds the command and reads its options."""
    command = typer.main.get_command(cli.app)
    context = command.context_class(command, info_name="layoutexplore")
    while hasattr(command, "commands"):
        name, command, words = command.resolve_command(context, words)
        context = command.context_class(command, info_name=name, parent=context)
    command.make_parser(context).parse_args(words)


def hall(side: int) -> FloorPlan:
    """An empty square hall, a letter a metre."""
    wall, middle = "#" * (side + 2), "\n".join("#" + "a" * side + "#" for _ in range(side))
    return floorplan_from_ascii(f"{wall}\n{middle}\n{wall}", resolution=1.0, name="hall")


@pytest.mark.parametrize("sensor", SENSORS)
def test_what_is_seen_lies_within_the_documented_range(sensor: str) -> None:
    documented = re.search(rf"\| `{sensor}` \| (\d+)° \| (\d+) m \|", STRATEGIES)
    assert documented, f"nothing is said of the sensor {sensor}"
    range_max = float(documented[2])
    config = SimulationConfig(sensor=sensor, resolution=0.2)
    assert range_max == config.lidar.range_max
    assert float(documented[1]) == pytest.approx(math.degrees(config.lidar.fov))
    plan = hall(70)
    simulation = Simulation(plan, config)
    centre = plan.rooms[0].polygon.centroid
    decision = simulation.reset(start=Pose(centre.x, centre.y, 0.3))
    known = decision.grid.cells_to_world(np.argwhere(decision.grid.cells >= 0))
    away = np.hypot(known[:, 0] - decision.pose.x, known[:, 1] - decision.pose.y)
    assert away.max() <= range_max + 2 * config.resolution
    reach = min(range_max, 35.0)
    assert away.max() >= reach - 2 * config.resolution, "the documented range is not reached either"


def test_every_agent_and_sensor_is_named() -> None:
    own = {entry.name for entry in AGENTS.own()}  # of tests and examples that ran before
    shipped = [name for name in agent_names() if name not in own]
    assert len(shipped) >= 25
    assert [name for name in (*shipped, *SENSORS) if f"| `{name}` |" not in STRATEGIES] == []


def test_strategies_without_parameters_are_told() -> None:
    own = {entry.name for entry in AGENTS.own()}
    without = [f"`{it.name}`" for it in describe_agents() if not it.parameters and it.name not in own]
    assert f"All but {' and '.join(without)} take parameters" in STRATEGIES


def test_the_readme_opens_with_the_two_commands() -> None:
    first, second = re.findall(r"^python3\.11 .*$", README, re.MULTILINE)[:2]
    assert first.endswith("pip install -q '.[bench]' && .venv/bin/layoutexplore benchmark")
    assert second.endswith("pip install -q -e '.[all,test]' -c tests/constraints.txt && .venv/bin/pytest -q")


@pytest.mark.parametrize("block", blocks("python"), ids=["gymnasium", "layout"])
def test_the_readme_runs(block: str, capsys: pytest.CaptureFixture[str]) -> None:
    exec(compile(block, "README.md", "exec"), {})
    assert capsys.readouterr().out


def test_commands_of_the_readme_are_found() -> None:
    """The list that the next test goes through is not empty, and knows a wrong option from a right one."""
    assert len(commands()) >= 5
    with pytest.raises(Exception, match="No such option: --sead"):
        parse(["maps", "generate", "school", "--sead", "3"])
    with pytest.raises(Exception, match="No such command 'explroe'"):
        parse(["explroe"])


@pytest.mark.parametrize("command", commands())
def test_commands_of_the_readme_parse(command: str) -> None:
    parse([word for word in shlex.split(command)[1:] if word != "..."])


def test_the_documented_configuration_is_read(tmp_path: Path) -> None:
    page = (PAGES / "how-to" / "benchmark.md").read_text()
    (tmp_path / "study.toml").write_text(re.findall(r"```toml[^\n]*\n(.*?)```", page, re.DOTALL)[0])
    config = BenchmarkConfig(**read_benchmark_config(tmp_path / "study.toml"))
    assert config.simulation_with("noisy").lidar.beams == 360


def test_the_readme_is_short_and_its_links_lead_somewhere() -> None:
    assert len(README.splitlines()) <= 110
    links = re.findall(r"\]\(((?!http)[^)#]+)\)", README)
    assert len(links) >= 15 and [link for link in links if not (ROOT / link).exists()] == []


def test_folders_stand_in_the_order_of_their_floors() -> None:
    page = (PAGES / "reference" / "code.md").read_text()
    rows = re.findall(r"^\| `([\w/]+)/` \| .+ \|$", page, re.MULTILINE)
    rooms = {p.parent.name for p in (ROOT / "layoutexplore").glob("*/__init__.py")} | {
        "envs",
        "agents",
        "maps",
    }
    assert sorted(rows) == sorted(rooms)
    assert [FLOORS[room] for room in rows] == sorted((FLOORS[room] for room in rows), reverse=True)
