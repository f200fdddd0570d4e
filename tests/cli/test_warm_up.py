"""What is warmed up."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

from layoutexplore.cli import app
from layoutexplore.cli.warm_up import warm_up_steps
from layoutexplore.layout.pipeline import method_names
from layoutexplore.sensing.lidar import SENSORS


def test_every_method_and_sensor_is_warmed_up() -> None:
    names = {name for name, _ in warm_up_steps()}
    assert {f"layout method {name}" for name in method_names()} <= names
    assert {f"sensor {name}" for name in SENSORS} <= names


@pytest.mark.slow
def test_the_command_runs_every_step() -> None:
    done = CliRunner().invoke(app, ["warm-up"])
    assert done.exit_code == 0 and "kept for the next time" in done.output
