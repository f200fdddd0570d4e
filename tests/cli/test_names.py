"""The commands that list what there is."""

from __future__ import annotations

import json
from typing import Any

import pytest
from typer.testing import CliRunner

from layoutexplore.agents import agent_names
from layoutexplore.cli import app
from layoutexplore.layout.pipeline import method_names
from layoutexplore.predictors import predictor_names

NAMES = {"agents": agent_names, "predictors": predictor_names, "methods": method_names}


@pytest.mark.parametrize("command", NAMES)
def test_everything_is_listed(command: str) -> None:
    rows = json.loads(CliRunner().invoke(app, [command, "--json"]).output)
    assert {row["name"] for row in rows} == set(NAMES[command]()) and all(row["summary"] for row in rows)
    table = CliRunner().invoke(app, [command], env={"COLUMNS": "200"})
    assert table.exit_code == 0 and all(row["name"] in table.output for row in rows)


def test_parameters_have_defaults_and_meanings() -> None:
    rows: list[dict[str, Any]] = json.loads(CliRunner().invoke(app, ["agents", "--json"]).output)
    (nearest,) = [row for row in rows if row["name"] == "nearest"]
    assert nearest["parameters"][0]["name"] == "min_size" and nearest["parameters"][0]["default"] == "1"
    assert all(p["meaning"] for row in rows for p in row["parameters"])
