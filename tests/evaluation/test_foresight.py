"""What foresight is worth: ratios of drawn rows by hand, and the command, which goes on where it was."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest
from typer.testing import CliRunner

from layoutexplore import cli
from layoutexplore.benchmark.rows import Row
from layoutexplore.evaluation.foresight import explorer_with, foresight_table, score_foresight
from layoutexplore.maps.geojson import save_plan
from tests.plans import offices

NONE, ALL = "oracle:horizon=0", "oracle:horizon=inf"


def row(agent: str, sensor: str, d95: float, d99: float, reached: bool = True) -> Row:
    return Row(
        plan="a",
        start=0,
        sensor=sensor,
        seed=0,
        agent=agent,
        d95=d95,
        d99=d99,
        reached99=reached,
        ms_decision_median=d95 / 10,
    )


def test_metres_are_those_of_the_reference_in_the_same_cell() -> None:
    rows = [
        row("layout-tour", "stage", 100.0, 200.0),
        row("layout-tour", "indoor", 200.0, 300.0),
        row(explorer_with(NONE), "stage", 90.0, 150.0),
        row(explorer_with(ALL), "stage", 50.0, 120.0),
        row(explorer_with(ALL), "indoor", 100.0, 240.0, reached=False),
    ]
    lines = {(s.sensor, s.predictor): s for s in score_foresight(rows, [NONE, ALL])}
    assert next(iter(lines))[0] == "all sensors"
    assert lines["stage", NONE].d95.estimate == pytest.approx(0.9)
    assert lines["all sensors", ALL].d95.estimate == pytest.approx(0.5)
    assert lines["stage", ALL].d99.estimate == pytest.approx(0.6)
    assert lines["indoor", ALL].reached == 0.0 and lines["indoor", ALL].ms == pytest.approx(10.0)
    assert ("indoor", NONE) not in lines
    assert foresight_table(list(lines.values())).count("\n") == 2 + len(lines)


def test_a_predictor_may_have_several_options() -> None:
    assert explorer_with("oracle:flip=0.5,horizon=1") == "plan-tour:predictor=oracle:flip=0.5;horizon=1"


def test_the_command_goes_on_where_it_was(tmp_path: Path) -> None:
    plan, out = tmp_path / "offices.geojson", tmp_path / "out"
    save_plan(offices(), plan)
    arguments = ["evaluate", "foresight", str(plan), "-s", "indoor", "-p", ALL, "--out", str(out)]
    result = CliRunner().invoke(cli.app, [*arguments, "--jobs", "1"])
    assert result.exit_code == 0, result.output
    lines = list(csv.DictReader((out / "foresight.csv").open(encoding="utf-8")))
    assert [line["predictor"] for line in lines] == [ALL]
    assert 0.3 < float(lines[0]["d99"]) < 1.0
    assert ALL in (out / "foresight.md").read_text(encoding="utf-8")
    before = (out / "runs" / "results.csv").read_bytes()
    assert CliRunner().invoke(cli.app, [*arguments, "-s", "indoor", "--jobs", "1"]).exit_code == 0
    assert (out / "runs" / "results.csv").read_bytes() == before


def test_failed_runs_are_named_and_the_command_says_so(tmp_path: Path) -> None:
    plan, out, own = tmp_path / "offices.geojson", tmp_path / "out", tmp_path / "own.py"
    save_plan(offices(), plan)
    own.write_text(
        "class Fails:\n    def rooms(self, decision):\n        raise ZeroDivisionError('no rooms')\n"
    )
    arguments = ["evaluate", "foresight", str(plan), "-s", "indoor", "-p", f"{own}:Fails", "--out", str(out)]
    result = CliRunner().invoke(cli.app, [*arguments, "--jobs", "1"])
    assert result.exit_code == 1 and isinstance(result.exception, SystemExit), result.output
    said = f"{explorer_with(f'{own}:Fails')}: its only run failed with ZeroDivisionError: no rooms"
    assert "Nothing is compared" in result.output
    assert (out / "foresight.csv").read_text().count("\n") == 1
    assert said in result.output and said in (out / "foresight.md").read_text(encoding="utf-8")
