"""Fixed suites: their cells do not change, and nothing but agents can be chosen."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest
from typer.testing import CliRunner

from layoutexplore.benchmark.suite import SUITES, Suite, load_suite
from layoutexplore.cli import app
from layoutexplore.errors import ConfigError, UnknownNameError
from layoutexplore.maps import splits
from layoutexplore.sensing.lidar import SENSORS
from layoutexplore.simulation.config import SimulationConfig


@pytest.mark.parametrize("name", list(SUITES))
def test_the_cells_of_a_suite_are_those_that_were_released(name: str) -> None:
    suite = load_suite(name)
    assert suite.hash == SUITES[name]
    assert set(suite.cells["plans"]) == set(splits()["test"])
    assert suite.cells["lidars"]["noisy"]["range_noise_std"] > 0
    assert len({plan.building for plan in suite.plans.values()}) == 8


def test_other_cells_than_released_are_told() -> None:
    v1 = load_suite("v1")
    with pytest.raises(ConfigError, match="make other cells"):
        _ = Suite("v1", v1.options, {**v1.definition, "starts": 2}, v1.released).hash


def test_everything_that_is_defined_enters_the_hash(tmp_path: Path) -> None:
    text = 'plans = ["apartment-01"]\nstarts = 2\n[simulation]\nturn_cost = 0.5\n'
    text += "[poses]\napartment-01 = [[1, 2, 3]]\n"
    hashes = set()
    for old, new in (
        ("", ""),
        ("apartment-01", "hall-01"),
        ("= 2", "= 3"),
        ("0.5", "0.25"),
        (", 3]", ", 1]"),
    ):
        (tmp_path / "mine.toml").write_text(text.replace(old, new) if old else text)
        hashes.add(load_suite(str(tmp_path / "mine.toml")).hash)
    assert len(hashes) == 5


def test_the_presets_of_a_suite_are_written_out() -> None:
    v1 = load_suite("v1")
    for name in ("stage", "indoor"):
        ours, preset = v1.options["lidars"][name], SENSORS[name]
        assert ours == preset
    given = {f.name for f in dataclasses.fields(SimulationConfig)}
    assert set(v1.definition["simulation"]) <= given


def test_only_agents_can_be_chosen(tmp_path: Path) -> None:
    suite = load_suite("v1")
    assert suite.config(("tour",)).agents == ("nearest", "tour")
    assert suite.config(("tour", "nearest")).agents == ("tour", "nearest")
    with pytest.raises(ConfigError, match="suite v1 decides starts"):
        suite.config(("tour",), starts=1)
    with pytest.raises(UnknownNameError, match="did you mean 'v1'"):
        load_suite("v11")
    (tmp_path / "mine.toml").write_text('plans = ["office-01"]\nagents = ["tour"]\n')
    with pytest.raises(ConfigError, match="decides agents"):
        load_suite(str(tmp_path / "mine.toml"))
    done = CliRunner().invoke(
        app, ["benchmark", "--suite", "v1", "--starts", "1", "--out", str(tmp_path / "out")]
    )
    assert isinstance(done.exception, ConfigError) and not (tmp_path / "out").exists()
