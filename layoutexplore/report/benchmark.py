"""The report of a benchmark: report.html, report.md and summary.csv from a results folder alone."""

from __future__ import annotations

import dataclasses
import functools
import math
import platform
import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

import layoutexplore
from layoutexplore.benchmark.analysis import (
    HEADLINE,
    METRICS,
    POOLED,
    AgentSummary,
    Comparison,
    agents_of,
    by_plan,
    cells_of_agents,
    compare,
    groups,
    headline_level,
    measured_levels,
    pooled_curves,
    ratios_by_plan,
    summarise_agents,
)
from layoutexplore.benchmark.manifest import agents_that_know
from layoutexplore.benchmark.rows import Row
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.drawing import palette
from layoutexplore.errors import checks_arguments
from layoutexplore.files import atomic, write_atomically
from layoutexplore.report.caveats import caveats
from layoutexplore.report.layout_section import layout_section, prior_section
from layoutexplore.report.plots import (
    CurveLine,
    ForestPlot,
    agent_looks,
    curve_lines,
    forest,
    heat,
    pictures_of_tracks,
)
from layoutexplore.report.profiles import profile_plot
from layoutexplore.report.replay import replay_view, runs_to_replay
from layoutexplore.report.templates import interval, number, percent, render

NBSP = "\N{NO-BREAK SPACE}"

_INTERVALS = ("ratio", "plan_ratio", "improvement")
_SUMMARY = [
    *("sensor", "agent", "metric", "cells", "plans", "buildings"),
    *(f"{name}{end}" for name in _INTERVALS for end in ("", "_low", "_high")),
    "reached",
]
"""Columns of summary.csv."""

PACKAGES = ("numpy", "scipy", "numba", "opencv-python-headless", "shapely")


@dataclass(frozen=True)
class Group:
    """Everything about one sensor, or about all of them."""

    name: str
    forest: ForestPlot
    table: list[AgentLine]
    lines: list[CurveLine]


@dataclass(frozen=True)
class AgentLine:
    """One row of the tables: an agent's comparisons by level, figures, how often it reached each level.

    Attributes:
        agent: The strategy.
        privileged: Whether it knows the plan.
        ratios: By level, those that were measured and compared.
        main: The one of them that agents are ranked by.
        summary: Plain figures.
        reached: By level, the share of its runs that reached it, NaN for levels that were not measured.
        metres: By level, their mean, NaN likewise.
        distance: Metres in all, their mean.
    """

    agent: str
    privileged: bool
    ratios: dict[str, Comparison]
    main: Comparison | None
    summary: AgentSummary
    reached: dict[str, float]
    metres: dict[str, float]
    distance: float

    @property
    def reached_text(self) -> str:
        """Percents of all levels, a dash for one that was not measured."""
        return " / ".join(number(100 * self.reached[m], 0) for m in METRICS)


@dataclass(frozen=True)
class PlanLine:
    """One row of the table by floor plan: metres of each agent, and ratios to the baseline's."""

    plan: str
    sensor: str
    area: float
    metres: dict[str, float]
    ratios: dict[str, float]


@checks_arguments
def write_benchmark_report(
    folder: ResultsFolder, *, baseline: str | None = None, comparisons: list[Comparison] | None = None
) -> list[Path]:
    """Write report.html, report.md, summary.csv and results.parquet into a results folder.

    Args:
        folder: What `layoutexplore benchmark` left.
        baseline: The agent to compare with; None for the one of the run.
        comparisons: Its comparisons, where they are known already.

    Returns:
        The files written, the page first.

    Raises:
        ResultsError: The folder holds no benchmark, or is damaged.
    """
    manifest = folder.manifest()
    rows = sorted(folder.rows(), key=lambda row: row.key)
    baseline = baseline or str(manifest["baseline"])
    view = report_view(
        folder, rows, manifest, baseline, compare(rows, baseline) if comparisons is None else comparisons
    )
    written = []
    for name, template in (("report.html", "benchmark.html"), ("report.md", "benchmark.md")):
        write_atomically(folder.path / name, render(template, **view))
        written.append(folder.path / name)
    return [*written, *_write_tables(folder.path, rows, view["comparisons"])]


def report_view(
    folder: ResultsFolder,
    rows: list[Row],
    manifest: dict[str, Any],
    baseline: str,
    comparisons: list[Comparison],
) -> dict[str, Any]:
    """Everything that the templates show."""
    curves = functools.cache(folder.curve)
    summaries = summarise_agents(rows, baseline, curves)
    levels, level = measured_levels(rows), headline_level(rows)
    shown, looks, knowing = [], agent_looks([], baseline), agents_that_know(manifest)
    for name, part in groups(rows).items():
        mine = [c for c in comparisons if c.sensor == name]
        table = _table(part, mine, [s for s in summaries if s.sensor == name], levels, level, knowing)
        order = [line.agent for line in table]
        looks = looks or agent_looks(order, baseline)
        lines = curve_lines(pooled_curves(part, baseline, curves), order, looks)
        shown.append(Group(name, forest(mine, level), table, lines))
    best = _best(shown, baseline)
    layouts = layout_section(folder, rows, comparisons, baseline, curves, looks, knowing)
    replayed = runs_to_replay(rows, (picture.row for picture in layouts["decisive"]))
    measured = _what_was_measured(rows, baseline)
    return {
        "groups": shown,
        "comparisons": comparisons,
        "baseline": baseline,
        "has_baseline": bool(comparisons),
        "best": best,
        "verdict": _verdict(best, baseline, same_cells=measured["same_cells"]) if best else "",
        **measured,
        "plans": _plan_lines(rows, baseline, level) if level else [],
        "buildings": _span(c.buildings for c in comparisons),
        "curve_cells": _span(line.cells for group in shown[:1] for line in group.lines),
        "order": [line.agent for line in shown[0].table] if shown else [],
        "pictures": pictures_of_tracks(folder, rows, baseline, knowing, level),
        "failed": [row for row in rows if row.error],
        "rows": rows,
        "counts": _counts(rows),
        "columns": _columns(),
        "settings": manifest["settings"],
        "manifest": manifest,
        "versions": _versions(),
        "caveats": caveats(
            rows, manifest["settings"], len(_candidates(shown, baseline)), baseline, _planned(manifest)
        ),
        "heat": heat,
        "metrics": METRICS,
        "pooled": POOLED,
        **layouts,
        "beliefs": prior_section(folder, rows, baseline, looks),
        "replay": replay_view(folder, replayed),
        "profile": profile_plot(rows, looks, knowing) if level == HEADLINE else None,
        "looks": looks,
        "ramp": [palette.to_hex(palette.RAMP[end]) for end in (0, -1)],
    }


def headline(rows: Sequence[Row], baseline: str, comparisons: Sequence[Comparison]) -> list[tuple[str, ...]]:
    """The table for the terminal: a header, then a row an agent, best first; its cells where they differ."""
    parts = groups(rows)
    if not parts:
        return [("agent",)]
    name, part = next(iter(parts.items()))
    comparisons = [c for c in comparisons if c.sensor == name]
    names, level = [(m, f"{m[1:]} %") for m in METRICS], headline_level(rows)
    if not comparisons:
        # compared with nobody, also where the baseline ran: nothing was seen to 90 %
        summaries = summarise_agents(part, "", lambda _: np.empty((0, 2)))
        table = _table(part, [], summaries, measured_levels(rows), level)
        found = [(line.agent, [*(line.metres[m] for m, _ in names), line.distance]) for line in table]
        header = ("agent", *(f"metres to {text}" for _, text in names), "in all")
        return [header, *((agent, *(number(metres, 1) for metres in every)) for agent, every in found)]
    by_agent: dict[str, dict[str, Comparison]] = {agent: {} for agent in agents_of(part)}
    for c in comparisons:
        by_agent[c.agent][c.metric] = c
    ranked = sorted(by_agent.items(), key=lambda item: _rank(item[1].get(level)))
    header = (f"metres / {baseline}'s", *(f"to {text}" for _, text in names), "better", "reached 99 %")
    body = [
        (
            agent,
            *(_short(found.get(m), full=m == level) for m, _ in names),
            percent(found[level].improvement.estimate) if level in found else "–",
            percent(found["d99"].reached) if "d99" in found else "–",
        )
        for agent, found in ranked
    ]
    cells = [found[level].cells if level in found else 0 for _, found in ranked]
    if len(set(cells)) < 2:
        return [header, *body]
    return [(*header, "cells"), *((*line, str(count)) for line, count in zip(body, cells, strict=True))]


def _short(c: Comparison | None, *, full: bool) -> str:
    return "–" if c is None else interval(c.ratio) if full else number(c.ratio.estimate)


def _table(
    part: Sequence[Row],
    comparisons: Sequence[Comparison],
    summaries: Sequence[AgentSummary],
    levels: Sequence[str],
    level: str,
    knowing: Collection[str] = (),
) -> list[AgentLine]:
    """One line an agent, the best at a level first; figures of levels that were not measured are NaN."""
    summary_of = {s.agent: s for s in summaries}
    lines = []
    for agent in agents_of(part):
        mine = [row for row in part if row.agent == agent]
        found = {c.metric: c for c in comparisons if c.agent == agent}
        metres, reached = (
            {m: _mean(mine, m.replace("d", prefix)) if m in levels else math.nan for m in METRICS}
            for prefix in ("d", "reached")
        )
        knows, main = agent in knowing, found.get(level)
        walked = _mean(mine, "distance")
        lines.append(AgentLine(agent, knows, found, main, summary_of[agent], reached, metres, walked))
    return sorted(lines, key=lambda line: (_rank(line.main), line.metres[level] if level else 0, line.agent))


def _mean(rows: Sequence[Row], name: str) -> float:
    return float(sum(getattr(row, name) for row in rows) / len(rows))


def _rank(main: Comparison | None) -> float:
    return math.inf if main is None else main.ratio.estimate


def _best(shown: Sequence[Group], baseline: str) -> Comparison | None:
    """The best comparison of an agent that does not know the plan, at the level that ranks."""
    return min(_candidates(shown, baseline), key=lambda c: c.ratio.estimate, default=None)


def _candidates(shown: Sequence[Group], baseline: str) -> list[Comparison]:
    """The comparisons that rank all agents but the baseline that do not know the plan."""
    lines = shown[0].table if shown else []
    return [line.main for line in lines if line.main and not line.privileged and line.agent != baseline]


def _verdict(best: Comparison, baseline: str, *, same_cells: bool) -> str:
    """One honest sentence about the best agent; its subject is the agent."""
    ratio = best.ratio
    known = math.isfinite(ratio.low)
    interval_text = f" (95{NBSP}% interval {number(ratio.low)}–{number(ratio.high)})" if known else ""
    share = f"{best.metric[1:]}{NBSP}% of a floor"
    needs = f"{number(ratio.estimate)} of the metres of {baseline} to see {share}{interval_text}"
    wins = best.improvement.estimate
    halves = " (as many count half)" if 0 < wins < 1 else ""  # else there are no ties
    better = f"It needs fewer than {baseline} in {percent(wins)} of {best.cells} paired runs{halves}." + (
        "" if same_cells else " Not all agents ran the same cells: see below."
    )
    if known and ratio.high < 1:
        return f"needs {needs}. {better}"
    if known and ratio.low > 1:
        return f"comes nearest to {baseline}, but is not as good: it needs {needs}. {better}"
    doubt = (
        "the interval does not leave out 1, so this may be chance"
        if known
        else "in one building, which proves nothing"
    )
    place = "comes out best" if ratio.estimate < 1 else f"comes nearest to {baseline}"
    return f"{place} with {needs}, but {doubt}. {better}"


def _what_was_measured(rows: Sequence[Row], baseline: str) -> dict[str, Any]:
    """What the templates say of levels and cells: `level` ranks, `scale` is the highest level measured."""
    levels, level = measured_levels(rows), headline_level(rows)
    return {
        "level": level,
        "scale": f"to {levels[-1][1:]}{NBSP}%" if levels else "in all",
        "alone": _why_alone(rows, baseline, level),
        "same_cells": len({frozenset(cells) for cells in cells_of_agents(rows).values() if cells}) < 2,
    }


def _why_alone(rows: Sequence[Row], baseline: str, level: str) -> str:
    """Why agents are compared with nobody, where they are."""
    mine = [row for row in rows if row.agent == baseline]
    if not mine:
        return f"The agent {baseline} did not run"
    if all(row.error for row in mine):
        return f"All runs of {baseline} failed"
    return f"{baseline} ran other cells" if level else f"Runs were ended below {METRICS[0][1:]}{NBSP}%"


def _span(numbers: Iterable[int]) -> str:
    """The least and the largest of some numbers, as text; empty without any."""
    found = sorted(set(numbers))
    return f"{found[0]} to {found[-1]}" if len(found) > 1 else "".join(map(str, found))


def _planned(manifest: dict[str, Any]) -> int:
    """Number of runs that the floor plans, starts, sensors and agents of a folder make."""
    lists = (manifest[name] for name in ("plans", "sensors", "agents"))
    return int(manifest["starts"]) * math.prod(map(len, lists))


def _plan_lines(rows: Sequence[Row], baseline: str, level: str) -> list[PlanLine]:
    areas = {(row.plan, row.sensor): row.target_area for row in rows if not row.error}
    lines, paired = [], ratios_by_plan(rows, level, baseline)
    for key, metres in by_plan(rows, level).items():
        ratios = dict.fromkeys(metres, math.nan) | paired.get(key, {})
        lines.append(PlanLine(*key, areas[key], metres, ratios))
    return lines


def _counts(rows: Sequence[Row]) -> dict[str, int]:
    names = {"floor plans": "plan", "starts": "start", "sensors": "sensor", "agents": "agent"}
    return {
        "runs": len(rows),
        **{label: len({getattr(row, name) for row in rows}) for label, name in names.items()},
    }


def _columns() -> list[tuple[str, str]]:
    """Name and meaning of the columns of results.csv, from the documentation of `Row`."""
    text = (Row.__doc__ or "").split("Attributes:")[1]
    entries = re.sub(r"\n {12,}", " ", text).strip().splitlines()  # an entry that goes on is indented further
    pairs = (line.strip().split(": ", 1) for line in entries)
    return [(name, meaning) for name, meaning in pairs]


def _versions() -> list[tuple[str, str]]:
    found = [("layoutexplore", layoutexplore.__version__), ("Python", platform.python_version())]
    installed = {name: next(iter(metadata.distributions(name=name)), None) for name in PACKAGES}
    found += [(name, package.version) for name, package in installed.items() if package]
    return [*found, ("system", f"{platform.system()} {platform.machine()}")]


def _write_tables(path: Path, rows: Sequence[Row], comparisons: Sequence[Comparison]) -> list[Path]:
    import pandas as pd

    with atomic(path / "results.parquet") as temporary:
        columns = {
            field.name: [getattr(row, field.name) for row in rows] for field in dataclasses.fields(Row)
        }
        pd.DataFrame(columns).to_parquet(temporary, index=False)
    flat = [_flat(c) for c in comparisons]
    with atomic(path / "summary.csv") as temporary:
        pd.DataFrame(flat, columns=_SUMMARY).to_csv(temporary, index=False, float_format="%.6g")
    return [path / "summary.csv", path / "results.parquet"]


def _flat(c: Comparison) -> dict[str, Any]:
    columns = dict(vars(c))
    for name in _INTERVALS:
        columns |= getattr(c, name).as_columns(name)
    return {name: columns[name] for name in _SUMMARY}
