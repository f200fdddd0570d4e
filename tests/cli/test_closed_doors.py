"""The command that predicts rooms behind closed doors."""

from __future__ import annotations

import json
from pathlib import Path

from typer.testing import CliRunner

from layoutexplore.cli import app


def test_command(closed_door_maps: Path, tmp_path: Path) -> None:
    out, report = tmp_path / "out", tmp_path / "numbers.json"
    arguments = [
        "evaluate",
        "closed-doors",
        str(closed_door_maps),
        "--out",
        str(out),
        "--json",
        str(report),
        "--no-report",
    ]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    assert {p.name for p in out.iterdir()} == {"office_1_doors_pred.png", "office_2_doors_pred.png"}
    assert len(json.loads(report.read_text())["maps"]) == 2
