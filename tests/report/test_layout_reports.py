"""Report pages about layouts: half-seen rooms, closed doors, and their parts in the benchmark's report."""

from __future__ import annotations

import base64
import csv
import dataclasses
import itertools
import json
import math
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from layoutexplore.agents import make_agent
from layoutexplore.benchmark.analysis import compare
from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.early_stop import RunStop, summarise_stops
from layoutexplore.benchmark.runner import run_benchmark
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.cli import app
from layoutexplore.errors import ResultsError
from layoutexplore.evaluation.partial_rooms import FrontierScore, Item, RoomScore, Scores, score_predictors
from layoutexplore.evaluation.partial_rooms_summary import summarise_partial_rooms
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.raster import PlanRaster
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.metrics.statistics import Interval
from layoutexplore.predictors import RoomLabels, make_room_predictor
from layoutexplore.predictors.snapshot import Snapshot
from layoutexplore.report.benchmark import write_benchmark_report
from layoutexplore.report.charts import calibration_chart, line_chart, root_scatter
from layoutexplore.report.layout_section import layout_section, stop_plot
from layoutexplore.report.studies.partial_rooms import Gallery, draw_room, write_partial_rooms_report
from layoutexplore.report.templates import render
from layoutexplore.training.snapshots import explore_plan
from tests.plans import OFFICES

FLIPPED = "layout-nearest:predictor=oracle:flip=0.25"
VOID = {"meta", "link", "br", "wbr", "image", "img", "path", "circle", "rect", "hr"}


class Balance(HTMLParser):
    """Remembers what is open, and what is closed without being open."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.wrong: list[str] = []
        self.links: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.links += [value or "" for name, value in attrs if name in ("src", "href")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID and (not self.open or self.open.pop() != tag):
            self.wrong.append(tag)


def whole(page: Path) -> str:
    """The page, which must be well formed and fetch nothing."""
    html = page.read_text()
    parser = Balance()
    parser.feed(html)
    assert not parser.wrong and not parser.open
    assert all(link.startswith(("data:image/png;base64,", "#replay=")) for link in parser.links)
    said = re.sub(r'data:[^\"]*|<script type="application/json".*?</script>', "", html, flags=re.DOTALL)
    assert "http" not in said and "nan" not in said.lower().split()
    return html


# --- the benchmark's report
# -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> ResultsFolder:
    """Runs with and without a layout on two plans."""
    plans = tmp_path_factory.mktemp("plans")
    for name, scale in (("small", 0.5), ("large", 0.7)):
        save_plan(floorplan_from_ascii(OFFICES, resolution=scale, name=name), plans / f"{name}.geojson")
    agents = ("nearest", "layout-nearest", FLIPPED, "layout-nearest:stop_area=8,predictor=oracle")
    config = BenchmarkConfig(plans=(str(plans),), starts=1, agents=agents)
    return run_benchmark(config, tmp_path_factory.mktemp("results") / "out").folder


def test_the_report_says_what_the_layout_did(folder: ResultsFolder) -> None:
    page, markdown, *_ = write_benchmark_report(folder)
    html = whole(page)
    for text in (html, markdown.read_text()):
        assert "What the layout did" in text and "Stopping early" in text and FLIPPED in text
    assert "choices changed" in html and "true classes" in html
    labels = re.findall(r'<span class="end"[^>]*>([^<]*m²)</span>', html)
    assert labels and not any(" m²" in label for label in labels), "a number and its unit stay on one line"
    moments = [
        m
        for row in folder.rows()
        if row.agent == "layout-nearest"
        for m in folder.counterfactual(row).decisive
    ]  # type: ignore[union-attr]
    assert ("Decisive moments" in html) == bool(moments)


def test_a_baseline_that_sees_all_where_it_stands_is_compared_with_nothing(
    folder: ResultsFolder, tmp_path: Path
) -> None:
    shutil.copytree(folder.path, tmp_path / "small")
    small = ResultsFolder(tmp_path / "small")
    at_once: dict[str, Any] = {"d90": 0.0, "d95": 0.0, "d99": 0.0, "reached99": True}
    small.rewrite([dataclasses.replace(row, **at_once) for row in small.rows()])
    page, *_ = write_benchmark_report(small)
    assert whole(page)


def test_arrays_of_runs_that_do_not_fit_are_told(folder: ResultsFolder, tmp_path: Path) -> None:
    shutil.copytree(folder.path, tmp_path / "damaged")
    damaged = ResultsFolder(tmp_path / "damaged")
    raster = PlanRaster(np.zeros((1, 1), np.bool_), np.ones((1, 1), np.int32), 0.1)
    for plan in {row.plan for row in damaged.rows()}:
        damaged.save_raster(plan, raster)
    with pytest.raises(ResultsError, match=r"do not fit together.*remove both"):
        write_benchmark_report(damaged)


def test_decisive_moments_are_drawn(tmp_path: Path, folder: ResultsFolder) -> None:
    """Moments are those of agents that predict; here one is made to."""
    rows = [row for row in folder.rows() if row.agent == FLIPPED]
    told = [folder.counterfactual(row) for row in rows]
    assert any(t is not None and t.decisive for t in told)
    from layoutexplore.report.decisive_decisions import decision_picture

    drawn = 0
    for row, found in zip(rows, told, strict=True):
        occupied, frame = folder.raster(row.plan)
        for moment in found.decisive if found else ():
            picture = decision_picture(row, moment, occupied, float(frame[0]))
            for x, y in (picture.robot, picture.chosen, picture.given_up):
                assert 0 <= x <= picture.width and 0 <= y <= picture.height
            data = np.frombuffer(base64.b64decode(picture.image.split(",")[1]), np.uint8)
            assert cv2.imdecode(data, cv2.IMREAD_COLOR).shape[:2] == (picture.height, picture.width)
            assert picture.path.startswith("M") and ("m² left" in picture.said or "leads on" in picture.said)
            assert math.isnan(moment.seen_after) or f"{moment.seen_after:.0f}" in picture.outcome
            drawn += 1
    assert drawn


@pytest.mark.parametrize("measured", [("d90",), ()])
def test_moments_are_those_of_the_agent_that_is_best_where_runs_were_ended(
    folder: ResultsFolder, measured: tuple[str, ...]
) -> None:
    """Runs with the flipped predictor are made the shorter ones, to the level measured or in all."""
    rows = []
    for row in folder.rows():
        metres = 5.0 if row.agent == FLIPPED else 10.0
        levels = {name: metres if name in measured else math.nan for name in ("d90", "d95", "d99")}
        rows.append(dataclasses.replace(row, distance=metres, reached99=False, **levels))
    comparisons = compare(rows, "nearest")
    section = layout_section(folder, rows, comparisons, "nearest", folder.curve, {}, ())
    assert {picture.row.agent for picture in section.decisive} == {FLIPPED}
    assert section.effect_levels == measured and not section.stops
    view = SimpleNamespace(baseline="nearest", pooled="", replay=None, layouts=section)
    html = render("layout_section.html", view=view).replace("\N{NO-BREAK SPACE}", " ")
    assert ("metres to 90 %,<br>of nearest" in html) == bool(measured) and "metres to 95 %" not in html


def test_a_report_without_layouts_has_no_such_parts(tmp_path: Path) -> None:
    save_plan(floorplan_from_ascii(OFFICES, resolution=0.5, name="small"), tmp_path / "small.geojson")
    config = BenchmarkConfig(plans=(str(tmp_path / "small.geojson"),), starts=1, agents=("nearest", "tour"))
    html = whole(write_benchmark_report(run_benchmark(config, tmp_path / "out").folder)[0])
    assert (
        "What the layout did" not in html and "Decisive moments" not in html and "Stopping early" not in html
    )


@settings(max_examples=20, deadline=None)
@given(st.lists(st.tuples(st.floats(-60, 1), st.floats(0, 0.5)), min_size=1, max_size=6))
def test_marks_lie_in_their_frame(pairs: list[tuple[float, float]]) -> None:
    stops = [RunStop(f"plan {k}", saved, lost, 0.0, lost > 0) for k, (saved, lost) in enumerate(pairs)]
    plot = stop_plot([summarise_stops("stage", "early", stops)], {"tour": ("#123456", "")})
    (mark,) = plot.marks
    inside = [*mark.place, *mark.across, *mark.along, *(v for dot in mark.dots for v in dot), plot.limit]
    assert all(0 <= value <= 100 for value in inside)
    assert mark.across[0] <= mark.across[1] and mark.along[0] >= mark.along[1]
    ticks = [at for at, _ in plot.y_ticks]
    assert min(low - high for low, high in itertools.pairwise(ticks)) >= 5, "labels have room"
    assert "0 %" in [label for _, label in plot.y_ticks]


# --- half-seen rooms
# ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def snapshots() -> list[Snapshot]:
    plan = floorplan_from_ascii(OFFICES, resolution=0.7, name="offices")
    return explore_plan(plan, make_agent("nearest"), sensor="short", seed=1, coverages=(0.3, 0.5, 0.7))


def test_the_gallery_keeps_the_best_and_the_worst(snapshots: list[Snapshot]) -> None:
    predictors = [make_room_predictor(name) for name in ("parallel-wall", "hull")]
    gallery = Gallery("parallel-wall", count=2)
    found: list[RoomScore] = score_predictors(snapshots, predictors, gallery).rooms
    large = [s for s in found if s.predictor == "parallel-wall" and s.true_remaining >= 2]
    mine = {(r.plan, r.room): [s.hidden_iou for s in large if s.room == r.room] for r in found}
    values = [value for group in mine.values() for value in group]
    assert gallery.best[0].score.hidden_iou == max(values)
    assert {p.score.predictor for p in (*gallery.best, *gallery.worst)} == {"parallel-wall"}
    rooms = [(p.score.plan, p.score.room) for p in (*gallery.best, *gallery.worst)]
    assert len(set(rooms)) == len(rooms) and len(gallery.best) == 2
    assert [p.score.hidden_iou for p in gallery.worst] == sorted(p.score.hidden_iou for p in gallery.worst)


def test_a_room_is_drawn_with_what_is_right_wrong_and_missed(snapshots: list[Snapshot]) -> None:
    from layoutexplore.drawing.palette import MISSED, RIGHT, SEEN, WRONG
    from layoutexplore.evaluation.partial_rooms import find_items

    snapshot, item = next((s, i) for s in snapshots for i in find_items(s) if (i.mask & ~i.seen).sum() > 50)
    truth = snapshot.truth.raster

    def colours(rooms: RoomLabels, item: Item = item) -> set[tuple[int, ...]]:
        return set(map(tuple, draw_room(snapshot, item, rooms).reshape(-1, 3).tolist()))

    true = colours(RoomLabels(truth.room_ids, truth.free))
    assert SEEN in true and RIGHT in true and WRONG not in true and MISSED not in true
    nothing = colours(RoomLabels(np.zeros(truth.shape, np.int32), truth.free))
    assert MISSED in nothing and RIGHT not in nothing and WRONG not in nothing
    everything = colours(RoomLabels(np.ones(truth.shape, np.int32), np.ones(truth.shape, np.bool_)))
    assert RIGHT in everything and WRONG in everything and MISSED not in everything


def test_partial_rooms_page(tmp_path: Path) -> None:
    save_plan(floorplan_from_ascii(OFFICES, resolution=0.7, name="flat & <odd>"), tmp_path / "flat.geojson")
    out = tmp_path / "deep" / "report"
    asked = ["-p", "none", "-p", "layout", "-p", "oracle", "-s", "short"]
    arguments = [str(tmp_path / "flat.geojson"), *asked, "--out", str(out)]
    result = CliRunner().invoke(app, ["evaluate", "partial-rooms", *arguments])
    assert result.exit_code == 0, result.output
    html = whole(out / "report.html")
    assert "flat &amp; &lt;odd&gt;" in html and "Best rooms of layout" in html and "IoU of" in html
    assert "from floors of MIT" in html and "from floors of MIT" in result.output.replace("\n", " ")
    assert {p.name for p in out.iterdir()} == {
        "report.html",
        "rooms.csv",
        "frontiers.csv",
        "summary.csv",
        "pictures",
    }
    rows = list(csv.DictReader((out / "rooms.csv").open()))
    assert {row["predictor"] for row in rows} == {"none", "layout", "oracle"}
    assert all(float(row["hidden_iou"]) == 1.0 for row in rows if row["predictor"] == "oracle")
    measures = {
        (r["predictor"], r["of"], r["stratum"], r["measure"]): r["value"]
        for r in csv.DictReader((out / "summary.csv").open())
    }
    assert float(measures["oracle", "frontiers", "all", "leftover_accuracy"]) == 1.0
    judged = [r for r in csv.DictReader((out / "frontiers.csv").open()) if r["predictor"] == "layout"]
    right = sum(r["leftover"] == r["true_leftover"] for r in judged) / len(judged)
    assert right == pytest.approx(float(measures["layout", "frontiers", "all", "leftover_accuracy"]))
    places = {(r["plan"], r["sensor"], r["seed"], r["coverage"], r["x"], r["y"]) for r in judged}
    assert len(places) == len(judged)
    assert list((out / "pictures").glob("best_*.png"))


def test_an_area_just_below_a_square_metre_stays_below_it_in_the_table(tmp_path: Path) -> None:
    frontier = FrontierScore(
        plan="a",
        building="a",
        sensor="short",
        seed=0,
        coverage=0.5,
        predictor="none",
        x=1.0,
        y=2.0,
        closed=True,
        true_closed=True,
        area=math.nextafter(1.0, 0.0),
        true_area=1.0,
        confidence=0.9,
    )
    scores = Scores([], [frontier], {"none": [1.0]})
    summary = summarise_partial_rooms(scores)
    write_partial_rooms_report(tmp_path, scores, summary, Gallery("none"), command="")
    (row,) = csv.DictReader((tmp_path / "frontiers.csv").open())
    for area, leftover in (("area", "leftover"), ("true_area", "true_leftover")):
        assert str(float(row[area]) < 1) == row[leftover]


def test_partial_rooms_page_without_any_room(tmp_path: Path) -> None:
    """One large hall: it is seen at once, and nothing is left to judge but frontiers."""
    save_plan(
        floorplan_from_ascii("####\n#aa#\n#aa#\n####", resolution=1.5, name="hut"), tmp_path / "hut.geojson"
    )
    out = tmp_path / "out"
    pictures = out / "pictures"
    pictures.mkdir(parents=True)
    for name in ("best_1.png", "best_view.png"):  # one of an earlier study, one of somebody's own
        (pictures / name).touch()
    result = CliRunner().invoke(
        app, ["evaluate", "partial-rooms", str(tmp_path / "hut.geojson"), "-p", "none", "--out", str(out)]
    )
    assert result.exit_code == 0, result.output
    assert [path.name for path in pictures.iterdir()] == ["best_view.png"]
    assert "No room was seen in part" in whole(out / "report.html")
    assert "no room is judged" in result.output and "nan" not in result.output


# --- closed doors
# ---------------------------------------------------------------------------------------------------


def test_closed_doors_page(tmp_path: Path) -> None:
    truth = np.full((120, 200), 205, np.uint8)
    truth[10:110, 10:190] = 0
    truth[12:58, 12:188] = truth[62:108, 12:98] = truth[62:108, 102:188] = 254
    truth[58:62, 40:58] = truth[58:62, 140:158] = 254
    seen = truth.copy()
    seen[61:110, 99:190] = 205
    for name, image in (("flat_GT", truth), ("flat_1_doors_IN", seen), ("flat_1_doors_OUT", truth)):
        cv2.imwrite(str(tmp_path / f"{name}.png"), image)
    out, numbers = tmp_path / "out", tmp_path / "numbers.json"
    arguments = ["evaluate", "closed-doors", str(tmp_path), "--out", str(out), "--json", str(numbers)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    html = whole(out / "report.html")
    assert "reference, IoU 1.00" in html and "ours, IoU" in html and html.count("<img") == 4
    assert '<table class="tight">' in html and "<th>floor</th>" in html and "By building" not in html
    assert (out / "pictures" / "flat_1_doors.png").is_file() and (out / "summary.csv").is_file()
    (row,) = csv.DictReader((out / "maps.csv").open())
    (score_,) = json.loads(numbers.read_text())["maps"]
    assert float(row["ours_iou"]) == pytest.approx(score_["ours"]["iou"], abs=1e-5)
    assert float(row["reference_iou"]) == 1.0
    CliRunner().invoke(app, [*arguments[:-4], "--out", str(tmp_path / "bare"), "--no-report"])
    assert not (tmp_path / "bare" / "report.html").exists()


def test_closed_doors_page_counts_buildings_of_digits_and_shows_a_blank_truth(tmp_path: Path) -> None:
    seen = np.full((40, 60), 205, np.uint8)
    seen[5:35, 5:55] = 0
    seen[7:33, 7:53] = 254
    for name, truth in (("1", seen), ("2", seen), ("3", np.full_like(seen, 205))):
        cv2.imwrite(str(tmp_path / f"{name}_1_doors_IN.png"), seen)
        cv2.imwrite(str(tmp_path / f"{name}_GT.png"), truth)
    out = tmp_path / "out"
    result = CliRunner().invoke(app, ["evaluate", "closed-doors", str(tmp_path), "--out", str(out)])
    assert result.exit_code == 0, result.output
    html = whole(out / "report.html")
    assert "<b>3</b>buildings" in html and "there are only 3" in html


# --- charts -----


def test_lines_leave_out_what_is_not_there() -> None:
    nan = math.nan
    chart = line_chart(
        {"a": [Interval(0.5, 0.4, 0.6), Interval(nan, nan, nan)], "b": [Interval(2.0, nan, nan)] * 2},
        ["x", "y"],
    )
    first, second = chart.series
    assert len(first.points) == 1 and first.points[0].low > first.points[0].y > first.points[0].high
    assert [p.y for p in second.points] == [0.0, 0.0] and second.points[0].low == second.points[0].high
    assert [text for _, text in chart.ticks.x] == ["x", "y"]


def test_a_calibrated_predictor_lies_on_the_line() -> None:
    rng = np.random.default_rng(0)
    stated = rng.uniform(0.5, 1.0, 20_000)
    for dot in calibration_chart(stated, rng.random(20_000) < stated).dots:
        assert dot.x == pytest.approx(100 - dot.y, abs=6)
    (sure,) = calibration_chart(np.ones(4), np.array([True, False, False, False])).dots
    assert (sure.x, sure.y) == (100.0, 100.0)  # right less often than by tossing a coin: at the edge


@given(st.lists(st.floats(0, 5000), min_size=0, max_size=30))
def test_equal_areas_lie_on_the_diagonal(areas: list[float]) -> None:
    values = np.array(areas)
    chart = root_scatter(values, values, [""] * len(areas))
    assert all(dot.x == pytest.approx(100 - dot.y, abs=0.02) and 0 <= dot.x <= 100 for dot in chart.dots)
    places = [at for at, _ in chart.ticks.x]
    assert places == sorted(places) and all(b - a >= 7.99 for a, b in itertools.pairwise(places))


def test_what_was_said_with_less_than_one_half_stands_in_the_frame() -> None:
    (dot,) = calibration_chart(np.full(5, 0.42), np.array([True, False, True, False, False])).dots
    assert dot.x == 0.0 and "said 0.42" in dot.title
