"""The report: self-contained, honest, and readable from the results folder alone."""

from __future__ import annotations

import dataclasses
import itertools
import math
import re
from collections import Counter
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from layoutexplore.benchmark.analysis import compare
from layoutexplore.benchmark.config import BenchmarkConfig
from layoutexplore.benchmark.rows import COLUMNS, Row
from layoutexplore.benchmark.runner import run_benchmark
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.documentation.site import PAGES
from layoutexplore.drawing.labels import label_places
from layoutexplore.errors import ResultsError
from layoutexplore.grids.arrays import Floats
from layoutexplore.maps.geojson import save_plan
from layoutexplore.maps.tracing import floorplan_from_ascii
from layoutexplore.report.benchmark import headline, write_benchmark_report
from layoutexplore.report.benchmark_view import BenchmarkView
from layoutexplore.report.templates import TEMPLATES, interval, render
from tests.plans import HOUSE
from tests.report.cases import many_runs

VOID = {"meta", "link", "br", "wbr", "image", "img", "path", "circle", "rect", "hr", "input"}


class Balance(HTMLParser):
    """Remembers what is open, and what is closed without being open."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.wrong: list[str] = []
        self.attributes: list[tuple[str, str]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes += [(name, value or "") for name, value in attrs]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag in VOID:
            return
        if not self.open or self.open.pop() != tag:
            self.wrong.append(tag)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> ResultsFolder:
    """Results of three agents on two plans with two sensors."""
    plans = tmp_path_factory.mktemp("plans")
    for name, scale in (("small", 0.6), ("large & <odd>", 1.0)):
        save_plan(floorplan_from_ascii(HOUSE, resolution=scale, name=name), plans / f"{scale}.geojson")
    config = BenchmarkConfig(
        plans=(str(plans),),
        starts=1,
        agents=("nearest", "random", "clairvoyant"),
        sensors=("stage", "indoor"),
    )
    out = tmp_path_factory.mktemp("results") / "out"
    return run_benchmark(config, out, command="layoutexplore benchmark --starts 1").folder


def test_the_page_is_whole_and_fetches_nothing(folder: ResultsFolder) -> None:
    page, markdown, *tables = write_benchmark_report(folder)
    assert [path.name for path in (page, markdown, *tables)] == [
        "report.html",
        "report.md",
        "summary.csv",
        "results.parquet",
    ]
    html = page.read_text()
    parser = Balance()
    parser.feed(html)
    assert not parser.wrong and not parser.open
    assert "@import" not in html and "url(" not in html
    links = [value for name, value in parser.attributes if name in ("src", "href")]
    assert links and all(value.startswith(("data:image/png;base64,", "#replay=")) for value in links)
    said = re.sub(r'data:[^\"]*|<script type="application/json".*?</script>', "", html, flags=re.DOTALL)
    assert "http" not in said


def test_the_page_says_what_was_run(folder: ResultsFolder) -> None:
    html, markdown = (path.read_text() for path in write_benchmark_report(folder)[:2])
    for text in (html, markdown):
        assert "layoutexplore benchmark --starts 1" in text
        assert "numpy" in text and folder.rows()[0].config_hash in text
        assert all(f"{column}" in text for column in COLUMNS)
        assert "there are only 2" in text and "Odometry is perfect" in text
    assert "large &amp; &lt;odd&gt;" in html and "<odd>" not in html
    assert "knows the plan" in html
    assert html.count("<figure><svg") == 2 * 3  # the ways of three agents on two plans


def test_markdown_tables_have_even_rows(folder: ResultsFolder) -> None:
    blocks = re.findall(r"(?:^\|.*\n)+", write_benchmark_report(folder)[1].read_text(), re.MULTILINE)
    assert len(blocks) == 3 + 1 + 1  # three groups, by plan, behaviour
    for block in blocks:
        assert len({line.count("|") for line in block.splitlines()}) == 1


@given(st.lists(st.floats(0, 100), max_size=12), st.floats(0.5, 9))
def test_labels_stand_apart_in_the_order_of_their_lines(places: list[float], gap: float) -> None:
    found = label_places(places, gap)
    order = sorted(range(len(places)), key=lambda k: (places[k], k))
    for above, below in itertools.pairwise(order):
        assert found[below] - found[above] >= gap - 1e-9
    assert all(at >= 0 for at in found)
    if all(b - a >= gap for a, b in itertools.pairwise(sorted(places))):
        assert found == pytest.approx(places)


def colours_in(text: str) -> list[tuple[str, list[int]]]:
    """Every colour that a template writes itself, and its red, green and blue; not those of its variables."""
    found = []
    for code in re.findall(r"(?<!&)#([0-9a-fA-F]{8}|[0-9a-fA-F]{6}|[0-9a-fA-F]{3,4})\b", text):
        full = code if len(code) > 4 else "".join(digit * 2 for digit in code)
        found.append((f"#{code}", [int(full[k : k + 2], 16) for k in (0, 2, 4)]))
    for whole, inner in re.findall(r"\b(rgba?\(([\d\s.,%/]+)\))", text):
        found.append((whole, [round(float(part)) for part in re.findall(r"[\d.]+", inner)[:3]]))
    return found


def test_every_way_to_write_a_colour_is_found() -> None:
    written = "a #f00, #f00a #ff0000 #ff0000aa rgb(255, 0,0) rgba(255,0,0,.85) rgb(255 0 0 / 50%)"
    assert [rgb for _, rgb in colours_in(written)] == [[255, 0, 0]] * 7
    assert not colours_in("rgb(${c[0]}) &#039; #replay")


WITH_COLOURS = [
    path
    for path in sorted(TEMPLATES.rglob("*.[hcj][ts][ms]*"))
    if colours_in(path.read_text(encoding="utf-8"))
]


@pytest.mark.parametrize("path", WITH_COLOURS, ids=lambda path: path.name)
def test_colours_come_from_the_palette(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"\bhsla?\(|\boklch\(|\bcolor\(", text), "colours are written as red, green and blue"
    for written, rgb in colours_in(text):
        assert max(rgb) - min(rgb) <= 40, f"{written} in {path.name} is no grey"


def test_an_agent_has_one_colour_and_a_label_at_its_end(folder: ResultsFolder) -> None:
    html = write_benchmark_report(folder)[0].read_text()
    seen: dict[str, set[str]] = {}
    for colour, name in re.findall(
        r'class="end" style="top: [-0-9.]+%; color: (#\w+)" title="([\w-]+)"', html
    ):
        seen.setdefault(name, set()).add(colour)
    assert set(seen) == {"nearest", "random", "clairvoyant"}
    assert (
        all(len(colours) == 1 for colours in seen.values()) and len(set(map(frozenset, seen.values()))) == 3
    )
    assert (
        "share of cells" in html and "coverage, mean over cells" in html and "How often near the best" in html
    )
    assert html.count('<text class="bar"') == html.count("<figure><svg") == 6  # a scale bar a map


def view_of(folder: ResultsFolder, rows: list[Row]) -> BenchmarkView:
    """Some rows of a folder, compared with nearest."""
    view = BenchmarkView.of(folder, "nearest", compare(rows, "nearest"))
    return dataclasses.replace(view, rows=rows)


def test_the_documentation_has_every_column(folder: ResultsFolder) -> None:
    text = (PAGES / "how-to" / "reading-results.md").read_text(encoding="utf-8")
    view = view_of(folder, folder.rows())
    assert [name for name, _ in view.columns] == list(COLUMNS)
    for name, meaning in view.columns:
        assert f"| `{name}` | {meaning} |" in text
    summary = write_benchmark_report(folder)[2].read_text().splitlines()[0].split(",")
    assert all(
        f"`{name}`" in text for name in summary if not name.startswith(("plan_ratio_", "improvement_"))
    )
    with np.load(folder.curve_path(folder.rows()[0])) as arrays:
        assert all(f"`{name}`" in text for name in arrays.files)


def test_names_are_text_in_markdown(folder: ResultsFolder) -> None:
    odd = "a|b <script>alert(1)</script> [x](javascript:y)"
    rows = [
        dataclasses.replace(row, agent=odd if row.agent == "random" else row.agent) for row in folder.rows()
    ]
    rows[0] = dataclasses.replace(rows[0], error="Boom: <img>\n## no heading")
    small = [row for row in rows if row.agent != odd and not row.error]
    failed = dataclasses.replace(rows[0], agent=odd)
    view = dataclasses.replace(view_of(folder, [*small, failed]), comparisons=compare(rows, "nearest"))
    text = render("benchmark.md", view=view)
    assert "<" not in text and "\n## no heading" not in text
    assert r"a\|b &lt;script&gt;alert(1)&lt;/script&gt; \[x\](javascript:y)" in text
    assert "layoutexplore benchmark --starts 1" in text


def test_the_files_of_a_run_are_read_once(folder: ResultsFolder, tmp_path: Path) -> None:
    reads: Counter[tuple[str, str]] = Counter()

    class Counting(ResultsFolder):
        def curve(self, row: Row) -> Floats:
            reads["curve", str(row.key)] += 1
            return super().curve(row)

        def log(self, row: Row) -> Floats | None:
            reads["log", str(row.key)] += 1
            return super().log(row)

    large = many_runs(folder, tmp_path / "many", plans=4, starts=2)
    assert len(large.rows()) == 4 * 2 * 6
    page, *_ = write_benchmark_report(Counting(large.path))
    assert len(reads) == 2 * 48 and max(reads.values()) == 1
    assert "plan-003" in page.read_text()


def test_a_plan_may_lack_the_sensor_of_the_pictures(folder: ResultsFolder, tmp_path: Path) -> None:
    """A study that was stopped, or is added to sensor by sensor."""
    part = many_runs(folder, tmp_path / "part", plans=2, starts=1)
    first, *_ = rows = part.rows()
    part.rewrite([row for row in rows if row.plan == first.plan or row.sensor != first.sensor])
    page, *_ = write_benchmark_report(part)
    assert f"start 0, {first.sensor}" in page.read_text()


def test_the_tables_are_read_by_pandas(folder: ResultsFolder) -> None:
    import pandas as pd

    *_, summary, parquet = write_benchmark_report(folder)
    rows, table = pd.read_parquet(parquet), pd.read_csv(folder.table)
    assert list(rows.columns) == list(table.columns) == list(COLUMNS)
    assert len(rows) == len(table) == 12
    assert np.allclose(rows["d95"], table["d95"]) and table["reached95"].dtype == bool
    ratios = pd.read_csv(summary)
    mine = ratios[
        (ratios.sensor == "all sensors") & (ratios.agent == "clairvoyant") & (ratios.metric == "d95")
    ]
    assert len(mine) == 1 and 0.3 < mine.ratio.iloc[0] < 1.3 and mine.cells.iloc[0] == 4


def test_a_report_without_the_baseline(folder: ResultsFolder) -> None:
    html = write_benchmark_report(folder, baseline="tour")[0].read_text()
    assert "The agent tour did not run" in html and "Mean metres" in html
    assert headline(folder.rows(), "tour", [])[0] == (
        "agent",
        "metres to 90 %",
        "metres to 95 %",
        "metres to 99 %",
        "in all",
    )
    write_benchmark_report(folder)


@pytest.mark.parametrize(
    ("factors", "said"),
    [
        ((0.7, 0.8), "needs 0.75 of the metres of nearest"),
        ((0.8, 1.1), "comes out best with 0.94 of the metres of nearest"),
        ((0.9, 1.3), "comes nearest to nearest with 1.08 of the metres of nearest"),
        ((1.2, 1.4), "comes nearest to nearest, but is not as good: it needs 1.30 of the metres"),
    ],
)
def test_the_headline_says_no_more_than_is_known(
    folder: ResultsFolder, factors: tuple[float, float], said: str
) -> None:
    rows = [row for row in folder.rows() if row.agent != "clairvoyant" and row.sensor == "stage"]
    of_plan = dict(zip(sorted({row.plan for row in rows}), factors, strict=True))
    metres = {
        (row.agent, row.plan): 10.0 * (of_plan[row.plan] if row.agent == "random" else 1) for row in rows
    }
    rows = [dataclasses.replace(row, d95=metres[row.agent, row.plan]) for row in rows]
    view = view_of(folder, rows)
    doubted = "may be chance" in view.verdict
    assert view.best.agent == "random" and said in view.verdict.replace("\N{NO-BREAK SPACE}", " ")
    assert doubted == (min(factors) < 1 < max(factors))


def test_two_floors_of_one_building_prove_nothing(folder: ResultsFolder) -> None:
    rows = [dataclasses.replace(row, building="tower") for row in folder.rows()]
    view = view_of(folder, rows)
    assert view.counts["floor plans"] == 2 and "in one building, which proves nothing" in view.verdict


def test_runs_ended_below_95_percent_are_ranked_at_90(folder: ResultsFolder) -> None:
    """One of them happened to see more: that is no measurement of the level."""
    below: dict[str, Any] = {"d95": math.nan, "d99": math.nan, "reached95": False, "reached99": False}
    rows = [dataclasses.replace(row, **below) for row in folder.rows()]
    rows[0] = dataclasses.replace(rows[0], d95=5.0, reached95=True)
    comparisons = compare(rows, "nearest")
    table = headline(rows, "nearest", comparisons)
    ranked = sorted(
        (c for c in comparisons if c.sensor == "all sensors"), key=lambda c: (c.ratio.estimate, c.agent)
    )
    assert [line[0] for line in table[1:]] == [c.agent for c in ranked]
    assert all("(" in line[1] and line[2:4] == ("–", "–") and line[5] == "–" for line in table[1:])
    view = view_of(folder, rows)
    assert view.best.metric == "d90" and "to see 90\N{NO-BREAK SPACE}% of a floor" in view.verdict
    assert [line.agent for line in view.groups[0].table] == [c.agent for c in ranked]
    text, html = (render(name, view=view) for name in ("benchmark.md", "benchmark.html"))
    assert "| 100 / – / – % |" in text and "buildings equal, 90 %" in text
    assert "Metres to 90 % by floor plan" in text
    html = html.replace("\N{NO-BREAK SPACE}", " ")
    assert 'title="to 90 %: ' in html and 'title="to 95 %: ' not in html
    assert "metres of nearest to 90 %" in html and "m to 90 %" in html and "95 % not reached" not in html
    never = [dataclasses.replace(row, d90=math.nan, d95=math.nan) for row in rows]
    view = view_of(folder, never)
    html = render("benchmark.html", view=view).replace("\N{NO-BREAK SPACE}", " ")
    assert "Runs were ended below 90 %, so there is nothing to compare with" in html and not view.best
    assert "read 95 % and 99 % together" not in html and "<th>in all</th>" in html
    (line, *_) = view.groups[0].table
    assert f"<td>{line.agent}</td><td>–</td><td>–</td><td>–</td><td>{line.distance:.1f}</td>" in html
    table = headline(never, "nearest", [])
    assert table[0][-1] == "in all" and (line.agent, "–", "–", "–", f"{line.distance:.1f}") in table


def test_agents_that_ran_other_cells_do_not_pass_for_equal(folder: ResultsFolder) -> None:
    every = folder.rows()
    rows = [row for row in every if row.agent != "random" or row.plan == "small"]
    for chosen, apart in ((every, False), (rows, True)):
        comparisons = compare(chosen, "nearest")
        table = headline(chosen, "nearest", comparisons)
        assert (table[0][-1] == "cells") == apart
        if apart:
            assert {line[0]: line[-1] for line in table[1:]} == {
                "nearest": "4",
                "clairvoyant": "4",
                "random": "2",
            }
        view = view_of(folder, chosen)
        html, text = (render(name, view=view) for name in ("benchmark.html", "benchmark.md"))
        assert ("Every agent ran the same cells" in html) != apart
        assert ("Mean over 2 to 4 cells" if apart else "Mean over 4 cells") in html
        assert ("Not all agents ran the same cells" in view.verdict) == apart
        for page in (html, text):
            assert f"buildings behind each: {'1 to 2' if apart else '2'}." in page
            assert ("random ran 2 of the 4 cells: its ratios are of those." in page) == apart
            assert ("10 of 12 runs are there" in page) == apart


def test_a_summary_without_comparisons_has_its_header(folder: ResultsFolder) -> None:
    import pandas as pd

    *_, whole, _ = write_benchmark_report(folder)
    columns = list(pd.read_csv(whole).columns)
    *_, summary, _ = write_benchmark_report(folder, baseline="tour")
    found = pd.read_csv(summary)
    assert list(found.columns) == columns and not len(found)
    write_benchmark_report(folder)


def test_runs_that_need_see_no_90_percent_are_listed(folder: ResultsFolder) -> None:
    never = {"d90": math.nan, "d95": math.nan, "d99": math.nan}
    rows = [dataclasses.replace(row, **never) for row in folder.rows()]  # type: ignore[arg-type]
    table = headline(rows, "nearest", compare(rows, "nearest"))
    assert {line[0] for line in table[1:]} == {"nearest", "random", "clairvoyant"}


def test_failed_runs_are_listed(folder: ResultsFolder) -> None:
    rows = folder.rows()
    rows[0] = Row(
        **{f: getattr(rows[0], f) for f in ("plan", "start", "sensor", "agent", "seed")},
        error="Boom: <b>no</b>",
    )
    html = render("benchmark.html", view=view_of(folder, rows))
    assert "Failed runs" in html and "Boom: &lt;b&gt;no&lt;/b&gt;" in html and "<b>1</b>failed" in html


def test_nothing_ended_well(folder: ResultsFolder) -> None:
    rows = [dataclasses.replace(row, error="Boom: no") for row in folder.rows()]
    view = view_of(folder, rows)
    assert "No run has ended well" in render("benchmark.html", view=view)
    assert "Boom: no" in render("benchmark.md", view=view)
    assert headline(rows, "nearest", []) == [("agent",)]


def test_a_folder_without_a_benchmark(tmp_path: Path) -> None:
    with pytest.raises(ResultsError, match=r"no run\.toml"):
        write_benchmark_report(ResultsFolder(tmp_path))
    (tmp_path / "run.toml").write_text("a = [")
    with pytest.raises(ResultsError, match="damaged"):
        write_benchmark_report(ResultsFolder(tmp_path))


def test_intervals_as_text() -> None:
    assert interval(None) == "–"
