"""A benchmark for a paper: charts as SVG and PDF, tables as LaTeX and CSV."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
from typer.testing import CliRunner

from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.runner import run_benchmark
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.cli import app
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.report.paper import write_paper
from tests.plans import HOUSE

pytest.importorskip("matplotlib")

AGENTS = ("nearest", "layout-tour", "random", "clairvoyant", *(f"wait:area={k}" for k in range(1, 7)))
"""More than there are colours: lines of one colour differ by their dashes."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> ResultsFolder:
    plans = tmp_path_factory.mktemp("plans")
    for name, scale in (("a_1 & co", 0.6), ("b", 0.8)):
        save_plan(floorplan_from_ascii(HOUSE, resolution=scale, name=name), plans / f"{scale}.geojson")
    config = BenchmarkConfig(plans=(str(plans),), starts=1, agents=AGENTS)
    return run_benchmark(config, tmp_path_factory.mktemp("results") / "out").folder


@pytest.fixture(scope="module")
def written(folder: ResultsFolder, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return write_paper(folder, tmp_path_factory.mktemp("paper"))


def test_every_chart_and_table_is_written(written: list[Path]) -> None:
    assert all(path.is_file() for path in written)
    kinds = {path.stem: {p.suffix for p in written if p.stem == path.stem} for path in written}
    assert kinds["ratios-stage"] == {".svg", ".pdf", ".tex", ".csv"}
    assert kinds["coverage-stage"] == kinds["profiles"] == {".svg", ".pdf"}
    assert kinds["plans"] == kinds["behaviour"] == kinds["layout-stage"] == {".tex", ".csv"}
    for path in written:
        if path.suffix == ".svg":
            assert ElementTree.parse(path).getroot().tag.endswith("svg")
        if path.suffix == ".pdf":
            assert path.read_bytes().startswith(b"%PDF-") and path.read_bytes().rstrip().endswith(b"%%EOF")
    (found,) = [row for row in csv.reader((written[0].parent / "plans.csv").open()) if row[0] == "a_1 & co"]
    text = (written[0].parent / "plans.tex").read_text()
    assert r"a\_1 \& co" in text and " & ".join(found[2:]) in text
    rows = [line for line in text.splitlines() if line.endswith(r"\\")]
    assert len({line.replace(r"\&", "").count("&") for line in rows}) == 1


def test_the_chart_of_ratios_shows_every_agent_once(written: list[Path]) -> None:
    svg = (written[0].parent / "ratios-stage.svg").read_text()
    labels = re.findall(r"<!-- (.*?) -->", svg)  # letters are drawn as curves, after what they say
    assert "metres to 95 % / metres of nearest" in labels
    assert sorted(label for label in labels if label in AGENTS) == sorted(AGENTS)


def test_files_of_all_sensors_have_plain_names(tmp_path: Path) -> None:
    save_plan(floorplan_from_ascii(HOUSE, resolution=0.6, name="house"), tmp_path / "house.geojson")
    plans, sensors = (str(tmp_path / "house.geojson"),), ("stage", "indoor")
    config = BenchmarkConfig(plans=plans, starts=1, agents=("nearest", "tour"), sensors=sensors)
    written = write_paper(run_benchmark(config, tmp_path / "out").folder, tmp_path / "paper")
    stems = {path.stem for path in written if path.stem.partition("-")[0] in ("ratios", "coverage")}
    assert stems == {f"{kind}{of}" for kind in ("ratios", "coverage") for of in ("", "-stage", "-indoor")}


def test_agents_that_know_the_plan_are_marked(written: list[Path]) -> None:
    (names, *_) = zip(*csv.reader((written[0].parent / "ratios-stage.csv").open()), strict=True)
    assert set(names[1:]) == {*AGENTS, "clairvoyant (knows the plan)"} - {"clairvoyant"}
    assert r"clairvoyant (knows the plan) & " in (written[0].parent / "ratios-stage.tex").read_text()


def test_names_are_joined_to_their_lines_by_the_same_dashes(written: list[Path]) -> None:
    for name in ("coverage-stage", "profiles"):
        drawn = (written[0].parent / f"{name}.svg").read_text()
        colours = re.findall(r'dasharray[^"]*stroke: (#\w+)', drawn)
        assert colours and all(colours.count(colour) == 2 for colour in colours), colours


def test_the_command_writes_the_same_bytes(folder: ResultsFolder, written: list[Path]) -> None:
    done = CliRunner().invoke(app, ["report", str(folder.path), "--paper"])
    assert done.exit_code == 0 and "profiles.pdf" in done.output.replace("\n", "")
    paper = folder.path / "paper"
    assert {path.name for path in written} == {path.name for path in paper.iterdir()}
    for path in written:
        assert path.read_bytes() == (paper / path.name).read_bytes(), path.name
