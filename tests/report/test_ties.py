"""What a report says where every agent sees all from where it stands."""

from __future__ import annotations

from pathlib import Path

from layoutexplore.benchmark.analysis import compare
from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.runner import run_benchmark
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.report.benchmark import headline, write_benchmark_report


def closet(folder: Path, starts: int, *agents: str) -> ResultsFolder:
    plan = folder / "closet.geojson"
    save_plan(floorplan_from_ascii("#####\n#...#\n#...#\n#####", 0.5, name="closet"), plan)
    config = BenchmarkConfig(plans=(str(plan),), starts=starts, agents=agents)
    return run_benchmark(config, folder / "out", jobs=1).folder


def test_names_that_begin_alike_are_cut_in_the_middle(tmp_path: Path) -> None:
    folder = closet(tmp_path, 1, "nearest", "cost-utility:alpha=0.1", "cost-utility:alpha=0.2")
    html = write_benchmark_report(folder)[0].read_text(encoding="utf-8")
    for last in "12":
        assert f'"><span>cost-utility:a</span><span>lpha=0.{last}</span></span>' in html
    assert "Mean over 1 cell. " in html


def test_a_tie_is_told_from_a_win(tmp_path: Path) -> None:
    folder = closet(tmp_path, 2, "nearest", "random")
    assert {(row.d95, row.d99) for row in folder.rows()} == {(0.0, 0.0)}
    for path in write_benchmark_report(folder)[:2]:
        said = path.read_text(encoding="utf-8").replace("\N{NO-BREAK SPACE}", " ")
        assert "needs fewer than nearest in 50 % of 2 paired runs (as many count half)" in said
    markdown = next(line for line in said.splitlines() if line.startswith("| nearest |"))
    assert markdown.split(" | ")[5:7] == ["–", "–"]  # nobody is better than itself in half of its runs
    lines = headline(folder.rows(), "nearest", compare(folder.rows(), "nearest"))
    assert [line[4] for line in lines] == ["better", "–", "50\N{NO-BREAK SPACE}%"]
