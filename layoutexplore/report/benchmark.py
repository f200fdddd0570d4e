"""The report of a benchmark: report.html, report.md and summary.csv from a results folder alone."""

from __future__ import annotations

import dataclasses
import functools
import math
import platform
import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

import layoutexplore
from layoutexplore.benchmark.analysis import (
    METRICS,
    POOLED,
    AgentSummary,
    Comparison,
    agents_of,
    by_plan,
    compare,
    groups,
    pooled_curves,
    summarise_agents,
)
from layoutexplore.benchmark.rows import Row, knows_the_plan
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.drawing import palette
from layoutexplore.errors import checks_arguments
from layoutexplore.files import atomic, write_atomically
from layoutexplore.report.caveats import caveats
from layoutexplore.report.layout_section import layout_section, prior_section
from layoutexplore.report.plots import (
    CurveLine,
    ForestPlot,
    ScaleBar,
    TrackPicture,
    agent_looks,
    curve_lines,
    floor_picture,
    forest,
    heat,
    scale_bar,
    track_picture,
)
from layoutexplore.report.profiles import profile_plot
from layoutexplore.report.replay import replay_view, runs_to_replay
from layoutexplore.report.templates import interval, number, percent, render

NBSP = "\N{NO-BREAK SPACE}"

PICTURED_PLANS = 4
"""Floor plans on which tracks are drawn: the smallest, the largest, and evenly between."""

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
    """One row of the tables: an agent's comparisons by level, figures, how often it reached each level."""

    agent: str
    privileged: bool
    ratios: dict[str, Comparison]
    summary: AgentSummary
    reached: dict[str, float]
    metres: dict[str, float]


@dataclass(frozen=True)
class PlanLine:
    """One row of the table by floor plan: metres of each agent to 95 %, and their ratio to the baseline's."""

    plan: str
    sensor: str
    area: float
    metres: dict[str, float]
    ratios: dict[str, float]


@dataclass(frozen=True)
class Picture:
    """A track on a floor plan."""

    caption: str
    row: Row
    floor: str
    width: int
    height: int
    track: TrackPicture
    scale: ScaleBar

    @property
    def wide(self) -> bool:
        """Whether the plan needs a wide frame to be seen."""
        return self.width > 2.2 * self.height


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
    parts = groups(rows)
    shown, looks = [], agent_looks([], baseline)
    for name, part in parts.items():
        mine = [c for c in comparisons if c.sensor == name]
        table = _table(part, mine, [s for s in summaries if s.sensor == name])
        order = [line.agent for line in table]
        looks = looks or agent_looks(order, baseline)
        lines = curve_lines(pooled_curves(part, baseline, curves), order, looks)
        shown.append(Group(name, forest(mine), table, lines))
    best = _best(shown, baseline)
    layouts = layout_section(folder, rows, comparisons, baseline, curves, looks)
    replayed = runs_to_replay(rows, (picture.row for picture in layouts["decisive"]))
    return {
        "groups": shown,
        "comparisons": comparisons,
        "baseline": baseline,
        "has_baseline": bool(comparisons),
        "best": best,
        "verdict": _verdict(best, baseline) if best else "",
        "plans": _plan_lines(rows, baseline),
        "buildings": max((c.buildings for c in comparisons), default=0),
        "order": [line.agent for line in shown[0].table] if shown else [],
        "pictures": _pictures(folder, rows, shown, baseline),
        "failed": [row for row in rows if row.error],
        "rows": rows,
        "counts": _counts(rows),
        "columns": _columns(),
        "settings": manifest["settings"],
        "manifest": manifest,
        "versions": _versions(),
        "caveats": caveats(
            rows, manifest["settings"], candidates=len(_candidates(shown, baseline)) if best else 1
        ),
        "heat": heat,
        "metrics": METRICS,
        "pooled": POOLED,
        **layouts,
        "beliefs": prior_section(folder, rows, baseline, looks),
        "replay": replay_view(folder, replayed),
        "profile": profile_plot(rows, looks),
        "looks": looks,
        "ramp": [palette.to_hex(palette.RAMP[end]) for end in (0, -1)],
    }


def headline(rows: Sequence[Row], baseline: str, comparisons: Sequence[Comparison]) -> list[tuple[str, ...]]:
    """The table for the terminal: a header, then a row an agent, best first."""
    parts = groups(rows)
    if not parts:
        return [("agent",)]
    name, part = next(iter(parts.items()))
    comparisons = [c for c in comparisons if c.sensor == name]
    levels = [(m, f"{m[1:]} %") for m in METRICS]
    if not comparisons:
        # compared with nobody, also where the baseline ran: nothing was seen to 90 %
        table = _table(part, [], summarise_agents(part, "", lambda _: np.empty((0, 2))))
        header = ("agent", *(f"metres to {level}" for _, level in levels))
        return [header, *((line.agent, *(number(line.metres[m], 1) for m, _ in levels)) for line in table)]
    by_agent: dict[str, dict[str, Comparison]] = {}
    for c in comparisons:
        by_agent.setdefault(c.agent, {})[c.metric] = c
    ranked = sorted(by_agent.items(), key=lambda item: _rank(item[1]))
    header = (f"metres / {baseline}'s", *(f"to {level}" for _, level in levels), "better", "reached 99 %")
    body = [
        (
            agent,
            *(_short(found.get(m), full=m == "d95") for m, _ in levels),
            percent(found["d95"].improvement.estimate) if "d95" in found else "–",
            percent(found["d99"].reached) if "d99" in found else "–",
        )
        for agent, found in ranked
    ]
    return [header, *body]


def _short(c: Comparison | None, *, full: bool) -> str:
    return "–" if c is None else interval(c.ratio) if full else number(c.ratio.estimate)


def _table(
    part: Sequence[Row], comparisons: Sequence[Comparison], summaries: Sequence[AgentSummary]
) -> list[AgentLine]:
    """One line an agent, the best first."""
    by_agent = {s.agent: s for s in summaries}
    lines = []
    for agent in agents_of(part):
        mine = [row for row in part if row.agent == agent]
        found = {c.metric: c for c in comparisons if c.agent == agent}
        reached = {
            m: sum(getattr(row, m.replace("d", "reached")) for row in mine) / len(mine) for m in METRICS
        }
        metres = {m: sum(getattr(row, m) for row in mine) / len(mine) for m in METRICS}
        lines.append(AgentLine(agent, knows_the_plan(agent), found, by_agent[agent], reached, metres))
    return sorted(lines, key=lambda line: (_rank(line.ratios), line.metres["d95"], line.agent))


def _rank(ratios: dict[str, Comparison]) -> float:
    return ratios["d95"].ratio.estimate if "d95" in ratios else math.inf


def _best(shown: Sequence[Group], baseline: str) -> Comparison | None:
    """The best comparison at d95 of an agent that does not know the plan."""
    return min(_candidates(shown, baseline), key=lambda c: c.ratio.estimate, default=None)


def _candidates(shown: Sequence[Group], baseline: str) -> list[Comparison]:
    """The comparisons at d95 of all agents but the baseline that do not know the plan."""
    lines = (
        [line for line in shown[0].table if not line.privileged and line.agent != baseline] if shown else []
    )
    return [line.ratios["d95"] for line in lines if "d95" in line.ratios]


def _verdict(best: Comparison, baseline: str) -> str:
    """One honest sentence about the best agent; its subject is the agent."""
    ratio = best.ratio
    known = math.isfinite(ratio.low)
    interval_text = f" (95{NBSP}% interval {number(ratio.low)}–{number(ratio.high)})" if known else ""
    needs = f"{number(ratio.estimate)} of the metres of {baseline} to see 95{NBSP}% of a floor{interval_text}"
    better = (
        f"It needs fewer than {baseline} in {percent(best.improvement.estimate)} of {best.cells} paired runs."
    )
    if known and ratio.high < 1:
        return f"needs {needs}. {better}"
    if known and ratio.low > 1:
        return f"comes nearest to {baseline}, but is not as good: it needs {needs}. {better}"
    doubt = (
        "the interval does not leave out 1, so this may be chance"
        if known
        else "on one floor plan, which proves nothing"
    )
    place = "comes out best" if ratio.estimate < 1 else f"comes nearest to {baseline}"
    return f"{place} with {needs}, but {doubt}. {better}"


def _plan_lines(rows: Sequence[Row], baseline: str) -> list[PlanLine]:
    areas = {(row.plan, row.sensor): row.target_area for row in rows if not row.error}
    lines = []
    for (plan, sensor), metres in by_plan(rows, "d95").items():
        base = metres.get(baseline)
        ratios = {agent: value / base if base else math.nan for agent, value in metres.items()}
        lines.append(PlanLine(plan, sensor, areas[plan, sensor], metres, ratios))
    return lines


def _pictures(
    folder: ResultsFolder, rows: Sequence[Row], shown: Sequence[Group], baseline: str
) -> list[tuple[str, list[Picture]]]:
    """The tracks of the best agent, the baseline, the worst and one that knows the plan, on a few plans."""
    good = [row for row in rows if not row.error]
    if not good:
        return []
    sensor = good[0].sensor
    areas = {row.plan: row.target_area for row in good if row.sensor == sensor}
    plans = sorted(areas, key=lambda plan: (areas[plan], plan))
    count = min(PICTURED_PLANS, len(plans))
    chosen = [plans[round(k * (len(plans) - 1) / max(count - 1, 1))] for k in range(count)]
    knowing = {line.agent for group in shown for line in group.table if line.privileged}
    found = []
    for plan in chosen:
        start = min(row.start for row in good if row.plan == plan and row.sensor == sensor)
        here = [row for row in good if (row.plan, row.start, row.sensor) == (plan, start, sensor)]
        here.sort(key=lambda row: (math.isnan(row.d95), row.d95, row.agent))
        honest = [row for row in here if row.agent not in knowing]
        picks = {
            "best": honest[:1],
            "baseline": [row for row in here if row.agent == baseline],
            "worst": honest[-1:],
            "knows the plan": [row for row in here if row.agent in knowing][:1],
        }
        captions: dict[Row, list[str]] = {}
        for caption, picked in picks.items():
            for row in picked:
                captions.setdefault(row, []).append(caption)
        found.append(
            (
                f"{plan}, start {start}, {sensor}",
                [_picture(folder, ", ".join(c), row) for row, c in captions.items()],
            )
        )
    return found


def _picture(folder: ResultsFolder, caption: str, row: Row) -> Picture:
    occupied, frame = folder.raster(row.plan)
    _, track = folder.episode(row)
    rows, cols = occupied.shape
    way, scale = track_picture(track, frame, rows), scale_bar(cols, float(frame[0]))
    return Picture(caption, row, floor_picture(occupied), cols, rows, way, scale)


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
        pd.DataFrame(flat).to_csv(temporary, index=False, float_format="%.6g")
    return [path / "summary.csv", path / "results.parquet"]


def _flat(c: Comparison) -> dict[str, Any]:
    row: dict[str, Any] = {
        "sensor": c.sensor,
        "agent": c.agent,
        "metric": c.metric,
        "cells": c.cells,
        "plans": c.plans,
        "buildings": c.buildings,
    }
    for name in ("ratio", "plan_ratio", "improvement"):
        value = getattr(c, name)
        row |= {name: value.estimate, f"{name}_low": value.low, f"{name}_high": value.high}
    return row | {"reached": c.reached}
