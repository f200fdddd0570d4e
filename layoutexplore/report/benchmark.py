"""The report of a benchmark: report.html, report.md and summary.csv from a results folder alone."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from layoutexplore.benchmark.analysis import (
    METRICS,
    Comparison,
    agents_of,
    groups,
    headline_level,
    measured_levels,
    summarise_agents,
)
from layoutexplore.benchmark.rows import Row
from layoutexplore.benchmark.store import ResultsFolder
from layoutexplore.errors import checks_arguments
from layoutexplore.files import atomic, write_atomically
from layoutexplore.report.agent_table import agent_table, rank
from layoutexplore.report.benchmark_view import BenchmarkView
from layoutexplore.report.templates import interval, number, percent, render

_INTERVALS = ("ratio", "plan_ratio", "improvement")
_SUMMARY = [
    *("sensor", "agent", "metric", "cells", "plans", "buildings"),
    *(f"{name}{end}" for name in _INTERVALS for end in ("", "_low", "_high")),
    "reached",
]
"""Columns of summary.csv."""


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
    view = BenchmarkView.of(folder, baseline, comparisons)
    written = []
    for name, template in (("report.html", "benchmark.html"), ("report.md", "benchmark.md")):
        write_atomically(folder.path / name, render(template, view=view))
        written.append(folder.path / name)
    return [*written, *_write_tables(folder.path, view.rows, view.comparisons)]


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
        table = agent_table(part, [], summaries, measured_levels(rows), level)
        found = [(line.agent, [*(line.metres[m] for m, _ in names), line.distance]) for line in table]
        header = ("agent", *(f"metres to {text}" for _, text in names), "in all")
        return [header, *((agent, *(number(metres, 1) for metres in every)) for agent, every in found)]
    by_agent: dict[str, dict[str, Comparison]] = {agent: {} for agent in agents_of(part)}
    for c in comparisons:
        by_agent[c.agent][c.metric] = c
    ranked = sorted(by_agent.items(), key=lambda item: rank(item[1].get(level)))
    header = (f"metres / {baseline}'s", *(f"to {text}" for _, text in names), "better", "reached 99 %")
    body = [
        (
            agent,
            *(_short(found.get(m), full=m == level) for m, _ in names),
            percent(found[level].improvement.estimate) if level in found and agent != baseline else "–",
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


def _write_tables(path: Path, rows: Sequence[Row], comparisons: Sequence[Comparison]) -> list[Path]:
    import pandas as pd

    with atomic(path / "results.parquet") as temporary:
        columns = {
            field.name: [getattr(row, field.name) for row in rows] for field in dataclasses.fields(Row)
        }
        with temporary.open("wb") as file:  # pyarrow opens no file whose name is no text
            pd.DataFrame(columns).to_parquet(file, index=False)
    flat = [_flat(c) for c in comparisons]
    with atomic(path / "summary.csv") as temporary:
        pd.DataFrame(flat, columns=_SUMMARY).to_csv(temporary, index=False, float_format="%.6g")
    return [path / "summary.csv", path / "results.parquet"]


def _flat(c: Comparison) -> dict[str, Any]:
    columns = dict(vars(c))
    for name in _INTERVALS:
        columns |= getattr(c, name).as_columns(name)
    return {name: columns[name] for name in _SUMMARY}
