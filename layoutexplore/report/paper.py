"""A benchmark for a paper: every chart of its report as SVG and PDF, every table as LaTeX and CSV."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from layoutexplore.benchmark.analysis import METRICS, POOLED, Comparison, groups, pooled_curves
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.drawing import palette
from layoutexplore.drawing.labels import label_places
from layoutexplore.errors import checks_arguments, require
from layoutexplore.files import atomic, safe_name, write_atomically
from layoutexplore.report.benchmark_view import BenchmarkView
from layoutexplore.report.plots import Look
from layoutexplore.report.profiles import FARTHEST, share_within
from layoutexplore.report.templates import NBSP, interval, number, percent, percents

_STYLE: Any = {
    "font.size": 8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "pdf.fonttype": 42,
    "svg.hashsalt": "layoutexplore",
}
_DASHES: dict[str, Any] = {
    "": "-",
    "7 3": (0, (7, 3)),
    "2 3": (0, (2, 3)),
    "9 3 2 3": (0, (9, 3, 2, 3)),
    "5 4": (0, (5, 4)),
}
_SIZE = (4.2, 2.6)
"""Inches of a chart: a column and a half."""


@dataclass(frozen=True)
class Table:
    """A table of text: its name, its header and its rows."""

    name: str
    header: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]


@checks_arguments
def write_paper(folder: ResultsFolder, out: Path, *, baseline: str | None = None) -> list[Path]:
    """Write charts and tables.

    Args:
        folder: What `layoutexplore benchmark` left.
        out: Where they go.
        baseline: The agent to compare with; None for the one of the run.

    Returns:
        The files written.

    Raises:
        MissingExtraError: matplotlib is not installed.
        ResultsError: The folder holds no benchmark, or is damaged.
    """
    require("matplotlib", "paper")
    view = BenchmarkView.of(folder, baseline)
    written = [path for table in tables_of(view) for path in _write_table(table, out)]
    unit = f"{view.baseline} {view.scale}".replace(NBSP, " ")
    for name, part in groups(view.rows).items():
        mine = [c for c in view.comparisons if c.sensor == name]
        curves = pooled_curves(part, view.baseline, view.curves)
        if mine:
            written += _save(_draw_ratios(mine, view.baseline, view.level), out / _file("ratios", name))
        if curves:
            chart = _draw_curves(curves, view.looks, unit)
            written += _save(chart, out / _file("coverage", name))
    if view.profile:
        written += _save(_draw_profiles(view.profile), out / "profiles")
    for name, (plot, _) in view.layouts.stops.items():
        written += _save(_draw_stops(plot), out / _file("stops", name))
    return written


def tables_of(view: BenchmarkView) -> list[Table]:
    """The tables of a report, as text."""
    levels = tuple(f"to {m[1:]} %" for m in METRICS)
    found = []
    header: tuple[str, ...]
    for group in view.groups:
        lines = [
            (
                _named(line.agent, line),
                *(interval(line.ratios[m].ratio) if m in line.ratios else "–" for m in METRICS),
                percent(line.reached["d99"]),
                str(line.summary.runs),
            )
            for line in group.table
        ]
        found.append(Table(_file("ratios", group.name), ("agent", *levels, "reached 99 %", "runs"), lines))
    order = view.order
    plans = [
        (line.plan, line.sensor, number(line.area, 0), *(number(line.metres.get(a), 0) for a in order))
        for line in view.plans
    ]
    found.append(Table("plans", ("floor plan", "sensor", "m²", *order), plans))
    header = ("agent", "seen", "rooms finished", "walked twice", "decisions", "ms a decision", "seconds")
    first = view.groups[:1]
    found += [Table("behaviour", header, [_behaviour(line) for line in group.table]) for group in first]
    header = ("agent", "choices changed", "true rooms would change it", "ms a prediction")
    for name, effects in view.layouts.effects.items():
        body = [
            (
                _named(line.effect.agent, line),
                percent(line.effect.changed.estimate),
                percent(line.effect.misled.estimate),
                number(line.effect.prediction_ms, 1),
            )
            for line in effects
        ]
        found.append(Table(_file("layout", name), header, body))
    header = ("agent", "metres saved", "points lost", "lost more than 2")
    for name, (_, stops) in view.layouts.stops.items():
        body = [
            (s.agent, percents(s.saved), number(100 * s.lost.estimate, 1), percent(s.too_early))
            for s in stops
        ]
        found.append(Table(_file("stops", name), header, body))
    return [table for table in found if table.rows]


def _file(kind: str, group: str) -> str:
    """The name without a suffix of what is shown of a group: a sensor, or all of them."""
    return kind if group == POOLED else f"{kind}-{safe_name(group)}"


def _named(agent: str, line: Any) -> str:
    """An agent as the tables of ratios name it."""
    return f"{agent} (knows the plan)" if line.privileged else agent


def _behaviour(line: Any) -> tuple[str, ...]:
    s = line.summary
    shares = (percent(s.coverage, 1), percent(s.rooms_finished), percent(s.revisits))
    return (line.agent, *shares, number(s.decisions, 0), number(s.ms_decision), number(s.seconds, 1))


def latex(text: str) -> str:
    r"""Text as LaTeX shows it.

    Example:
        >>> latex("a_b 5 % m² {x}")
        'a\\_b 5 \\% m$^2$ \\{x\\}'
    """
    named = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
    named |= {"²": "$^2$", "–": "--", "−": "$-$", NBSP: "~"}
    named |= {letter: rf"\{letter}" for letter in "&%$#_{}"}
    return "".join(named.get(letter, letter) for letter in re.sub(r"\s*\n\s*", " ", text))


def _write_table(table: Table, out: Path) -> list[Path]:
    """A table as CSV and as a tabular with the rules of the package booktabs."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([table.header, *table.rows])
    body = [" & ".join(map(latex, row)) + r" \\" for row in table.rows]
    columns = "l" + "r" * (len(table.header) - 1)
    head = [rf"\begin{{tabular}}{{{columns}}}", r"\toprule", " & ".join(map(latex, table.header)) + r" \\"]
    lines = [*head, r"\midrule", *body, r"\bottomrule", r"\end{tabular}", ""]
    write_atomically(out / f"{table.name}.csv", text.getvalue())
    write_atomically(out / f"{table.name}.tex", "\n".join(lines))
    return [out / f"{table.name}.csv", out / f"{table.name}.tex"]


def _axes(x_title: str, y_title: str, size: tuple[float, float] = _SIZE) -> tuple[Any, Any]:
    """An empty chart; made without a screen, and without touching the settings of the process."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=size, layout="constrained")
        axes = figure.add_subplot()
        axes.set_xlabel(x_title)
        axes.set_ylabel(y_title)
    return figure, axes


def _label_ends(axes: Any, ends: Sequence[tuple[str, Look, float]], *, leads: bool = True) -> None:
    """Names at the right of the frame, near where the lines end (percent from the top), and leads to them."""
    places = label_places([end for _, _, end in ends])
    for (name, (colour, dash), end), place in zip(ends, places, strict=True):
        at, look = 1 - place / 100, {"color": colour, "transform": axes.transAxes}
        if leads:  # dashed like the line: of two agents of one colour they alone tell which is which
            lead, style = ([1.0, 1.03, 1.1], [1 - end / 100, at, at]), _DASHES[dash]
            axes.plot(*lead, linestyle=style, linewidth=0.8, clip_on=False, **look)
        axes.text(1.12 if leads else 1.02, at, name, va="center", fontsize=7, **look)


def _draw_curves(curves: Sequence[Any], looks: Mapping[str, Look], unit: str) -> Any:
    figure, axes = _axes(f"metres travelled / metres of {unit}", "coverage, %")
    axes.set(xlim=(0, curves[0].x[-1]), ylim=(0, 100))
    for curve in curves:
        colour, dash = looks[curve.agent]
        axes.plot(curve.x, 100 * curve.mean, color=colour, linestyle=_DASHES[dash], linewidth=1.2)
    _label_ends(axes, [(c.agent, looks[c.agent], 100 * (1 - float(c.mean[-1]))) for c in curves])
    return figure


def _draw_ratios(comparisons: Sequence[Comparison], baseline: str, level: str) -> Any:
    shown = sorted((c for c in comparisons if c.metric == level), key=lambda c: -c.ratio.estimate)
    size = (_SIZE[0], 0.7 + 0.2 * len(shown))
    figure, axes = _axes(f"metres to {level[1:]} % / metres of {baseline}", "", size)
    for place, c in enumerate(shown):
        colour = palette.BETTER if c.ratio.high < 1 else palette.WORSE if c.ratio.low > 1 else palette.GREY
        axes.plot(c.ratio.ends, [place, place], color=palette.to_hex(colour), linewidth=1.2)
        axes.plot([c.ratio.estimate], [place], "o", color=palette.to_hex(colour), markersize=4)
    axes.axvline(1, color=palette.to_hex(palette.RULE), linestyle="--", linewidth=0.8, zorder=0)
    axes.set_yticks(range(len(shown)), [c.agent for c in shown])
    return figure


def _draw_profiles(profile: Any) -> Any:
    figure, axes = _axes("metres to 95 % / metres of the best agent in the cell", "share of cells, %")
    axes.set_xscale("log")
    axes.set(xlim=(1, FARTHEST), ylim=(0, 100))
    for line in profile.lines:
        values, shares = share_within(line.factors)
        x, y = [*values.tolist(), max(FARTHEST, float(values[-1]))], [*shares.tolist(), float(shares[-1])]
        style = _DASHES[line.dash]
        axes.step(x, [100 * v for v in y], where="post", color=line.colour, linestyle=style, clip_on=True)
    axes.set_xticks([1, 1.25, 1.5, 2, 3], ["1", "1.25", "1.5", "2", "3"])
    axes.set_xticks([], minor=True)
    _label_ends(axes, [(line.name, (line.colour, line.dash), line.end) for line in profile.lines])
    return figure


def _draw_stops(plot: Any) -> Any:
    figure, axes = _axes("points of coverage lost", "metres saved, %")
    for mark in plot.marks:
        colour, stop = mark.colour, mark.stop
        lost, saved = ([100 * getattr(run, name) for run in stop.runs] for name in ("lost", "saved"))
        middle = (100 * stop.lost.estimate, 100 * stop.saved.estimate)
        axes.plot(lost, saved, ".", color=colour, alpha=0.35, markersize=3)
        axes.plot(*middle, "o", color=colour, markersize=5)
    axes.set_xlim(left=min(0.0, axes.get_xlim()[0]))
    low, high = axes.get_ylim()
    places = [100 * (high - 100 * mark.stop.saved.estimate) / (high - low) for mark in plot.marks]
    marks = zip(plot.marks, places, strict=True)
    _label_ends(axes, [(mark.stop.agent, (mark.colour, ""), place) for mark, place in marks], leads=False)
    return figure


def _save(figure: Any, path: Path) -> list[Path]:
    """A chart as SVG and PDF; the same chart gives the same bytes."""
    import matplotlib as mpl

    written = []
    for kind, metadata in (("svg", {"Date": None}), ("pdf", {"CreationDate": None})):
        target = path.with_name(f"{path.name}.{kind}")
        with mpl.rc_context(_STYLE), atomic(target) as temporary:
            figure.savefig(temporary, format=kind, metadata=metadata)
        written.append(target)
    return written
