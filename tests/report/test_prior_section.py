"""The report's section on plans known beforehand."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from layoutexplore.benchmark.rows import NAN, Row
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.drawing.beliefs import SUFFIX
from layoutexplore.files import write_arrays
from layoutexplore.priors.completion import Compared
from layoutexplore.report.layout_section import prior_section
from layoutexplore.report.templates import render

AGENT = "plan-tour:predictor=prior:rough"


def folder_of(path: Path, ratios: dict[str, float]) -> tuple[ResultsFolder, list[Row]]:
    """Runs of the agent on plans, by their metres to 99 % over the baseline's 100 m."""
    folder, rows = ResultsFolder(path), []
    for plan, ratio in ratios.items():
        base = Row(plan=plan, start=0, sensor="stage", agent="nearest", seed=0, d99=100.0)
        row = dataclasses.replace(base, agent=AGENT, d99=100.0 * ratio)
        codes = np.zeros((2, 60, 80), np.uint8)
        codes[:, 20:40, 20:60] = Compared.FLOOR
        codes[:, 20:30, 20:60] = Compared.OTHER_FLOOR
        codes[1, 40:50, 20:60] = Compared.FORESEEN_FLOOR
        way = np.array([(0.0, 0.05, 0.1), (10.0, 0.2, 0.4), (40.0, 0.5, 0.9)], np.float32)
        arrays = {"way": way, "at": np.array([1, 2], np.int32), "maps": codes, "resolution": np.array([0.1])}
        write_arrays(folder.curve_path(row).with_suffix(SUFFIX), arrays)
        rows += [base, row]
    return folder, rows


def test_the_best_and_the_worst_run_are_shown(tmp_path: Path) -> None:
    folder, rows = folder_of(tmp_path, {"a": 0.8, "b": 0.6, "c": 1.1})
    (line,) = prior_section(folder, rows, "nearest", {})
    assert line.agent == AGENT and len(line.runs) == 3
    assert [run.row.plan for run in line.shown] == ["b", "c"]
    assert "gained most, 0.60" in line.shown[0].title and "gained least, 1.10" in line.shown[1].title
    assert line.sure == np.float32(0.4)  # half of 40 m: the decision at 10 m
    first = line.shown[0].pictures[0]
    assert first.caption.startswith("20") and "50" in first.caption and "confidence 0.40" in first.caption
    assert line.median.startswith("M0.00,90.00 ") and line.median.endswith("L100.00,10.00")


def test_runs_without_one_of_the_baseline_are_compared_with_nothing(tmp_path: Path) -> None:
    folder, rows = folder_of(tmp_path, {"a": 0.8, "b": 0.9})
    failed = [dataclasses.replace(row, error="Boom") if row.agent == "nearest" else row for row in rows]
    (line,) = prior_section(folder, [*rows[:2], *failed[2:]], "nearest", {})
    assert [run.title for run in line.shown] == [
        "a, start 0, stage: gained most, 0.80 of the metres to 99\xa0%"
    ]
    (line,) = prior_section(folder, failed, "nearest", {})
    assert [run.title for run in line.shown] == ["a, start 0, stage: there is nothing to compare it with"]


def test_the_page_has_it_and_others_do_not(tmp_path: Path) -> None:
    folder, rows = folder_of(tmp_path, {"a": 0.8})
    lines = prior_section(folder, rows, "nearest", {})
    page = render("prior_section.html", view=SimpleNamespace(beliefs=lines, baseline="nearest"))
    assert AGENT in page and page.count("data:image/png") == 2 and page.count("<path") == 2
    assert "Plans known" not in render("prior_section.html", view=SimpleNamespace(beliefs=[]))
    assert prior_section(folder, [rows[0]], "nearest", {}) == []


def test_runs_that_were_ended_early_are_compared_where_they_were_measured(tmp_path: Path) -> None:
    folder, rows = folder_of(tmp_path, {"a": 0.8, "b": 0.6})
    goals = {0.92: "to 90\N{NO-BREAK SPACE}%", 0.5: "in all"}
    for goal, scale in goals.items():
        d90 = {"d90" if goal > 0.9 else "distance": 7.0}
        ended = [dataclasses.replace(row, d95=NAN, d99=NAN, **d90) for row in rows]
        shorter = {"d90" if goal > 0.9 else "distance": 3.5}
        ended[3] = dataclasses.replace(ended[3], **shorter)
        (line,) = prior_section(folder, ended, "nearest", {})
        assert line.shown[0].title.endswith(f"b, start 0, stage: gained most, 0.50 of the metres {scale}")
        assert "gained least, 1.00" in line.shown[1].title
