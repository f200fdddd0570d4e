"""Predictors in the loop: scores and metres meet in one line; the command writes a page from its folder."""

from __future__ import annotations

import csv
import dataclasses
import math
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from layoutexplore import cli
from layoutexplore.benchmark.rows import NAN, Row
from layoutexplore.benchmark.runner import Outcome
from layoutexplore.cli import benchmark
from layoutexplore.evaluation.in_the_loop import BASELINE, driver_of, score_in_the_loop
from layoutexplore.evaluation.partial_rooms_summary import FrontierLine, PredictorSummary, RoomLine
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.tracing import floorplan_from_ascii
from tests.plans import offices

PREDICTORS = ("none", "reconstruct:rose2")


def part(mcc: float) -> PredictorSummary:
    of_rooms = dict.fromkeys((field.name for field in dataclasses.fields(RoomLine)), NAN)
    of_rooms |= {"rooms": 1, "hidden_iou": 0.5, "hidden_low": 0.4, "hidden_high": 0.6}
    of_frontiers = dict.fromkeys((field.name for field in dataclasses.fields(FrontierLine)), NAN)
    of_frontiers |= {"frontiers": 1, "mcc": mcc, "leftover_accuracy": 0.9}
    rooms: Any = {**of_rooms, "explored": "all"}
    frontiers: Any = {**of_frontiers, "coverage": "all"}
    return PredictorSummary([RoomLine(**rooms)], [FrontierLine(**frontiers)], 3.0)


def row(plan: str, agent: str, d95: float) -> Row:
    return Row(
        plan=plan, start=0, sensor="stage", agent=agent, seed=0, d90=d95, d95=d95, d99=2 * d95, reached99=True
    )


def test_every_predictor_has_the_metres_of_its_own_driver() -> None:
    rows = []
    for plan in ("a", "b"):
        rows.append(row(plan, BASELINE, 100.0))
        rows.append(row(plan, driver_of("none"), 120.0))
        rows.append(row(plan, driver_of("layout"), 80.0))
    found = score_in_the_loop({"none": part(0.0), "oracle": part(1.0), "layout": part(0.8)}, rows)
    assert [line.predictor for line in found] == ["layout", "none", "oracle"]  # what did not run comes last
    layout, none, oracle = found
    assert layout.d95 and layout.d95.estimate == pytest.approx(0.8) and layout.mcc == 0.8
    assert none.d99 and none.d99.estimate == pytest.approx(1.2) and none.hidden_iou.low == 0.4
    assert oracle.d95 is None and oracle.reached is None


def test_a_predictor_without_rooms_to_judge_has_no_scores() -> None:
    (line,) = score_in_the_loop({"none": PredictorSummary([], [], 1.0)}, [])
    assert math.isnan(line.mcc) and math.isnan(line.hidden_iou.estimate) and line.d95 is None


def test_a_plan_that_one_look_shows_is_judged_by_nobody(tmp_path: Path) -> None:
    plan = tmp_path / "closet.geojson"
    save_plan(floorplan_from_ascii("#####\n#...#\n#...#\n#####", 0.5, name="closet"), plan)
    arguments = [str(plan), "--out", str(tmp_path / "out"), "-s", "indoor", "--jobs", "1", "-p", "none"]
    result = CliRunner().invoke(cli.app, ["evaluate", "in-the-loop", *arguments])
    assert result.exit_code == 0, result.output
    (line,) = (line for line in result.output.splitlines() if line.startswith("none "))
    assert line.split() == ["none", *"––––", "1.00", "1.00"]


def test_the_command_writes_a_page_and_goes_on(tmp_path: Path) -> None:
    plan, out = tmp_path / "offices.geojson", tmp_path / "out"
    save_plan(offices(), plan)
    arguments = ["evaluate", "in-the-loop", str(plan), "--out", str(out), "--starts", "1", "-s", "indoor"]
    arguments += ["--jobs", "1", *(part for name in PREDICTORS for part in ("-p", name))]
    result = CliRunner().invoke(cli.app, arguments)
    assert result.exit_code == 0, result.output
    page = (out / "in-the-loop.html").read_text(encoding="utf-8")
    lines = list(csv.DictReader((out / "in-the-loop.csv").open(encoding="utf-8")))
    assert {line["predictor"] for line in lines} == set(PREDICTORS)
    assert all(0.3 < float(line["d95"]) < 3.0 and 0.0 <= float(line["leftover"]) <= 1.0 for line in lines)
    assert all(name in page for name in PREDICTORS) and page.count("<img") == 3 * len(PREDICTORS)
    assert len(list((out / "pictures").glob("*.png"))) == 3 * len(PREDICTORS)
    results = (out / "runs" / "results.csv").read_bytes()
    assert results.count(b"\n") == 1 + 1 + len(PREDICTORS)
    again = CliRunner().invoke(cli.app, arguments)
    assert (
        again.exit_code == 0 and (out / "runs" / "results.csv").read_bytes() == results
    )  # no run was repeated


def test_predictors_with_several_options_or_a_name_of_their_own_drive(tmp_path: Path) -> None:
    plan, out, own = tmp_path / "offices.geojson", tmp_path / "out", tmp_path / "own.py"
    save_plan(offices(), plan)
    own.write_text(
        "class Mine:\n    name = 'mine'\n"
        "    def rooms(self, decision):\n        return (decision.grid.cells == 0).astype(int)\n"
    )
    specs = ["oracle:flip=0.5,horizon=1", f"{own}:Mine"]
    arguments = [str(plan), "--out", str(out), "--starts", "1", "-s", "indoor", "--jobs", "1"]
    result = CliRunner().invoke(
        cli.app, ["evaluate", "in-the-loop", *arguments, *(f"--predictor={spec}" for spec in specs)]
    )
    assert result.exit_code == 0, result.output
    lines = {line["predictor"]: line for line in csv.DictReader((out / "in-the-loop.csv").open())}
    assert set(lines) == set(specs) and all(float(line["d95"]) > 0 for line in lines.values())


def test_failed_runs_are_named_and_the_command_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, out = tmp_path / "offices.geojson", tmp_path / "out"
    save_plan(offices(), plan)
    explore = benchmark.run_with_progress

    def failing(*arguments: Any, **options: Any) -> Outcome:
        outcome = explore(*arguments, **options)
        rows = [
            dataclasses.replace(row, d90=NAN, d95=NAN, d99=NAN, error="Boom: no map") for row in outcome.rows
        ]
        return dataclasses.replace(outcome, rows=rows, asked=rows)

    monkeypatch.setattr(benchmark, "run_with_progress", failing)
    arguments = ["evaluate", "in-the-loop", str(plan), "--out", str(out), "--starts", "1", "-s", "indoor"]
    result = CliRunner().invoke(cli.app, [*arguments, "--jobs", "1", "-p", "none"])
    assert result.exit_code == 1 and isinstance(result.exception, SystemExit), result.output
    page = (out / "in-the-loop.html").read_text(encoding="utf-8")
    assert page.count("Boom: no map") == 2 and page.count("<td>all 1</td>") == 2
    (line,) = csv.DictReader((out / "in-the-loop.csv").open(encoding="utf-8"))
    assert line["predictor"] == "none" and not line["d95"]
