"""What is warmed up."""

from __future__ import annotations

from functools import partial

import pytest
from typer.testing import CliRunner

from layoutexplore.cli import app
from layoutexplore.cli.warm_up import warm_up_steps
from layoutexplore.layout.merging.walls.raggedness import is_ragged
from layoutexplore.layout.pipeline import LAYOUTS, method_names
from layoutexplore.sensing.lidar import SENSORS


def test_every_method_and_sensor_is_warmed_up() -> None:
    names = {name for name, _ in warm_up_steps()}
    own = {entry.name for entry in LAYOUTS.own()}  # of tests that ran before
    assert {f"layout method {name}" for name in method_names() if name not in own} <= names
    assert {f"sensor {name}" for name in SENSORS} <= names


def test_a_map_with_ragged_walls_is_among_them() -> None:
    step = dict(warm_up_steps())["ragged walls"]
    assert isinstance(step, partial)
    grid = step.keywords["of"]()
    assert is_ragged(grid.cells, grid.resolution)
    assert "borders" not in " ".join(step().warnings)


@pytest.mark.slow
def test_the_command_runs_every_step() -> None:
    done = CliRunner().invoke(app, ["warm-up"])
    assert done.exit_code == 0 and "kept for the next time" in done.output
