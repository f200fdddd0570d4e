"""Robustness: each level beside the noiseless runs of the same strategy, and the command with its page."""

from __future__ import annotations

import csv
import dataclasses
import math
from pathlib import Path

import pytest
from typer.testing import CliRunner

from layoutexplore import cli
from layoutexplore.benchmark.analysis import failed_runs
from layoutexplore.benchmark.rows import NAN, Row
from layoutexplore.errors import UnknownNameError
from layoutexplore.evaluation.robustness import LEVELS, agents_under_noise, chosen_levels
from layoutexplore.maps.geojson import save_plan
from tests.plans import offices


def row(agent: str, d95: float, reached: bool = True) -> Row:
    cell = {"plan": "a", "start": 0, "sensor": "stage", "seed": 0}
    return Row(**cell, agent=agent, d90=d95, d95=d95, d99=2 * d95, reached99=reached)


def test_a_strategy_is_compared_with_itself_and_with_nearest() -> None:
    rows = {
        "none": [row("nearest", 100.0), row("tour", 80.0)],
        "high": [row("nearest", 200.0), row("tour", 120.0, reached=False)],
    }
    lines = {(line.agent, line.level): line for line in agents_under_noise(rows)}
    assert set(lines) == {(agent, level) for agent in ("nearest", "tour") for level in rows}
    high = lines["tour", "high"]
    assert high.d95.estimate == pytest.approx(1.5) and high.d99.estimate == pytest.approx(1.5)
    assert high.to_baseline and high.to_baseline.estimate == pytest.approx(0.6)
    assert high.reached == 0.0 and lines["tour", "none"].reached == 1.0
    assert lines["nearest", "high"].d95.estimate == pytest.approx(2.0)
    assert lines["tour", "none"].d95.estimate == pytest.approx(1.0)


def test_a_strategy_that_fails_without_noise_has_no_ratio() -> None:
    failed = dataclasses.replace(row("tour", 1.0), d90=NAN, d95=NAN, d99=NAN, error="Boom: no drift")
    rows = {"none": [row("nearest", 100.0), failed], "high": [row("nearest", 200.0), row("tour", 120.0)]}
    lines = {(line.agent, line.level): line for line in agents_under_noise(rows)}
    assert set(lines) == {("nearest", "none"), ("nearest", "high"), ("tour", "high")}
    tour = lines["tour", "high"]
    assert math.isnan(tour.d95.estimate) and math.isnan(tour.d99.estimate) and tour.reached == 1.0
    assert tour.to_baseline and tour.to_baseline.estimate == pytest.approx(0.6)
    assert [str(line) for line in failed_runs(rows["none"])] == [
        "tour: its only run failed with Boom: no drift"
    ]
    assert str(failed_runs([failed] * 2)[0]) == "tour: all 2 runs failed, first with Boom: no drift"


def test_failed_runs_are_named_and_the_command_says_so(tmp_path: Path) -> None:
    plan, out, own = tmp_path / "offices.geojson", tmp_path / "out", tmp_path / "own.py"
    save_plan(offices(), plan)
    own.write_text(
        "class Fails:\n    def reset(self, seed):\n        pass\n"
        "    def act(self, decision):\n        raise ZeroDivisionError('no drift')\n"
    )
    arguments = ["evaluate", "robustness", str(plan), "--out", str(out), "-s", "indoor", "--jobs", "1"]
    arguments += ["--agents", f"{own}:Fails", "--level", "low", "--agents-only"]
    result = CliRunner().invoke(cli.app, [*arguments, "--agents", "nearest"])
    assert result.exit_code == 1 and isinstance(result.exception, SystemExit), result.output
    for level in ("none", "low"):
        assert f"failed: level {level}, {own}:Fails: its only run failed" in result.output
    page = (out / "robustness.html").read_text(encoding="utf-8")
    assert "Failed runs" in page and page.count("no drift") == 2 and page.count("<td>all 1</td>") == 2
    assert len((out / "agents.csv").read_text().splitlines()) == 1 + 2  # nearest alone
    result = CliRunner().invoke(cli.app, arguments)
    assert result.exit_code == 1 and "no run ended well: agents.csv has no line" in result.output
    assert (out / "agents.csv").read_text().count("\n") == 1


def test_the_command_writes_a_page_and_goes_on(tmp_path: Path) -> None:
    plan, out = tmp_path / "offices.geojson", tmp_path / "out"
    save_plan(offices(), plan)
    arguments = ["evaluate", "robustness", str(plan), "--out", str(out), "-s", "indoor", "--jobs", "1"]
    arguments += ["--agents", "nearest", "-p", "hull"]
    result = CliRunner().invoke(cli.app, arguments)
    assert result.exit_code == 0, result.output
    lines = list(csv.DictReader((out / "agents.csv").open(encoding="utf-8")))
    assert [line["level"] for line in lines] == list(LEVELS)
    assert all(0.3 < float(line["d95"]) < 3.0 for line in lines) and float(lines[0]["d95"]) == 1.0
    asked = list(csv.DictReader((out / "predictors.csv").open(encoding="utf-8")))
    assert {(line["predictor"], line["level"]) for line in asked} == {("hull", level) for level in LEVELS}
    page = (out / "robustness.html").read_text(encoding="utf-8")
    assert all(f">{level}<" in page for level in LEVELS)
    results = [(out / f"runs-{level}" / "results.csv").read_bytes() for level in LEVELS]
    assert CliRunner().invoke(cli.app, arguments).exit_code == 0
    assert [(out / f"runs-{level}" / "results.csv").read_bytes() for level in LEVELS] == results
    result = CliRunner().invoke(cli.app, [*arguments, "--level", "low", "--agents-only"])
    assert result.exit_code == 0 and "of 1 " in result.output, result.output
    lines = list(csv.DictReader((out / "agents.csv").open(encoding="utf-8")))
    assert [line["level"] for line in lines] == ["none", "low"]
    assert len((out / "predictors.csv").read_text().splitlines()) == 1  # the names of the columns


def test_levels_are_chosen_by_name() -> None:
    assert chosen_levels(None) == LEVELS
    assert chosen_levels(["middle", "low"]) == ("none", "low", "middle")
    with pytest.raises(UnknownNameError, match="did you mean 'middle'"):
        chosen_levels(["midle"])
